"""Places by rule: zones of alike thickness are grown from thick to thin, those that are no places of their own are
joined, and borders settle where free space is narrowest.

For maps without walls to find lines in: mazes and grids of rooms, drawn with cells as large as doors.

h, w: rows, columns of the view.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.kernels.bonds import linked
from qualrl.kernels.zones import flat_zones
from qualrl.spatial.straightening import straightened
from qualrl.spatial.view import View

STEP, SLENDER, LONG, ROOMY = 0.6, 9.0, 5.0, 6.0
"""See ``kernels.regions.Rules``."""

Labels = NDArray[np.int32]


def joined_regions(view: View, min_area: float, pinch: float) -> Labels:
    """(h, w) region of each cell of the view, -1 where it is not free; min_area in its cells."""
    thickness, distance = view.thickness, view.distance
    zone, count = flat_zones(thickness, distance, pinch, STEP)
    inside = zone[zone >= 0]
    area = np.bincount(inside, minlength=count).astype(np.float32)
    breadth = (np.bincount(inside, thickness[zone >= 0], count) / np.maximum(area, 1)).astype(np.float32)
    ends = kernels.crossings(zone)
    pair = np.sort(zone.ravel()[ends], axis=1).astype(np.int64)
    key, contact, length = np.unique(pair[:, 0] * count + pair[:, 1], return_inverse=True, return_counts=True)
    way = np.zeros(key.size)
    np.maximum.at(way, contact, distance.ravel()[ends].min(axis=1))
    touching = np.stack(np.divmod(key, max(count, 1)), axis=1).astype(np.int32)
    bonds = linked(touching, np.stack([length, way], axis=1), count)
    rules = kernels.Rules(pinch, STEP, SLENDER, LONG, ROOMY, float(min_area))
    place = np.arange(count, dtype=np.int32)
    while kernels.join_zones(np.argsort(area, kind="stable"), place, area, breadth, bonds, rules):
        pass
    return straightened(np.where(zone >= 0, place[zone], -1).astype(np.int32), view)
