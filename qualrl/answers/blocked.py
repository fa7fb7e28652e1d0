"""What stands between a start and a goal that it cannot reach: the way with the least on it, cell by cell.

H, W: rows, columns.  Start and goal are cells here, and stay where they are however the map is changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.depth import Depth
from qualrl.kernels.obstacles import DOWN, NEVER, RIGHT, least_way
from qualrl.models.grid_world import GridWorld, Wall
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.spatial.footprint import clearance, has_room
from qualrl.spatial.occupancy_grid import Cell, OccupancyGrid
from qualrl.spatial.region_map import RegionMap

Flags = NDArray[np.bool_]
Way = tuple[Cell, ...]


@dataclass(frozen=True)
class Kinds:
    """How many cells of each kind that a robot cannot stand on."""

    wall: int = 0
    unknown: int = 0
    tight: int = 0
    """Free, but too near to what is not for the robot's radius."""

    @property
    def total(self) -> int:
        """All of them."""
        return self.wall + self.unknown + self.tight

    def in_words(self, depth: Depth) -> str:
        """As "2 wall cells and 1 unknown cell", or "wall cells and unknown cells"."""
        named = (
            (self.wall, "wall cell", ""),
            (self.unknown, "unknown cell", ""),
            (self.tight, "cell", " too tight for the robot"),
        )
        told = [
            f"{depth.at_numbers(f'{n:,} ')}{what}{depth.at_numbers('' if n == 1 else 's', 's')}{tail}"
            for n, what, tail in named if n
        ]  # fmt: skip
        return " and ".join(told) or "no cell"

    def to_dict(self) -> dict[str, int]:
        """As JSON."""
        return {"wall": self.wall, "unknown": self.unknown, "tight": self.tight}


