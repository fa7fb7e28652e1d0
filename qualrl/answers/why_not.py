"""Why a plan does not go by a given place: the best way that does, what it costs more, and where it would win."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

from qualrl.answers.answer import Answer
from qualrl.answers.depth import Depth
from qualrl.answers.over_gamma import UNDECIDED, OverGamma, Span, over_gamma
from qualrl.answers.stops import way_by, worth_by
from qualrl.answers.trying import trying
from qualrl.answers.ways import Way, course, longer, way_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.break_even import BreakEven
from qualrl.qualitative.plan_value import Contrast, contrast
from qualrl.solving.exact import exact_values


@dataclass(frozen=True)
class Rather:
    """How likely a doorway of the best way must be open for that to be worth as much as the way by the stops."""

    door: str
    gamma: float
    break_even: BreakEven
    """Of the best way with the doorway open; of going there, finding it shut and going on; of the way by the stops."""

    @property
    def below(self) -> float | None:
        """The way by the stops is worth more where the doorway is open with a smaller probability; None for never."""
        at = self.break_even.at(self.gamma)
        return at if at is not None and at > 0 else None

    def in_words(self, stops: str, depth: Depth) -> str:
        """As a line of the answer."""
        if self.below is None:
            even = f"Even if {self.door} were never open, going there first"
            return f"{even} would not be worth less than the way by {stops}."
        limit = self.break_even.limit
        tends = "" if limit is None else f" (as gamma tends to 1: {float(limit):.4g})"
        seldom = f"with a probability below {self.below:.4g} at gamma {self.gamma:.12g}{tends}"
        seldom = depth.at_numbers(seldom, "seldom enough")
        return f"The way by {stops} would be worth more if {self.door} were open {seldom}."

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        limit = self.break_even.limit
        return {
            "door": self.door, "below": self.below, "limit": None if limit is None else str(limit),
            "formula": str(self.break_even.formula()),
        }  # fmt: skip


@dataclass(frozen=True)
class WhyNot(Answer):
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    stops: tuple[str, ...]
    gamma: float
    best: Way
    by: Way
    contrast: Contrast | None
    """Of the best way and the one by the stops, for every gamma; None where moves slip, and values are no formula."""
    weigh: Callable[[], tuple[Rather, ...]] = tuple
    """Makes ``rather``: it solves the model once more for each doorway, and not every depth tells of that."""
    over_gamma: OverGamma | None = None
    """Of the two for a range of gammas, where moves slip; None unless asked for."""

    @property
    def is_by_itself(self) -> bool:
        """Whether the best way is as good as one by the stops, or is one."""
        return self.costs <= 0

    @property
    def costs(self) -> float:
        """By how much the best way is worth more."""
        return self.best.worth.beside(self.by.worth)

    @cached_property
    def rather(self) -> tuple[Rather, ...]:
        """Of each doorway that the best way passes and the other does not; () where moves slip."""
        return self.weigh()

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        stops = ", then ".join(self.stops)
        yield f"Best from {self.start} to {self.goal}: {self.best.with_worth(depth)}."
        yield f"Best by {stops}: {self.by.with_worth(depth)}."
        if depth == Depth.NAMES:
            return
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        if self.is_by_itself:
            yield f"So going by {stops} costs nothing{at}."
        else:
            cost = depth.at_numbers(f"{self.costs:.3g}", "something")
            yield f"Going by {stops} costs {cost}{at}: {longer(self.by, self.best, depth)}."
        if self.contrast is not None:
            words = self.contrast.in_words("the best way", f"the way by {stops}", depth == Depth.NUMBERS)
            yield f"Of these two ways, {words}."
            if not self.is_by_itself:
                yield from (of.in_words(stops, depth) for of in self.rather)
        elif self.over_gamma is not None:
            words = self.over_gamma.in_words("the best of all", f"the best by {stops}", depth)
            yield f"Of the best ways at each gamma, {words}."
        else:
            yield f"For which other gamma it would pay is {UNDECIDED}."

    def facts(self) -> dict[str, Any]:
        """See Answer; with the formulas and the certificate."""
        return {
            "question": "why-not", "from": self.start, "to": self.goal, "via": list(self.stops), "gamma": self.gamma,
            "best": self.best.to_dict(), "by": self.by.to_dict(), "costs": self.costs,
            "contrast": None if self.contrast is None else self.contrast.to_dict("best", "by"),
            "rather": [of.to_dict() for of in self.rather],
            "over_gamma": None if self.over_gamma is None else self.over_gamma.to_dict("best", "by"),
        }  # fmt: skip


def why_not(
    model: HybridMDP, start: int, names: tuple[str, str], stops: Sequence[str], gammas: Span | None = None
) -> WhyNot:
    """Ask why the plan from a state does not go by some stops (regions, doorways, landmarks), in their order.

    names: what to call start and goal.  gammas: a range to compare the two for, where moves slip.
    Raises NoPlanError where no way leads there, UnknownNameError for a stop that is not on the map, and SettingError
    without a stop, or for a range that cannot be told about.
    """
    if not stops:
        raise SettingError("say by which place: a region, a doorway or a landmark")
    model.check_reachable(start)
    exact = exact_values(model.world)
    best = exact_walk(model, exact, start)
    by = way_by(model, exact, start, stops)
    way = way_of(model, [best], exact.shifted[start], exact.shift)
    other = way_of(model, by.parts, by.shifted, exact.shift, by.stops)
    slips, ranged = model.grid.slip > 0, None
    if gammas is not None:
        ranged = over_gamma(model, gammas, lambda at, of: (float(of.shifted[start]), worth_by(at, of, start, stops)))
    return WhyNot(
        *names, tuple(stops), model.gamma, way, other,
        None if slips else contrast(course(model, best), course(model, by.walk)),
        tuple if slips else partial(_rather, model, best, by.walk, way, other), ranged,
    )  # fmt: skip


def _rather(model: HybridMDP, best: Sequence[int], by: Sequence[int], way: Way, other: Way) -> tuple[Rather, ...]:
    """The best way if a doorway that the other one does not pass may be shut, of each in turn."""
    found = []
    for door in dict.fromkeys(way.doors):
        shut = model.with_closed([door])
        if door not in other.doors and all(to in shut.grid.successor[at] for at, to in pairwise(by)):
            tried = trying(model, shut, best, by, exact_values(shut.world), None)
            if tried is not None:
                found.append(Rather(tried.door, tried.gamma, tried.break_even))
    return tuple(found)
