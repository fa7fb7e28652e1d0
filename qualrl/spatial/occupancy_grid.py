"""Occupancy grids: which cells a robot may stand on.

H, W: rows, columns.  Row 0 is the image's top row, the *north* edge, so rows grow against
world y; only ``to_world`` and ``to_cell`` know it.
Suffixes are units: ``_m`` metres, ``_rad`` radians.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError

SMALLEST_M, LARGEST_M = 1e-6, 1e6
FARTHEST = 1e9
Cell = tuple[int, int]
"""(row, column) in image order."""


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A map as cells: free, occupied, or (neither) unknown.

    Raises MapError when the shapes differ, when no cell is free, or when the resolution is not positive.
    """

    free: NDArray[np.bool_]
    """(H, W), True where a robot may stand."""
    occupied: NDArray[np.bool_]
    """(H, W), True where something stands; cells neither free nor occupied are unknown."""
    resolution_m: float
    """Side of one cell, in metres."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """World pose (x_m, y_m, yaw_rad) of the lower-left corner of the lower-left cell."""
    source: str = ""
    """The file the map was read from, as the user named it; empty for a grid made in memory."""
    sha256: str = ""
    """SHA-256 of the image file's bytes; empty for a grid made in memory."""
    warnings: tuple[str, ...] = ()
    """What the reader found odd, one line each."""
    radius_m: float = 0.0
    """Radius of the robot whose centre free cells can hold; 0 = the map itself."""
    tight: NDArray[np.bool_] | None = None
    """(H, W) cells that are free but too near to what is not for that robot; None for the map itself."""

    def __post_init__(self) -> None:
        if self.free.ndim != 2 or self.free.shape != self.occupied.shape:
            raise MapError(f"free and occupied must be 2-d and alike, got {self.free.shape} and {self.occupied.shape}")
        if not self.free.any():
            raise MapError(f"{self.source or 'map'}: no cell is free, so there is nowhere for a robot to be")
        if not SMALLEST_M <= self.resolution_m <= LARGEST_M:
            raise MapError(
                f"{self.source or 'map'}: resolution must be from {SMALLEST_M:g} to {LARGEST_M:g} m, "
                f"got {self.resolution_m} m"
            )
        if not all(abs(number) <= FARTHEST for number in self.origin):
            raise MapError(f"{self.source or 'map'}: origin must be numbers up to {FARTHEST:g}, got {self.origin}")
        if self.tight is not None:
            if self.tight.shape != self.free.shape or (self.tight & (self.free | self.occupied)).any():
                raise MapError("tight cells must be neither free nor occupied, on a map of the same shape")
            self.tight.setflags(write=False)
        self.free.setflags(write=False)
        self.occupied.setflags(write=False)

    @classmethod
    def from_free(cls, free: NDArray[np.bool_], resolution_m: float = 1.0) -> "OccupancyGrid":
        """A grid without unknown cells: whatever is not free is occupied."""
        free = np.array(free, dtype=np.bool_)
        return cls(free, ~free, resolution_m)

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)."""
        return self.free.shape[0], self.free.shape[1]

    @property
    def unknown_cells(self) -> int:
        """How many cells are neither free nor occupied, those too tight for the robot left out."""
        tight = 0 if self.tight is None else int(self.tight.sum())
        return int((~self.free & ~self.occupied).sum()) - tight

    def to_world(self, row: float, column: float) -> tuple[float, float]:
        """World x, y in metres of the centre of a cell."""
        x, y, yaw = self.origin
        along = (column + 0.5) * self.resolution_m
        up = (self.shape[0] - 1 - row + 0.5) * self.resolution_m
        return x + along * math.cos(yaw) - up * math.sin(yaw), y + along * math.sin(yaw) + up * math.cos(yaw)

    def to_cell(self, x_m: float, y_m: float) -> Cell:
        """The cell that a world point lies in; it may lie outside the map (see ``contains``)."""
        up, along = self._from_corner(x_m, y_m)
        return self.shape[0] - 1 - math.floor(up), math.floor(along)

    def to_position(self, x_m: float, y_m: float) -> tuple[float, float]:
        """The (row, column) of a world point, whole numbers for the centres of cells: undoes ``to_world``."""
        up, along = self._from_corner(x_m, y_m)
        return self.shape[0] - 0.5 - up, along - 0.5

    def _from_corner(self, x_m: float, y_m: float) -> tuple[float, float]:
        """How many cells a world point lies above and to the right of the image's lower-left corner."""
        x, y, yaw = self.origin
        dx, dy = x_m - x, y_m - y
        along = dx * math.cos(yaw) + dy * math.sin(yaw)
        up = -dx * math.sin(yaw) + dy * math.cos(yaw)
        return up / self.resolution_m, along / self.resolution_m

    @property
    def compass(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """How many cells (east, north) one row down leads, and one column to the right.

        North is where y of the map's frame grows, whatever the origin's yaw; without yaw it is up in the image.
        """
        yaw = self.origin[2]
        return (math.sin(yaw), -math.cos(yaw)), (math.cos(yaw), math.sin(yaw))

    def contains(self, cell: Cell) -> bool:
        """Whether a cell lies on the map."""
        return 0 <= cell[0] < self.shape[0] and 0 <= cell[1] < self.shape[1]
