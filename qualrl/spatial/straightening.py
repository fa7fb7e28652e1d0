"""Borders of regions, moved to where free space is narrowest nearby."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.spatial.distance import distance_within
from qualrl.spatial.view import View

Labels = NDArray[np.int32]


def straightened(region: Labels, view: View, most: float = np.inf) -> Labels:
    """(h, w) the regions of a view with their borders moved by at most ``most`` cells, and less in narrow places."""
    border = np.zeros(region.size, np.bool_)
    border[kernels.crossings(region)] = True
    if not border.any():
        return region
    from_border = distance_within(~border.reshape(region.shape))
    core = np.where(from_border > np.minimum(0.5 * view.thickness, most), region, -1).astype(np.int32)
    has_core = np.zeros(int(region.max()) + 1, np.bool_)
    has_core[core[core >= 0]] = True
    core = np.where((region >= 0) & ~has_core[region], region, core).astype(np.int32)
    return kernels.flood(core, region >= 0, (view.distance * 8).astype(np.int32))
