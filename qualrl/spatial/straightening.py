"""Borders of regions, moved to where free space is narrowest nearby."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.kernels.labels import sizes
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
    core = np.where(from_border > np.minimum(0.5 * view.thickness, np.float32(most)), region, np.int32(-1))
    del from_border, border
    has_core = np.append(sizes(core, int(region.max()) + 1) > 0, True)
    np.copyto(core, region, where=~has_core[region])
    return kernels.flood(core, region >= 0, view.distance)
