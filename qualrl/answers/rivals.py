"""The ways that may rival the best one, the most promising first, each with a bound of what it is worth.

A way is told by its doorways; it passes no region twice.  Between two doorways it takes at least as many moves as if
nothing stood between, and by each doorway at least as many as the shortest ways to it and on from it together.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.uncertain import Uncertain
from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.region_map import RegionMap

MOST_LOOKED_AT = 50_000
"""Beginnings of ways."""
STRAIGHT = 4
"""Directions of a robot that makes no diagonal moves."""


@dataclass(frozen=True)
class _Door:
    """What a bound needs to know of a doorway."""

    name: str
    pair: tuple[int, int]
    cells: NDArray[np.int64]
    """(N, 2)"""
    from_start: int
    to_goal: int
    """Moves to the nearest of its cells, and from there to the goal, as if all were open."""
    open: float
    """The least probability that it is."""


@dataclass(frozen=True)
class _Beginning:
    """The first doorways of a way."""

    doors: tuple[_Door, ...]
    regions: tuple[int, ...]
    moves: int
    """At least so many to the last doorway."""
    whole: int
    """At least so many to the goal."""
    settled: float = 0.0
    """Worth of the cases in which a doorway before is shut, at most."""
    likely: float = 1.0
    """Probability of the case that is left, at least."""


def rivals(model: HybridMDP, start: int, uncertain: Uncertain) -> Iterator[tuple[float, tuple[str, ...] | None]]:
    """Ways from a state to the goal by the names of their doorways, and what each is worth at most (shifted).

    The bounds fall, so that nothing that comes later is worth more.  The last one given is None with a
    bound, where there are more ways than are looked at.
    """
    world, regions = model.grid, model.regions
    assert regions is not None
    doors = _doors(model, regions, start, uncertain)
    ends = int(model.region_of[start]), int(model.region_of[world.goal])
    of_goal = world.goal_reward - world.step_reward / (1 - world.gamma)

    def worth(moves: int) -> float:
        """Of a way of so many moves, none of which need take longer than the least, at most; falling."""
        return float(of_goal * world.gamma ** max(moves * uncertain.fastest - 1, 0))

    order = count()
    first = _Beginning((), (ends[0],), 0, max(int(world.steps_to_goal[start]), 1))
    waiting = [(-worth(first.whole), next(order), first)]
    for _ in range(MOST_LOOKED_AT):
        if not waiting:
            return
        bound, _, way = heappop(waiting)
        if way.regions[-1] == ends[1]:
            yield -bound, tuple(door.name for door in way.doors)
            continue
        for door in doors.get(way.regions[-1], ()):
            onward = _onward(way, door, world.directions, worth)
            if onward is not None:
                most = onward.settled + onward.likely * worth(onward.whole)
                heappush(waiting, (-min(most, -bound), next(order), onward))
    if waiting:
        yield -waiting[0][0], None


def _onward(way: _Beginning, door: _Door, directions: int, worth: Callable[[int], float]) -> _Beginning | None:
    """A beginning with one more doorway; None where that leads back, or on to no goal."""
    region = door.pair[1 - door.pair.index(way.regions[-1])]
    if region in way.regions or door.to_goal < 0:
        return None
    moves = door.from_start
    if way.doors:
        moves = max(moves, way.moves + _apart(way.doors[-1].cells, door.cells, directions))
    whole = max(way.whole, moves + door.to_goal)
    shut = way.likely * (1 - door.open)
    return _Beginning(
        (*way.doors, door), (*way.regions, region), moves, whole, way.settled + shut * worth(whole), way.likely - shut
    )


def _apart(one: NDArray[np.int64], other: NDArray[np.int64], directions: int) -> int:
    """Moves between the boxes of two doorways' cells as if nothing stood between."""
    gap = np.maximum(np.maximum(other.min(axis=0) - one.max(axis=0), one.min(axis=0) - other.max(axis=0)), 0)
    return max(int(gap.sum() if directions == STRAIGHT else gap.max()) - _beside(directions), 0)


def _beside(directions: int) -> int:
    """By how many moves a diagonal one may pass beside a doorway's cells."""
    return 0 if directions == STRAIGHT else 2


def _doors(model: HybridMDP, regions: RegionMap, start: int, uncertain: Uncertain) -> dict[int, list[_Door]]:
    """The doorways of each region."""
    world = model.grid
    from_start = breadth_first(world.successor, np.array([start]))[1]
    found: dict[int, list[_Door]] = {}
    for door in regions.doorways:
        cells = np.array(crossings_of(regions, door), np.int64).reshape(-1, 2)
        states = world.state_of[cells[:, 0], cells[:, 1]]
        away, left = (_least(steps[states]) for steps in (from_start, world.steps_to_goal))
        least = uncertain.door(door.name)[0] if door.name in uncertain.doors else 1.0
        known = _Door(door.name, door.pair, cells, away, max(left - _beside(world.directions), min(left, 0)), least)
        for region in door.pair:
            found.setdefault(region, []).append(known)
    return found


def _least(steps: NDArray[np.int32]) -> int:
    """The least of those that are known; -1 if none is."""
    known = steps[steps >= 0]
    return int(known.min()) if len(known) else -1
