"""Questions to a model's best plan, one function a question; each answer has ``explain`` and ``to_dict``.

Both take a depth of words, "names", "signs" or "numbers": see ``answers.depth``.
"""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from qualrl.api import PlaceLike, check_type, goal_name, start_of
from qualrl.errors import SettingError, UnknownNameError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.spatial.place import names_between_commas

if TYPE_CHECKING:
    from qualrl.answers.changed_model import Change
    from qualrl.answers.envision import Envisioned
    from qualrl.answers.influences import Influences
    from qualrl.answers.reconcile import Reconciled
    from qualrl.answers.robust import Robust
    from qualrl.answers.robust_slip import RobustSlip
    from qualrl.answers.summary import Summary
    from qualrl.answers.what_if import WhatIf
    from qualrl.answers.which_matters import WhichMatters
    from qualrl.answers.why import Why
    from qualrl.answers.why_not import WhyNot
    from qualrl.answers.why_unreachable import WhyUnreachable
    from qualrl.qualitative.from_counts import Counts, Samples


def why(
    model: HybridMDP,
    at: str | None = None,
    start: PlaceLike | None = None,
    gammas: tuple[float, float] | None = None,
) -> "Why":
    """Why the plan leaves a region as it does and not by the next best doorway: what each way earns, and where.

    at: a region, by default the start's.  gammas: a range to compare the two doorways for, where moves slip.
    Raises UnknownNameError, SettingError, and NoPlanError when no way leads to the goal.
    """
    from qualrl.answers import why as answers

    check_type("why", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has no doorways to choose from")
    if at is not None and at not in model.region_names:
        raise UnknownNameError(model.regions.why_not(at, "no region", model.region_names))
    return answers.why(model, start_of(model, start)[0], goal_name(model), at, gammas)


def why_not(
    model: HybridMDP,
    via: str | Sequence[str],
    start: PlaceLike | None = None,
    gammas: tuple[float, float] | None = None,
) -> "WhyNot":
    """Why the plan does not go by a place (or several, in an order): what that costs, and for which gamma it would win.

    via: names of regions, doorways or landmarks.  gammas: a range to compare the two for, where moves slip.
    Raises NoPlanError when no way leads by them, UnknownNameError, SettingError.
    """
    from qualrl.answers import why_not as answers

    check_type("why_not", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has no places to go by")
    state, name = start_of(model, start)
    stops = [via] if isinstance(via, str) else list(via)
    return answers.why_not(model, state, (name, goal_name(model)), stops, gammas)


def what_if(
    model: HybridMDP,
    start: PlaceLike | None = None,
    *,
    close: str | Iterable[str] = (),
    open: tuple[str, str] | None = None,
    chance: float | None = None,
    **numbers: float,
) -> "WhatIf":
    """What a change does to the plan: its way and value before and after, and where the change begins to matter.

    close: names of doorways, or of regions for all of their doorways; chance: the probability that they are open after
    all.  open: two regions, to open the thinnest wall between them.  numbers: gamma, slip, directions, step_reward,
    goal_reward.  Raises UnknownNameError, SettingError, and NoPlanError where there is no wall to open.
    """
    from qualrl.answers import changed_model

    check_type("what_if", model, HybridMDP, "a HybridMDP, from qualrl.build")
    changed = changed_model.with_numbers(model, **numbers) if numbers else model
    told = tuple(changed_model.set_to(name, f"{name} {number:g}") for name, number in numbers.items())
    return compared(model, changed, start, told, close=close, open=open, chance=chance)


def compared(
    model: HybridMDP,
    changed: HybridMDP,
    start: PlaceLike | None,
    told: "tuple[Change, ...]",
    *,
    close: str | Iterable[str] = (),
    open: tuple[str, str] | None = None,
    chance: float | None = None,
) -> "WhatIf":
    """``what_if`` of a model and one that is changed already, as ``told`` says; close and open change more."""
    from qualrl.answers import changed_model
    from qualrl.answers import what_if as answers

    if model.regions is None or changed.regions is None:
        raise SettingError("a model without a map has nothing to close or open")
    state, name = start_of(model, start)
    after = start_of(changed, start)[0]
    doors = changed_model.doors_named(changed.regions, [close] if isinstance(close, str) else close)
    _check_chance(chance, doors, changed, open)
    unclosed = changed if doors and open is None else None
    if doors:
        words = f"{', '.join(doors)} closed"
        changed, told = changed.with_closed(doors), (*told, changed_model.Change(words, words))
    if open is not None:
        changed, after, opened = changed_model.with_opened(changed, open, after)
        told = (*told, opened)
    return answers.what_if(model, changed, (state, after), (name, goal_name(model)), told, chance, unclosed)


def _check_chance(chance: float | None, doors: Sequence[str], changed: HybridMDP, open: tuple[str, str] | None) -> None:
    """Raise SettingError unless a chance is one, and can be asked about."""
    if chance is None:
        return
    if not 0 <= chance <= 1:
        raise SettingError(f"a chance must be from 0 to 1, got {chance:g}")
    if not doors or open is not None:
        raise SettingError("a chance is that of doorways to close: name them, and open no wall in the same question")
    if changed.grid.slip > 0:
        raise SettingError("whether to go and see is a formula only where no move slips: set slip 0, or ask no chance")


def reconcile(model: HybridMDP, expected: str | Sequence[str], start: PlaceLike | None = None) -> "Reconciled":
    """The smallest change of the map (doorways closed, walls opened) under which an expected plan would be best.

    expected: the regions it passes, in their order, from the start's to the goal's; or their names with commas between.
    Raises UnknownNameError, SettingError, and NoPlanError where nothing would do.
    """
    from qualrl.answers import reconcile as answers

    check_type("reconcile", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has nothing to close or open")
    if not expected:
        raise SettingError("say which regions the plan is expected to pass")
    state, name = start_of(model, start)
    asked = names_between_commas(expected, model.region_names) if isinstance(expected, str) else expected
    return answers.reconcile(model, state, (name, goal_name(model)), asked)


def robust(
    model: HybridMDP,
    start: PlaceLike | None = None,
    *,
    doors: "Mapping[str, tuple[float, float] | Counts]" = MappingProxyType({}),
    times: "Mapping[str, tuple[float, float] | Samples]" = MappingProxyType({}),
    slip: "tuple[float, float] | Counts | None" = None,
    confidence: float = 0.95,
    most: int = 6,
) -> "Robust | RobustSlip":
    """Which way is best while chances of doorways and times of regions, or slips, are known as intervals only.

    doors: the probability that a doorway is open, as (0.6, 0.9), or counted, as Counts(7, 10).  times: how many times
    as long as on the map a region takes, "*" for all others: as (1, 1.5), one number that is not known; or measured,
    as Samples((1.1, 1.4, 0.9)), random each time.  slip: the probability that a move slips, in their stead; then the
    doorways of the start's region are compared.  confidence: with which all that is counted holds at once.  most: ways
    to tell.  Raises UnknownNameError, SettingError, and NoPlanError where no way leads to the goal.
    """
    from qualrl.answers import robust as answers
    from qualrl.answers.robust_slip import robust_slip
    from qualrl.answers.uncertain import Uncertain

    check_type("robust", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has no doorways that may be shut")
    if not isinstance(most, int) or most < 1:
        raise SettingError(f"most must be a whole number from 1 on, got {most!r}")
    for given in (doors, times):
        if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
            raise SettingError(f"doors and times must be {{name: interval}}, got {given!r}")
    state, name = start_of(model, start)
    if slip is not None:
        if doors or times:
            raise SettingError("give slip an interval, or doorways and times: not both, as slips make times random")
        return robust_slip(model, state, (name, goal_name(model)), slip, confidence, most)
    uncertain = Uncertain(dict(doors), dict(times), confidence)
    return answers.robust(model, state, (name, goal_name(model)), uncertain, most)


def which_matters(model: HybridMDP, start: PlaceLike | None = None) -> "WhichMatters":
    """Which doorways and regions the plan hangs on: what is lost without each, and the fewest that cut the goal off.

    Raises NoPlanError when no way leads to the goal, and SettingError for a model without a map.
    """
    from qualrl.answers import which_matters as answers

    check_type("which_matters", model, HybridMDP, "a HybridMDP, from qualrl.build")
    state, name = start_of(model, start)
    return answers.which_matters(model, state, (name, goal_name(model)))


def signs(model: HybridMDP, start: PlaceLike | None = None) -> "Influences":
    """Which way the plan's value goes when a reward, its length, a doorway's chance to be open, or gamma grows.

    By sign algebra where that tells, else by exact signs for every gamma.  Raises NoPlanError when no way leads to the
    goal, and SettingError for a model without a map.
    """
    from qualrl.answers import influences as answers

    check_type("signs", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has no way of places")
    state, name = start_of(model, start)
    return answers.influences(model, state, (name, goal_name(model)))


def envision(model: HybridMDP, start: PlaceLike | None = None) -> "Envisioned":
    """What may happen on the best way: regions and doorways it may pass, each branch with bounds of its probability.

    Raises NoPlanError when no way leads to the goal, and SettingError for a model without a map.
    """
    from qualrl.answers import envision as answers

    check_type("envision", model, HybridMDP, "a HybridMDP, from qualrl.build")
    if model.regions is None:
        raise SettingError("a model without a map has no doorways to tell its states by")
    state, name = start_of(model, start)
    return answers.envision(model, state, (name, goal_name(model)))


def summary(model: HybridMDP) -> "Summary":
    """The best policy in brief: the doorway to leave each region by, exceptions, and where the choice matters most.

    Raises SettingError for a model without a map.
    """
    from qualrl.answers import summary as answers

    check_type("summary", model, HybridMDP, "a HybridMDP, from qualrl.build")
    return answers.summary(model, goal_name(model))


def why_unreachable(model: HybridMDP, start: PlaceLike | None = None) -> "WhyUnreachable":
    """Why no way leads to the goal: what is in the way, and the nearest radius, threshold or doorway to open it.

    The map's file is read again for its thresholds.  Where a way leads, the answer says so.  Raises SettingError for a
    model without a map.
    """
    from qualrl.answers import why_unreachable as answers
    from qualrl.io.ros_thresholds import other_thresholds

    check_type("why_unreachable", model, HybridMDP, "a HybridMDP, from qualrl.build")
    state, name = start_of(model, start)
    return answers.why_unreachable(model, state, (name, goal_name(model)), other_thresholds)
