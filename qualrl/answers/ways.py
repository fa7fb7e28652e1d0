"""A way that questions compare: its places and doorways, its length, its value, and its rewards as a formula."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from qualrl.answers.answer import WORTH, in_sign
from qualrl.answers.depth import Depth
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import door_taken
from qualrl.planning.legs import legs_of
from qualrl.planning.planner import length_m
from qualrl.qualitative.plan_value import Course, course_of

LENGTHS = ("shorter", "as long", "longer")
STEPS = ("fewer steps", "as many steps", "more steps")


@dataclass(frozen=True)
class Way:
    """A way from a start to the goal, as it goes when no move slips."""

    places: tuple[str, ...]
    doors: tuple[str, ...]
    """The doorway taken between each two places."""
    steps: int
    length_m: float
    value: float
    """Expected discounted return at the start, slips included."""

    def in_words(self, depth: Depth) -> str:
        """Places, length and doorways."""
        doors = f"by {', '.join(self.doors)}" if self.doors else ""
        length = depth.at_numbers(f"{self.steps} steps, {self.length_m:.2f} m")
        told = " ".join(part for part in (length, doors) if part)
        return " -> ".join(self.places) + (f" ({told})" if told else "")

    def with_worth(self, depth: Depth) -> str:
        """The same, and what it is worth."""
        return self.in_words(depth) + depth.at_numbers(f", worth {self.value:.6g}")

    def worth_beside(self, other: "Way") -> str:
        """Whether it is worth more than another, in a word."""
        return in_sign(self.value - other.value, other.value, WORTH)

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "places": list(self.places), "doors": list(self.doors), "steps": self.steps, "length_m": self.length_m,
            "value": self.value,
        }  # fmt: skip


def way_of(model: HybridMDP, parts: Sequence[Sequence[int]], value: float) -> Way:
    """A way in one or more parts; where one begins, its place is told however briefly it is visited."""
    regions, places, doors = model.regions, list[str](), list[str]()
    assert regions is not None
    for part in parts:
        legs = legs_of(model, part)
        places += [model.region_names[leg.region] for leg in legs]
        doors += [door_taken(model, regions, part[leg.first - 1], part[leg.first]).name for leg in legs[1:]]
    far_m = sum(length_m(model, part) or 0.0 for part in parts)
    told = tuple(place for place, _ in groupby(places))
    return Way(told, tuple(doors), sum(len(part) - 1 for part in parts), far_m, value)


def course(model: HybridMDP, walk: Sequence[int]) -> Course:
    """The rewards of a walk to the goal, each with the region that its step starts in."""
    if len(walk) < 2:
        return Course(())
    world, states = model.grid, np.array(walk)
    moves = (world.successor[states[:-1]] == states[1:, None]).argmax(axis=1)
    rewards: list[float] = world.move_reward[moves].tolist()
    places = [model.region_names[region] for region in model.region_of[states[:-1]].tolist()]
    return course_of(places, [*rewards[:-1], float(world.goal_reward)])


def longer(way: Way, other: Way, depth: Depth) -> str:
    """How much longer a way is than another: "6 steps more and 1.50 m more", or "it is longer"."""
    steps, far_m = way.steps - other.steps, way.length_m - other.length_m
    if depth == Depth.NUMBERS:
        return f"{_more(steps, 'steps')} and {_more(far_m, 'm', 2)}"
    far = in_sign(far_m, other.length_m, LENGTHS)
    walked = in_sign(steps, other.steps, STEPS)
    return f"it is {far}" if LENGTHS.index(far) == STEPS.index(walked) else f"it is {far}, with {walked}"


def _more(amount: float, unit: str, digits: int = 0) -> str:
    """How much more or less: "6 steps more"."""
    return f"{abs(amount):.{digits}f} {unit} {'more' if amount >= 0 else 'fewer'}"
