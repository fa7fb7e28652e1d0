"""Why a plan takes this doorway and not the next best: the difference in value, booked by region and kind of reward.

S states, A actions.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.account import Account, account_of_policy, account_of_walk
from qualrl.answers.answer import ALIKE, WORTH, Answer
from qualrl.answers.depth import Depth
from qualrl.answers.over_gamma import UNDECIDED, OverGamma, Span, check_gammas, over_gamma
from qualrl.answers.policy import best_policy
from qualrl.answers.slope import Slope
from qualrl.answers.through import ThroughWay, value_through, way_through
from qualrl.answers.ways import Way, Worth, course, longer, way_of, worth_of
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.choices import Chooser
from qualrl.planning.crossings import doors_between
from qualrl.planning.legs import legs_of
from qualrl.planning.planner import exact_walk
from qualrl.planning.values import exact_plan_values
from qualrl.qualitative.plan_value import Contrast, contrast
from qualrl.solving.exact import ExactValues, exact_values
from qualrl.spatial.region_map import Doorway

FELT = 1e-3
"""Entries that differ by less than this share of the margin are put in words together."""


@dataclass(frozen=True)
class Entry:
    """What the two ways earn in one region by one kind of reward, discounted to where they part."""

    region: str
    kind: str
    best: float
    other: float

    @property
    def difference(self) -> float:
        """By which the best way is ahead here."""
        return self.best - self.other

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        both = depth.at_numbers(f"{self.best:.6g} beside {self.other:.6g}, ")
        return f"  {self.region}, {self.kind}: {both}{_ahead(self.difference, depth)}"


@dataclass(frozen=True)
class Why(Answer):
    """The answer."""

    at: str
    """The region the question is about."""
    cell: tuple[int, int]
    """Row and column where it is asked."""
    goal: str
    gamma: float
    action: str
    best: Way
    other_action: str | None
    """The next best doorway; None where no other leads on to the goal."""
    other: Way | None
    entries: tuple[Entry, ...]
    """The accounts of both ways, largest difference first; the differences add up to that of the values."""
    contrast: Contrast | None
    """Of both ways for every gamma; None where moves slip, or there is only one."""
    bound: Worth | None = None
    """What the best doorway is worth if slips may not change it; None where no move slips, or that is all the same."""
    over_gamma: OverGamma | None = None
    """Of leaving by the one doorway or the other, for a range of gammas where moves slip; None unless asked for."""
    can_come_back: bool = False
    """Whether there are ways out of the region by one doorway and back by another; told where no other leads on."""

    @property
    def margin(self) -> float:
        """By how much the best way is worth more than the other; 0 without one."""
        return 0.0 if self.other is None else self.best.worth.beside(self.other.worth)

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        cell = depth.at_numbers(f", at row {self.cell[0]}, column {self.cell[1]}")
        yield f"In {self.at}{cell}, the plan for {self.goal} is to {self.action}: {self.best.with_worth(depth)}."
        if self.other is None:
            here = "The goal is in it" if not self.best.doors else "No other doorway leads on from there"
            back = " without coming back" if self.can_come_back else ""
            yield f"{here}{back}, so there is nothing to choose."
            return
        margin = self.margin
        by = f"{margin:.3g} less" if margin > 0 else f"{-margin:.3g} more while no slip leads through another doorway"
        less = depth.at_numbers(
            by if margin else self.best.worth.alike(self.other.worth),
            self.other.worth_beside(self.best),
        )
        less = depth.from_signs(f", {less}") + depth.at_signs(f"; {longer(self.other, self.best, depth)}")
        yield f"Next best is to {self.other_action}: {self.other.with_worth(depth)}{less}."
        if depth == Depth.NAMES:
            return
        if abs(margin) > ALIKE * abs(self.best.value):
            yield from self._made_up_of(margin, depth)
        if self.bound is not None:
            words = WORTH[1 + int(np.sign(self.bound.beside(self.best.worth)))]
            worth = depth.at_numbers(f"worth {self.bound.value:.6g}", words)
            bound = f"bound to {self.best.doors[0]}, the others shut to slips, too, it would be {worth}"
            yield f"The plan may turn to another doorway after a slip; {bound}."
        if self.contrast is not None:
            words = self.contrast.in_words("the plan", "the next best", depth == Depth.NUMBERS)
            yield f"Of these two ways, {words}."
        elif self.over_gamma is not None:
            ways = (self.best, self.other)
            one, other = (f"the way by {way.doors[0]}" if way.doors else "staying" for way in ways)
            words = self.over_gamma.in_words(one, other, depth)
            yield f"If slips may not change which doorway it is, {words}."
        else:
            yield f"Which is better at another gamma is {UNDECIDED}."

    def _made_up_of(self, margin: float, depth: Depth) -> Iterator[str]:
        told = [entry for entry in self.entries if abs(entry.difference) > FELT * abs(margin)]
        counted = "The" if margin > 0 else "Counted for the plan, the"
        all_of_it = f"{counted} {margin:.3g} at gamma {self.gamma:.12g} is made up of:"
        yield depth.at_numbers(all_of_it, "What is for it and what against it, what matters most first:")
        yield from (entry.in_words(depth) for entry in told)
        rest = sum(entry.difference for entry in self.entries[len(told) :])
        if len(told) < len(self.entries) and (depth == Depth.NUMBERS or abs(rest) > ALIKE * abs(margin)):
            yield f"  elsewhere: {_ahead(rest, depth)}"

    def facts(self) -> dict[str, Any]:
        """See Answer; with the formulas and the certificate."""
        return {
            "question": "why", "at": self.at, "cell": list(self.cell), "to": self.goal, "gamma": self.gamma,
            "action": self.action, "best": self.best.to_dict(), "other_action": self.other_action,
            "other": None if self.other is None else self.other.to_dict(), "margin": self.margin,
            "can_come_back": self.can_come_back,
            "bound": None if self.bound is None else {"value": self.bound.value, "shifted": self.bound.shifted},
            "entries": [
                {"region": of.region, "kind": of.kind, "best": of.best, "other": of.other, "difference": of.difference}
                for of in self.entries
            ],
            "contrast": None if self.contrast is None else self.contrast.to_dict("best", "other"),
            "over_gamma": None if self.over_gamma is None else self.over_gamma.to_dict("best", "other"),
        }  # fmt: skip


def _ahead(difference: float, depth: Depth) -> str:
    """By how much the best way is ahead."""
    return depth.at_numbers(f"{abs(difference):.3g} ") + ("for it" if difference > 0 else "against it")


def why(model: HybridMDP, start: int, goal: str, at: str | None, gammas: Span | None = None) -> Why:
    """Ask why the plan from a state goes on as it does where it enters the region ``at``, or right there (None).

    goal: what to call it.  gammas: a range to compare the two doorways for, where moves slip.
    A region that the plan does not pass is asked about at its centre.
    Raises NoPlanError where no way leads to the goal, SettingError for a range that cannot be told about.
    """
    assert model.regions is not None
    model.check_reachable(start)
    if gammas is not None:
        check_gammas(model, gammas)
    exact = exact_values(model.world)
    walk = exact_walk(model, exact, start)
    if at is not None:
        walk = _from(model, exact, walk, at)
    place, cell = model.region_names[int(model.region_of[walk[0]])], model.cell_of(walk[0])
    best = way_of(model, [walk], exact.shifted[walk[0]], exact.shift)
    legs = legs_of(model, walk)
    if len(legs) < 2:
        return Why(place, cell, goal, model.gamma, "walk to the goal", best, None, None, (), None)
    (door,) = doors_between(model, model.regions, walk, legs[:2])
    action = _action(door, best.places[1])
    chooser = Chooser(model, model.regions, exact_plan_values(model, exact))
    choices = chooser.at(walk[0], door)
    others = [choice for choice in choices if choice.door is not door]
    if not others:
        back = chooser.can_come_back(legs[0].region)
        return Why(place, cell, goal, model.gamma, action, best, None, None, (), None, can_come_back=back)
    through = way_through(model, exact, walk[0], others[0].door)
    other = way_of(model, through.parts, through.shifted, exact.shift)
    slips = model.grid.slip > 0
    accounts = _expected(model, exact, walk[0], through) if slips else _walked(model, walk, through)
    return Why(
        place, cell, goal, model.gamma, action, best,
        _action(others[0].door, model.region_names[others[0].to_region]), other, _entries(*accounts),
        None if slips else contrast(course(model, walk), course(model, through.walk)),
        _bound(model, exact, walk[0], door, best) if slips else None,
        None if gammas is None else over_gamma(model, gammas, partial(_through, walk[0], (door, others[0].door))),
    )  # fmt: skip


def _from(model: HybridMDP, exact: ExactValues, walk: list[int], at: str) -> list[int]:
    """The walk from where it enters a region; where it does not, the best one from the region's centre."""
    assert model.regions is not None
    region = model.region_names.index(at)
    for index, state in enumerate(walk):
        if model.region_of[state] == region:
            return walk[index:]
    state = int(model.grid.state_of[model.regions.regions[region].centre])
    model.check_reachable(state)
    return exact_walk(model, exact, state)


