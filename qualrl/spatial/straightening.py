"""Borders of regions, moved to where free space is narrowest nearby."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import flooding
from qualrl.kernels import regions as kernels
from qualrl.kernels.scratch import borrowed
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
    if most <= NEAR:
        from_border = borrowed(region.shape, np.float32)
        kernels.distance_near(ends, most, from_border)
    else:
        beyond = np.ones(region.shape, np.bool_)
        beyond.ravel()[ends] = False
        from_border = distance_within(beyond)
    kernels.keep_cores(region, from_border, view.thickness, np.float32(most))
    del from_border
    return flooding.flood(region, view.clear, view.distance)
