"""Whether to try a doorway that may be closed: go there and see, or go round at once.

Who finds it closed goes on from in front of it by the best way without it.  What it is to find doorways closed at
other places on the way is left out: the doorways are open all together, or not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from typing import Any

import numpy as np

from qualrl.answers.depth import Depth
from qualrl.answers.ways import course
from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import door_taken
from qualrl.planning.plan import in_steps
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.break_even import BreakEven
from qualrl.qualitative.plan_value import Chance, Contrast, contrast
from qualrl.solving.exact import ExactValues
from qualrl.spatial.region_map import Doorway

STRAIGHT = 4
"""Directions of a robot that makes no diagonal moves."""
ROUNDING = 1e-9
"""Of a probability."""


@dataclass(frozen=True)
class Trying:
    """The answer for moves that do not slip."""

    door: str
    is_alone: bool
    """Whether no other doorway is closed with it, to be open or not as it is."""
    """The closed doorway that is tried: of all ways to one, that which pays at the least probability."""
    gamma: float
    break_even: BreakEven
    chance: float | None
    """A probability that it is open, asked about."""
    contrast: Contrast | None
    """Trying with that probability against going round, for every gamma."""

    @property
    def values(self) -> dict[str, float]:
        """What each of the three ways is worth."""
        ways = self.break_even
        return {
            "open": ways.open.value(self.gamma), "closed": ways.closed.value(self.gamma),
            "round": ways.round.value(self.gamma),
        }  # fmt: skip

    def lines(self, depth: Depth) -> Iterator[str]:
        """In words."""
        going = f"Going to {self.door} to see whether it is open"
        signs = f"is one way, going round at once another{depth.at_signs(f': {self._signs()}')}"
        going += "" if self.is_alone else " (all that are closed are, or none)"
        yield f"{going} {depth.at_numbers(self._worths(), signs)}."
        if depth == Depth.NAMES:
            return
        at, limit = self.break_even.at(self.gamma), self.break_even.limit
        if at is not None and at > 1 - ROUNDING:
            yield "So trying never pays: going round is as good even if it is open."
        elif at is not None:
            tends = "" if limit is None else f" (as gamma tends to 1: {float(limit):.4g})"
            enough = f"with a probability above {at:.4g} at gamma {self.gamma:.12g}{tends}"
            yield f"So trying pays if it is open {depth.at_numbers(enough, 'with a probability that is high enough')}."
        else:
            yield "So for who goes there it makes no difference whether it is open."
        if self.contrast is not None:
            words = self.contrast.in_words("trying", "going round", depth == Depth.NUMBERS)
            chance = depth.at_numbers(f"probability {self.chance:g}", "the probability asked about")
            yield f"If it is open with {chance}, {words}."

    def _worths(self) -> str:
        more = self.break_even.more_than_round(self.gamma)
        opened, closed, around = (f"{of:.6g}" for of in self.values.values())
        if len({opened, closed, around}) < len({*more, 0}):
            opened, closed = (_beside_round(of) for of in more)
        return (
            f"is worth {opened} if it is, {closed} if it is not "
            f"({in_steps(self.break_even.closed.steps)}); going round at once, {around}"
        )

    def _signs(self) -> str:
        """What going there is worth beside going round."""
        seen, not_seen = (("less", "as much", "more")[1 + sign] for sign in self.break_even.signs_at(self.gamma))
        return f"going there is worth {seen} if it is open, {not_seen} if it is not"

    def to_dict(self) -> dict[str, Any]:
        """As JSON; small differences as text, since floating point may not hold them."""
        limit, more = self.break_even.limit, self.break_even.more_than_round(self.gamma)
        return {
            "door": self.door,
            "alone": self.is_alone,
            "gamma": self.gamma,
            "values": self.values,
            "more_than_round": dict(zip(("open", "closed"), (f"{of:.17g}" for of in more), strict=True)),
            "steps_if_closed": self.break_even.closed.steps,
            "break_even": self.break_even.at(self.gamma),
            "limit": None if limit is None else str(limit),
            "formula": str(self.break_even.formula()),
            "grows": self.break_even.grows.to_dict("open", "closed"),
            "chance": self.chance,
            "contrast": None if self.contrast is None else self.contrast.to_dict("trying", "round"),
        }


def _beside_round(more: Decimal) -> str:
    if more == 0:
        return "as much as going round"
    return f"{abs(more):.3g} {'more' if more > 0 else 'less'} than going round"


def trying(
    before: HybridMDP, after: HybridMDP, walk: Sequence[int], walk_round: Sequence[int], exact_after: ExactValues,
    chance: float | None, exact: ExactValues | None = None,
) -> Trying | None:  # fmt: skip
    """Compare trying a closed doorway with going round; None where the best way passes no doorway closed since.

    before, after: with the doorways open and closed; walk, walk_round: their best ways; exact: values before, to look
    for the place at which trying pays soonest; without them it is where the walk comes to a closed doorway.
    """
    at = _first_closed(before, after, walk)
    if at is None or before.grid.slip > 0 or before.grid.differs_in(after.grid) != {"closed"}:
        return None
    there, onward = list(walk[: at + 1]), list(walk[at + 1 :])
    if exact is not None and before.grid.directions == STRAIGHT:
        there, onward = _cheapest_try(before, after, exact, exact_after, (there, onward))
    assert before.regions is not None
    door = door_taken(before, before.regions, there[-1], onward[0])
    back = exact_walk(after, exact_after, there[-1])
    opened, closed = [*there, *onward], [*there[:-1], *back]
    ways = BreakEven(course(before, opened), course(after, closed), course(after, walk_round))
    compared = None if chance is None else contrast(Chance(chance, ways.open, ways.closed), ways.round)
    return Trying(door.name, _is_alone(before, after, door), before.gamma, ways, chance, compared)


def _is_alone(before: HybridMDP, after: HybridMDP, door: Doorway) -> bool:
    """Whether closing a doorway alone closes all that is closed."""
    return np.array_equal(before.with_closed([door.name]).grid.successor, after.grid.successor)


def _cheapest_try(
    before: HybridMDP, after: HybridMDP, exact: ExactValues, exact_after: ExactValues, told: tuple[list[int], list[int]]
) -> tuple[list[int], list[int]]:
    """States to a step that is closed, and on after it: of all such steps one that pays at the least probability.

    told: those of the best way, which are kept if none pays at less.  The robot makes no diagonal moves.
    """
    opened, shut, gamma = before.grid, after.grid, before.gamma
    start = told[0][0]
    steps = breadth_first(shut.successor, np.array([start]))[1]
    here, moves = np.nonzero(opened.successor != shut.successor)
    there = opened.successor[here, moves].astype(np.int64)
    can = (steps[here] >= 0) & ((opened.steps_to_goal[there] > 0) | (there == opened.goal)) & (here != opened.goal)
    here, there = here[can], there[can]
    beyond = np.where(there == opened.goal, opened.goal_reward + exact.shift, gamma * exact.shifted[there])
    discount = gamma ** steps[here].astype(float)
    gain = discount * (beyond - exact_after.shifted[here])
    with np.errstate(divide="ignore", invalid="ignore"):
        enough = (exact_after.shifted[start] - discount * exact_after.shifted[here]) / gain
    enough[~(gain > ROUNDING * discount * beyond)] = np.inf
    own = enough[(here == told[0][-1]) & (there == told[1][0])]
    best = int(enough.argmin())
    if not enough[best] < min(own.min(), 1.0) - ROUNDING:
        return told
    first, last = [int(here[best])], int(there[best])
    while first[-1] != start:  # every move can be taken back
        near = shut.successor[first[-1]]
        first.append(int(near[(steps[near] == steps[first[-1]] - 1).argmax()]))
    return first[::-1], [last] if last == opened.goal else exact_walk(before, exact, last)


def _first_closed(before: HybridMDP, after: HybridMDP, walk: Sequence[int]) -> int | None:
    """The index of the first step of a walk that is closed in the other model."""
    if len(before) != len(after) or before.regions is None:
        return None
    successor = after.grid.successor
    for at, (here, there) in enumerate(pairwise(walk)):
        if there not in successor[here]:
            return at
    return None
