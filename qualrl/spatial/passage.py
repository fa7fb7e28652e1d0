"""A passage that is not there: where the wall between two regions is thinnest, and the map with it opened.

H, W: rows, columns.  A passage is one cell wide and straight, along a row or a column, and touches no other free cell
on its way, so that it joins the two regions and nothing else.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Doorway, Landmark, Region, RegionMap

DOORWAY = "doorway"


@dataclass(frozen=True)
class Passage:
    """Cells to clear, and the two free cells that they would join."""

    cells: tuple[Cell, ...]
    ends: tuple[Cell, Cell]
    """In the first region and in the second one."""


def thinnest_passages(regions: RegionMap, one: int, other: int) -> list[Passage]:
    """All passages of the fewest cells between two regions (indices), in image order; [] where none is straight."""
    found = [
        *_along_rows(regions.label, one, other),
        *(
            Passage(_swapped(of.cells), (of.ends[0][::-1], of.ends[1][::-1]))
            for of in _along_rows(regions.label.T, one, other)
        ),
    ]
    fewest = min((len(passage.cells) for passage in found), default=0)
    return sorted((of for of in found if len(of.cells) == fewest), key=lambda passage: passage.cells)


def _swapped(cells: tuple[Cell, ...]) -> tuple[Cell, ...]:
    return tuple((column, row) for row, column in cells)


def _along_rows(label: NDArray[np.int32], one: int, other: int) -> list[Passage]:
    """The passages along rows of the least length there is along rows."""
    rows, columns = np.nonzero(label >= 0)
    place = label[rows, columns]
    length = np.diff(columns) - 1
    joins = ((place[:-1] == one) & (place[1:] == other)) | ((place[:-1] == other) & (place[1:] == one))
    walls = np.flatnonzero(joins & (np.diff(rows) == 0) & (length > 0))
    beside = _free_beside(label)
    row, first, last = rows[walls], columns[walls] + 1, columns[walls + 1]
    walls = walls[beside[row, last] == beside[row, first]]
    walls = walls[length[walls] == length[walls].min(initial=label.size)]
    return [_passage(label, int(rows[at]), int(columns[at]), int(columns[at + 1]), one) for at in walls]


def _free_beside(label: NDArray[np.int32]) -> NDArray[np.int64]:
    """(H, W + 1) how many cells above and below the ones of its row before a column are free."""
    margined = np.pad(label >= 0, ((1, 1), (0, 0)))
    free = margined[:-2].astype(np.int64) + margined[2:]
    return np.pad(free.cumsum(axis=1), ((0, 0), (1, 0)))


def _passage(label: NDArray[np.int32], row: int, before: int, after: int, one: int) -> Passage:
    ends = ((row, before), (row, after))
    cells = tuple((row, column) for column in range(before + 1, after))
    return Passage(cells, ends if label[ends[0]] == one else ends[::-1])


def with_passage(regions: RegionMap, passage: Passage) -> tuple[RegionMap, str]:
    """The map with a passage opened, whose cells the first region gets, and the new doorway's name."""
    rows, columns = np.array(passage.cells, np.int32).T
    ours, theirs = (int(regions.label[end]) for end in passage.ends)
    grid = regions.grid
    free, occupied, label = grid.free.copy(), grid.occupied.copy(), regions.label.copy()
    free[rows, columns], occupied[rows, columns], label[rows, columns] = True, False, ours
    tight = None if grid.tight is None else grid.tight & ~free
    at = min(passage.cells, key=lambda cell: sum(abs(a - b) for a, b in zip(cell, passage.ends[1], strict=True)))
    name = _new_name(regions)
    pair = (min(ours, theirs), max(ours, theirs))
    cells = np.array([at], np.int32)
    cells.setflags(write=False)
    door = Doorway(name, pair, cells, grid.resolution_m, False)
    grown = list(regions.regions)
    grown[ours] = _grown(grown[ours], np.stack([rows, columns], axis=1), grid.resolution_m)
    opened = replace(
        regions,
        grid=replace(grid, free=free, occupied=occupied, tight=tight),
        label=label,
        regions=tuple(grown),
        doorways=(*regions.doorways, door),
        landmarks=(*regions.landmarks, Landmark(name, DOORWAY, at, cells, pair)),
    )
    return opened, name


def _grown(region: Region, cells: NDArray[np.int32], resolution_m: float) -> Region:
    total = region.cells + len(cells)
    row, column = (np.array(region.centroid) * region.cells + cells.sum(axis=0)) / total
    return replace(region, cells=total, area_m2=total * resolution_m**2, centroid=(float(row), float(column)))


def _new_name(regions: RegionMap) -> str:
    number = 1
    while f"passage {number}" in regions.all_names:
        number += 1
    return f"passage {number}"