@dataclass(frozen=True)
class Crossing:
    """A stretch of a way on which the robot cannot stand, or a closed doorway that it leads through."""

    between: tuple[str, str]
    """The regions before and behind it; twice the same within one."""
    cells: Way
    """In the order of the way; of a closed doorway the two cells beside it."""
    kinds: Kinds
    door: str | None
    """The closed doorway; None for a stretch of cells."""
    at: Cell
    """The cell in the middle."""
    at_m: tuple[float, float]
    """World x, y of that cell."""

    def in_words(self, depth: Depth) -> str:
        """What it is, between what, and where."""
        what = self.kinds.in_words(depth) if self.door is None else f"{self.door}, which is closed,"
        return f"{what} {self.where(depth)}"

    def where(self, depth: Depth) -> str:
        """Between what, and where."""
        at = f" at row {self.at[0]}, column {self.at[1]} (x {self.at_m[0]:.2f} m, y {self.at_m[1]:.2f} m)"
        return f"{self.sides()}{depth.at_numbers(at)}"

    def sides(self) -> str:
        """Between what."""
        one, other = self.between
        return f"within {one}" if one == other else f"between {one} and {other}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "between": list(self.between), **self.kinds.to_dict(), "door": self.door, "at": list(self.at),
            "at_m": list(self.at_m), "cells": [list(cell) for cell in self.cells],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Blocked:
    """A model with a map, a start, and the goal that cannot be reached from it."""

    model: HybridMDP
    start: Cell

    @property
    def regions(self) -> RegionMap:
        """Its map."""
        assert self.model.regions is not None
        return self.model.regions

    @property
    def grid(self) -> OccupancyGrid:
        """Its map's cells."""
        return self.regions.grid

    @property
    def ends(self) -> tuple[Cell, Cell]:
        """Start and goal."""
        return self.start, self.model.cell_of(self.model.grid.goal)

    @cached_property
    def map_free(self) -> Flags:
        """(H, W) free cells of the map itself, whatever the robot's radius."""
        tight = self.grid.tight
        return self.grid.free if tight is None else self.grid.free | tight

    @property
    def radius(self) -> float:
        """The robot's, in cells."""
        return self.grid.radius_m / self.grid.resolution_m

    def standing(self, map_free: Flags) -> Flags:
        """(H, W) where the robot could stand if the map's free cells were these."""
        return map_free if self.grid.radius_m == 0 else has_room(clearance(map_free), self.radius)

    def steps(self, standing: Flags, closed: tuple[Wall, ...] | None = None) -> int:
        """The fewest moves from start to goal in a world built anew where the robot can stand, -1 where no way leads.

        closed: its closed steps; by default as now.
        """
        if not all(standing[end] for end in self.ends):
            return -1
        now = self.model.grid
        world: GridWorld = replace(now, free=standing, closed=now.closed if closed is None else closed)
        return int(world.steps_to_goal[world.state_of[self.start]])

    def way(self, weight: NDArray[np.uint8], closing: int) -> Way:
        """The lightest way; see ``kernels.obstacles``.  closing: what a step through a closed doorway weighs."""
        source, target = (row * weight.shape[1] + column for row, column in self.ends)
        found = least_way(weight, self._hard, self._closed, closing, source, target)
        return tuple((row, column) for row, column in found.tolist())

    def way_changing_least(self, standing: Flags) -> Way:
        """Over cells where the robot could stand, a way with the fewest on which it cannot stand now."""
        weight = np.where(standing, np.where(self.grid.free, 0, 1), NEVER).astype(np.uint8)
        return self.way(weight, NEVER)

    @cached_property
    def _hard(self) -> NDArray[np.uint8]:
        """(H, W) what is not free on the map itself: rather than through a wall, a way leads through a narrow door."""
        return (~self.map_free).astype(np.uint8)

    @cached_property
    def _closed(self) -> NDArray[np.uint8]:
        """(H, W) the closed steps as the kernel takes them."""
        closed = np.zeros(self.grid.shape, np.uint8)
        for one, other in self.model.grid.closed:
            closed[min(one, other)] |= RIGHT if one[0] == other[0] else DOWN
        return closed

    @cached_property
    def closed_doors(self) -> dict[Wall, str]:
        """The name of the doorway that each closed step belongs to, by its cells in either order."""
        opened = {door.name for door in self.regions.doorways}
        marks = [mark for mark in self.regions.landmarks if mark.kind == "doorway" and mark.name not in opened]
        at = {cell: mark for mark in marks for cell in map(tuple, mark.cells.tolist())}
        names = {}
        for wall in self.model.grid.closed:
            pair = tuple(sorted(int(self.regions.label[cell]) for cell in wall))
            mark = next((at[cell] for cell in wall if cell in at and at[cell].regions == pair), None)
            between = " and ".join(self.regions.regions[index].name for index in pair)
            names[wall] = names[wall[::-1]] = f"a doorway between {between}" if mark is None else mark.name
        return names

    def kinds(self, cells: Sequence[Cell] | Flags) -> Kinds:
        """Of which kinds some cells are on the map now; those that are free do not count."""
        grid = self.grid
        at = cells if isinstance(cells, np.ndarray) else tuple(np.array(cells, np.int64).reshape(-1, 2).T)
        wall, free = (int(np.count_nonzero(flags[at])) for flags in (grid.occupied, grid.free))
        tight = 0 if grid.tight is None else int(np.count_nonzero(grid.tight[at]))
        total = int(np.count_nonzero(cells)) if isinstance(cells, np.ndarray) else len(cells)
        return Kinds(wall, total - wall - free - tight, tight)

    def between(self, way: Way, first: int, last: int) -> tuple[str, str]:
        """The regions before way[first] and behind way[last]: of the nearest cells that are in one."""
        labels = self.regions.label[tuple(np.array(way).T)]
        inside = labels >= 0
        before = labels[:first][inside[:first]][-1]
        behind = labels[last + 1 :][inside[last + 1 :]][0]
        return self.regions.regions[before].name, self.regions.regions[behind].name

    def crossing(self, way: Way, first: int, last: int, door: str | None = None) -> Crossing:
        """The record of way[first] .. way[last]."""
        at = way[(first + last) // 2]
        sides = (first + 1, last - 1) if door else (first, last)
        cells = way[first : last + 1]
        return Crossing(self.between(way, *sides), cells, self.kinds(cells), door, at, self.grid.to_world(*at))


def least_obstacle(blocked: Blocked) -> tuple[Way, tuple[Crossing, ...]]:
    """The way from start to goal with the fewest cells on which the robot cannot stand, and where these are.

    Of several that with the fewest walls and unknown cells, and then the shortest.  If opening closed doorways is
    enough, they are what is in the way, and as few as can be.  Cells so near to the map's edge that a robot would stick
    out are never on the way: nothing can be cleared there.
    """
    free = blocked.grid.free
    way = blocked.way(np.where(free, 0, NEVER).astype(np.uint8), 1)
    if not way:
        inside = blocked.standing(np.ones_like(free))
        way = blocked.way(np.where(free, 0, np.where(inside, 1, NEVER)).astype(np.uint8), 0)
    return way, tuple(_crossings(blocked, way))


def _crossings(blocked: Blocked, way: Way) -> list[Crossing]:
    free = blocked.grid.free[tuple(np.array(way).T)]
    found = []
    first = 0
    for at in range(1, len(way)):
        if free[at - 1] and not free[at]:
            first = at
        if free[at] and not free[at - 1]:
            found.append(blocked.crossing(way, first, at - 1))
        door = blocked.closed_doors.get((way[at - 1], way[at]))
        if door is not None:
            found.append(blocked.crossing(way, at - 1, at, door))
    return found
