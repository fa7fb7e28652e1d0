"""A route as a walker tells it: which way to turn in each region, and the order of the landmarks that are passed.

A heading is (rows down, columns to the right).  Left and right are the same however the map is turned.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from qualrl.planning.crossings import doorway_passed
from qualrl.planning.legs import legs_through
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import CENTRE, RegionMap

REACH_M = 1.0
"""A landmark is passed where the route comes as near to it (or as near as one cell)."""

ENDS = ("start", "goal")
"""Kinds of marks beside those of landmarks."""

SIDES = {"straight": "straight ahead", "left": "to the left", "right": "to the right", "back": "behind you"}
"""Sides in words."""

COMPASS = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")

Heading = tuple[int, int]


@dataclass(frozen=True)
class Passage:
    """One region of a route."""

    region: str
    entered_by: str | None
    """The doorway; None where the route starts."""
    left_by: str | None
    """The doorway; None where the route ends."""
    side: str | None
    """Where the way out (or the goal) lies from where one comes in, against the heading there: "left", "right",
    "straight" or "back"; if one comes in and goes out at one cell, the same as ``turn``; of the doorway that one came
    in by, always "back".  None where the route starts, and where it ends in the cell where one comes in."""
    turn: str | None
    """The heading out against the heading in, in the same words; None where the route starts or ends."""
    compass: str | None
    """Where the route starts: in which of eight directions on the map the way out (or the goal) lies; else None."""
    steps: int
    """From its first cell to the first one of the next region; to its last one where the route ends."""


@dataclass(frozen=True)
class Mark:
    """A landmark on a route."""

    name: str
    kind: str
    step: int
    """The first of the steps that are nearest to it."""


@dataclass(frozen=True)
class QuantitySpace:
    """The landmarks of a route in their order; every step is at some of them, or in the open interval between two."""

    marks: tuple[Mark, ...]
    """By step; the first is where the route starts, the last where it ends."""

    def position(self, step: int) -> tuple[str, ...]:
        """The names of the landmarks at a step; or, between landmarks, of the last one before and the first one after.

        Several at one step are told with "=" between them.
        """
        at = sorted({mark.step for mark in self.marks})
        near = [step] if step in at else [max(s for s in at if s < step), min(s for s in at if s > step)]
        return tuple(" = ".join(mark.name for mark in self.marks if mark.step == s) for s in near)


def turned(before: Heading, after: Heading) -> str:
    """How one heading is turned against another: up to 45 degrees is "straight", from 135 on "back".

    >>> turned((-1, 0), (0, -1))  # up, then to the left
    'left'
    """
    along = before[0] * after[0] + before[1] * after[1]
    across = before[0] * after[1] - before[1] * after[0]  # above 0 to the left: rows grow downwards
    if abs(across) <= abs(along):
        return "straight" if along > 0 else "back"
    return "left" if across > 0 else "right"


def compass(east_m: float, north_m: float) -> str:
    """The nearest of eight directions on the map."""
    return COMPASS[round(math.atan2(north_m, east_m) / (math.pi / 4)) % 8]


def passages(regions: RegionMap, path: Sequence[Cell], come_from: Cell | None = None) -> tuple[Passage, ...]:
    """The regions of a path, brief excursions over a border and back left out; steps may be diagonal.

    come_from: the cell of another region from which a step leads to the path; None where one starts with it.
    """
    legs = legs_through([int(regions.label[cell]) for cell in path])
    way_in = None if come_from is None else _crossing(regions, come_from, path[0])
    ways = [way_in, *(_crossing(regions, path[leg.last], path[leg.last + 1]) for leg in legs[:-1]), None]
    return tuple(
        _passage(
            regions,
            regions.region_names[leg.region],
            path[leg.first : leg.last + 1 + (out is not None)],
            ways[at],
            out,
        )
        for at, (leg, out) in enumerate(zip(legs, ways[1:], strict=True))
    )


def landmarks_passed(regions: RegionMap, path: Sequence[Cell], ends: tuple[str, str]) -> QuantitySpace:
    """The order of the landmarks that a path passes within REACH_M, each in a region that it belongs to.

    ends: what to call the start and the goal.
    """
    cells = np.array(path)
    inside = regions.label[cells[:, 0], cells[:, 1]]
    on_the_way = {*np.unique(inside).tolist()}
    reach = max(REACH_M / regions.grid.resolution_m, 1.0)
    found = [Mark(name, kind, step) for name, kind, step in zip(ends, ENDS, (0, len(cells) - 1), strict=True)]
    for landmark in regions.landmarks:
        if on_the_way.isdisjoint(landmark.regions):
            continue
        steps = np.flatnonzero(np.isin(inside, landmark.regions))
        away = np.min([((cells[steps] - cell) ** 2).sum(axis=1) for cell in landmark.cells], axis=0)
        if away.min() <= reach**2:
            found.append(Mark(landmark.name, landmark.kind, int(steps[away.argmin()])))
    order = dict(zip(ENDS, (0, 2), strict=True))
    return QuantitySpace(tuple(sorted(found, key=lambda mark: (mark.step, order.get(mark.kind, 1)))))


def seen_on_stretches(
    regions: RegionMap, path: Sequence[Cell], stretches: Sequence[tuple[int, int]], told: Sequence[set[str]]
) -> list[tuple[str, ...]]:
    """The landmarks to be seen on each stretch of a path, by its first and last step; none again, and no centre.

    Where the path has come to its end nothing is passed any more.
    told: what is named anyway where a stretch begins and ends.
    """
    marks = [mark for mark in landmarks_passed(regions, path, ENDS).marks if mark.kind not in (*ENDS, CENTRE)]
    found, known = list[tuple[str, ...]](), set[str]()
    for (first, last), named in zip(stretches, told, strict=True):
        seen = [mark.name for mark in marks if first <= mark.step <= last] if first < len(path) - 1 else []
        found.append(tuple(name for name in dict.fromkeys(seen) if name not in named | known))
        known |= named | {*found[-1]}
    return found


def _crossing(regions: RegionMap, here: Cell, there: Cell) -> tuple[str, Heading]:
    """The doorway that a step passes, and the heading through it: at a right angle to its row of cells."""
    door = doorway_passed(regions, here, there)
    step = (there[0] - here[0], there[1] - here[1])
    steps = np.array([(b[0] - a[0], b[1] - a[1]) for a, b in crossings_of(regions, door)])
    down, right = (steps.sum(axis=0) * (1 if door.pair[0] == regions.label[here] else -1)).tolist()
    # A doorway may run round a thing so that its steps cancel, or bend so far that most lead the other way.
    return door.name, (down, right) if down * step[0] + right * step[1] > 0 else step


def _passage(
    regions: RegionMap, region: str, path: Sequence[Cell], way_in: tuple[str, Heading] | None,
    way_out: tuple[str, Heading] | None,
) -> Passage:  # fmt: skip
    """path: with the first cell of the next region."""
    first, last, steps = path[0], path[-2 if way_out else -1], len(path) - 1
    across = (last[0] - first[0], last[1] - first[1])
    turn = turned(way_in[1], way_out[1]) if way_in and way_out else None
    side = turned(way_in[1], across) if way_in and any(across) else turn
    if way_in and way_out and way_in[0] == way_out[0]:
        side = "back"
    toward = _compass(regions, first, path[-1]) if way_in is None and steps else None
    return Passage(region, way_in and way_in[0], way_out and way_out[0], side, turn, toward, steps)


def _compass(regions: RegionMap, here: Cell, there: Cell) -> str:
    (x_m, y_m), (to_x_m, to_y_m) = (regions.grid.to_world(*cell) for cell in (here, there))
    return compass(to_x_m - x_m, to_y_m - y_m)
