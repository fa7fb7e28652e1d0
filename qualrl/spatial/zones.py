"""Zones: parts of a map that somebody drew and gave a name, as a charging area or what a camera sees.

Only their free cells count, for a zone says something of where the robot can be.  Zones may overlap.
H, W: rows, columns.  Corners are points (x, y) in metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import PlaceError
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap

MOST_CORNERS = 1000

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Zone:
    """Free cells with a name."""

    name: str
    cells: Flags
    """(H, W)"""

    def __post_init__(self) -> None:
        if not self.cells.any():
            raise PlaceError("covers no cell where a robot could be; check its place on the map")
        self.cells.setflags(write=False)

    @property
    def centre(self) -> Cell:
        """Its cell nearest to the mean of its cells; of equally near ones the first."""
        cells = np.argwhere(self.cells)
        row, column = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1).round(6))].tolist()
        return row, column


def zone_within(name: str, corners: Sequence[tuple[float, float]], regions: RegionMap) -> Zone:
    """The zone whose cells' centres lie inside a polygon; where its sides cross each other, every other part counts.

    Raises PlaceError for a polygon without free cells inside, and for a name that a place of the map has.
    """
    grid = regions.grid
    inside = np.zeros(grid.shape, np.bool_)
    points = np.array([grid.to_position(*corner) for corner in corners])
    rows, columns = (
        np.arange(max(int(np.ceil(least)), 0), min(int(np.floor(most)) + 1, size))
        for least, most, size in zip(points.min(axis=0), points.max(axis=0), grid.shape, strict=True)
    )
    if rows.size and columns.size:
        box = np.zeros((rows.size, columns.size), np.bool_)
        for (row, column), (row_2, column_2) in zip(points, np.roll(points, -1, axis=0), strict=True):
            passed = np.flatnonzero((row > rows) != (row_2 > rows))
            if passed.size:
                at = column + (rows[passed] - row) * ((column_2 - column) / (row_2 - row))
                box[passed] ^= columns < at[:, None]
        inside[np.ix_(rows, columns)] = box
    return zone_of_cells(name, inside, regions)


def zone_of_cells(name: str, cells: Flags, regions: RegionMap) -> Zone:
    """The zone of those of some cells (H, W) that are free.

    Raises PlaceError for none, for another map's size, and for a name that a place of the map has.
    """
    grid = regions.grid
    if name in (*regions.all_names, *regions.lost):
        raise PlaceError("a place of the map is called so; choose another name")
    if cells.shape != grid.shape:
        (rows, columns), (height, width) = cells.shape, grid.shape
        raise PlaceError(f"is {columns} x {rows} pixels large, but the map is {width} x {height}; draw it on the map")
    return Zone(name, cells & grid.free)
