"""A way that questions compare: its places and doorways, its length, its value, and its rewards as a formula."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.legs import Leg, legs_of
from qualrl.planning.planner import door_taken, length_m
from qualrl.qualitative.plan_value import Course, course_of


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

    def in_words(self) -> str:
        """Places and length."""
        return f"{' -> '.join(self.places)} ({self.steps} steps, {self.length_m:.2f} m)"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "places": list(self.places), "doors": list(self.doors), "steps": self.steps, "length_m": self.length_m,
            "value": self.value,
        }  # fmt: skip


def way_of(model: HybridMDP, parts: Sequence[Sequence[int]], value: float) -> Way:
    """A way in one or more parts; where one begins, its place is told however briefly it is visited."""
    places, doors = list[str](), list[str]()
    for part in parts:
        legs = legs_of(model, part)
        places += [model.region_names[leg.region] for leg in legs]
        doors += [_door(model, part, here, there) for here, there in pairwise(legs)]
    far_m = sum(length_m(model, part) or 0.0 for part in parts)
    told = tuple(place for place, _ in groupby(places))
    return Way(told, tuple(doors), sum(len(part) - 1 for part in parts), far_m, value)


def _door(model: HybridMDP, walk: Sequence[int], here: Leg, there: Leg) -> str:
    assert model.regions is not None
    return door_taken(model, model.regions, here.region, there.region, walk[there.first - 1], walk[there.first]).name


def course(model: HybridMDP, walk: Sequence[int]) -> Course:
    """The rewards of a walk to the goal, each with the region that its step starts in."""
    if len(walk) < 2:
        return Course(())
    world, states = model.grid, np.array(walk)
    moves = (world.successor[states[:-1]] == states[1:, None]).argmax(axis=1)
    rewards: list[float] = world.move_reward[moves].tolist()
    places = [model.region_names[region] for region in model.region_of[states[:-1]].tolist()]
    return course_of(places, [*rewards[:-1], float(world.goal_reward)])


def more(amount: float, unit: str, digits: int = 0) -> str:
    """How much more or less: "6 steps more"."""
    return f"{abs(amount):.{digits}f} {unit} {'more' if amount >= 0 else 'fewer'}"
