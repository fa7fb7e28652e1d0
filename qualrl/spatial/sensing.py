"""A map that a robot finds out by itself: what it has seen so far, and what it makes of that.

H, W: rows, columns of the true map.  Cells keep their places: what is not seen yet is unknown.
"""

import math

import cv2
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
        self.seen = np.zeros(truth.shape, np.bool_)
        """(H, W)"""
        self._looked = np.zeros(truth.shape, np.bool_)

    def look_from(self, places: NDArray[np.bool_]) -> None:
        """Look around at each of the (H, W) places; where it looked before, nothing new is to be seen.

        Nor is it from places too far from any cell where a ray could go on into what was not seen yet.
        """
        new = places & ~self._looked
        self._looked |= places
        if self.seen.any():
            to_edge = cv2.distanceTransform((~self._edge()).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            new &= (to_edge <= self.radius + 1) | ~self.seen
        kernel.look(self.truth.free, np.argwhere(new), math.ceil(self.radius), self.radius, self.seen)

    def _edge(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be free, beside an unseen one or corner to corner with one that is not hidden there."""
        edge = self.frontier
        unseen, free = np.pad(~self.seen, 1), np.pad(self.free, 1)
        height, width = edge.shape
        for down in (0, 2):
            for right in (0, 2):
                corner = unseen[down : down + height, right : right + width]
                beside = free[down : down + height, 1:-1] | free[1:-1, right : right + width]
                edge |= self.free & corner & beside
        return edge

    @property
    def free(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be free."""
        return self.truth.free & self.seen

    @property
    def frontier(self) -> NDArray[np.bool_]:
        """(H, W) cells known to be free, beside one that was not seen yet."""
        unseen = np.pad(~self.seen, 1)
        beside = unseen[:-2, 1:-1] | unseen[2:, 1:-1] | unseen[1:-1, :-2] | unseen[1:-1, 2:]
        return np.asarray(self.free & beside, np.bool_)

    def grid(self) -> OccupancyGrid:
        """The map as known so far.  Raises MapError as long as nothing is known to be free."""
        return OccupancyGrid(
            self.free, self.truth.occupied & self.seen, self.truth.resolution_m, self.truth.origin, self.truth.source
        )
