"""A map that a robot finds out by itself: what it has seen so far, and what it makes of that.

H, W: rows, columns of the true map.  Cells keep their places: what is not seen yet is unknown.
"""

import math

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import sensing as kernel
from qualrl.spatial.occupancy_grid import OccupancyGrid

FARTHEST_CELLS = 10_000


class KnownMap:
    """What has been seen of a true map with a sensor that looks all around."""

    def __init__(self, truth: OccupancyGrid, radius_m: float) -> None:
        """Nothing seen yet.  Raises SettingError for a radius that sees no cell but one's own, or no end."""
        self.truth = truth
        self.radius = radius_m / truth.resolution_m
        if not 1 <= self.radius <= FARTHEST_CELLS:
            raise SettingError(
                f"the radius must be from {truth.resolution_m:g} m, which is one cell, to "
                f"{FARTHEST_CELLS * truth.resolution_m:g} m, got {radius_m:g} m"
            )
        self._open = truth.free if truth.tight is None else truth.free | truth.tight
        self.seen = np.zeros(truth.shape, np.bool_)
        """(H, W)"""
        self._looked = np.zeros(truth.shape, np.bool_)
        self._edge, self._edges = np.empty(truth.free.size, np.int64), 0
        self._follow = np.zeros(4 * (2 * math.ceil(self.radius) + 1), np.bool_)

    def look_from(self, places: NDArray[np.bool_]) -> None:
        """Look around at each of the (H, W) places; where it looked before, nothing new is to be seen."""
        new = np.argwhere(places & ~self._looked)
        self._looked |= places
        self._edges = kernel.look(
            self._open, new, math.ceil(self.radius), self.radius, self.seen, self._edge, self._edges, self._follow
        )

    @property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be free, those too tight for the robot left out."""
        return self.truth.free & self.seen

    @property
    def frontier(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be free, beside one that was not seen yet."""
        unseen = np.pad(~self.seen, 1)
        beside = unseen[:-2, 1:-1] | unseen[2:, 1:-1] | unseen[1:-1, :-2] | unseen[1:-1, 2:]
        return np.asarray(self.free & beside, np.bool_)

    def grid(self) -> OccupancyGrid:
        """The map as known so far, tight places included.  Raises MapError as long as nothing is known to be free."""
        return OccupancyGrid(
            self._open & self.seen,
            self.truth.occupied & self.seen,
            self.truth.resolution_m,
            self.truth.origin,
            self.truth.source,
        )
