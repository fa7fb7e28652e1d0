"""Borders of regions, moved to where free space is narrowest nearby."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.spatial.distance import distance_within
from qualrl.spatial.view import View

Labels = NDArray[np.int32]


def straightened(region: Labels, view: View, most: float = np.inf) -> Labels:
    """(h, w) the regions of a view, updated: borders move by at most ``most`` cells, and less in narrow places."""
    ends = kernels.crossings(region)
    if not len(ends):
        return region
    beyond = np.ones(region.shape, np.bool_)
    beyond.ravel()[ends] = False
    kernels.keep_cores(region, distance_within(beyond), view.thickness, np.float32(most))
    return kernels.flood(region, view.clear, view.distance)