def _action(door: Doorway | None, to: str) -> str:
    return f"stay in {to}" if door is None else f"go through {door.name} to {to}"


def _bound(model: HybridMDP, exact: ExactValues, start: int, door: Doorway, best: Way) -> Worth | None:
    """See ``Why.bound``."""
    shifted = value_through(model, exact, start, door)
    worth = worth_of(model.grid, shifted, exact.shift)
    return worth if worth.beside(best.worth) else None


def _through(
    start: int, doors: tuple[Doorway, Doorway | None], model: HybridMDP, exact: ExactValues
) -> tuple[float, float]:
    """Shifted values of leaving a state's region by each of two doorways, or of staying."""
    one, other = (value_through(model, exact, start, door) for door in doors)
    return float(one), float(other)


def _walked(model: HybridMDP, walk: Sequence[int], through: ThroughWay) -> tuple[Account, Account]:
    return account_of_walk(model, walk), account_of_walk(model, through.walk)


def _expected(model: HybridMDP, exact: ExactValues, start: int, through: ThroughWay) -> tuple[Account, Account]:
    """Accounts of the best policy, and of the one that leaves the region by another doorway first, and is best then."""
    world = model.grid
    everywhere = np.arange(len(world))
    onward = world.successor.astype(np.int64)
    best = best_policy(model, exact)
    first = account_of_policy(model, onward, best, everywhere, start)
    region = int(model.region_of[start])
    inside = np.flatnonzero(model.region_of == region)  # states N .. N + n - 1 of a world that has them twice
    number = np.arange(len(world))
    number[inside] = len(world) + np.arange(len(inside))
    both = np.concatenate([onward, number[through.slope.successor[inside].astype(np.int64)]])
    shut = _policy(through.slope, inside)
    second = account_of_policy(
        model, both, np.concatenate([best, shut]), np.concatenate([everywhere, inside]), int(number[start])
    )
    return first, second


def _policy(slope: Slope, states: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) a best move at each state."""
    return np.array([int(slope.best_moves(state).argmax()) for state in states.tolist()], np.int64)


def _entries(best: Account, other: Account) -> tuple[Entry, ...]:
    entries = [Entry(*key, best.get(key, 0.0), other.get(key, 0.0)) for key in {**best, **other}]
    return tuple(sorted(entries, key=lambda entry: -abs(entry.difference)))
