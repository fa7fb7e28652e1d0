"""Borders of regions, moved to where free space is narrowest nearby."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.spatial.distance import distance_within
from qualrl.spatial.view import View

NEAR = 10.0
"""Distances up to this are found faster around each end than all over the map."""

Labels = NDArray[np.int32]


def straightened(region: Labels, view: View, most: float = np.inf) -> Labels:
    """(h, w) the regions of a view, updated: borders move by at most ``most`` cells, and less in narrow places."""
    ends = kernels.crossings(region)
    if not len(ends):
        return region
    kernels.keep_cores(region, _from_border(ends, region.shape, most), view.thickness, np.float32(most))
    return kernels.flood(region, view.clear, view.distance)


def _from_border(ends: Labels, shape: tuple[int, ...], most: float) -> NDArray[np.float32]:
    """(h, w) from each cell to the nearest of the ends (N, 2), flat indices; farther than ``most`` may be infinite."""
    if most <= NEAR:
        return kernels.distance_near(ends, shape[0], shape[1], most)
    beyond = np.ones(shape, np.bool_)
    beyond.ravel()[ends] = False
    return distance_within(beyond)
