"""What a region is: its kind, its place in the order, and its name, from its cells.

H, W: rows, columns of the grid.  Lengths are in cells unless their name says otherwise.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from qualrl.kernels import regions as kernels
from qualrl.kernels.labels import measured
from qualrl.spatial.naming import name_regions, ordered
from qualrl.spatial.region_map import Region

ELONGATED = 3.0
"""A corridor is at least this many times as long as wide."""
COMPACT = 0.6
"""A region that fills this share of a rectangle, itself not elongated, is no corridor."""
LINE_M = 2.0
"""Regions whose centres are within this many metres, north to south, are read as one line."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]


def described(
    label: Labels, apart: Flags, thickness: Floats, resolution_m: float
) -> tuple[Labels, tuple[Region, ...], Floats]:
    """Label (H, W) by the regions' order, the regions, and the half-width of each in cells.

    label (H, W) any numbers from 0, -1 where not free; apart (H, W) what nothing connects to the rest;
    thickness (H, W) radius in cells of the largest free disc over each cell.
    """
    free, width = label >= 0, label.shape[1]
    used = np.zeros(int(label.max()) + 1, np.bool_)
    used[label[free]] = True
    number = np.where(free, (np.cumsum(used) - 1)[label], -1).astype(np.int32)
    border = np.zeros(number.size, np.bool_)
    border[kernels.crossings(number)] = True
    within = free & ~border.reshape(number.shape)
    cells, sums, innermost = measured(number, int(used.sum()), _distance(np.pad(within, 1))[1:-1, 1:-1])
    thickness = np.maximum(thickness, 0.5)
    half_width = np.bincount(number[free], thickness[free]) / cells
    kinds = _kinds(number, apart.ravel()[innermost], cells >= ELONGATED * (2 * half_width) ** 2)
    regions = [
        Region("", kind, int(size), float(size * resolution_m**2), (float(row), float(column)), divmod(int(at), width))
        for kind, size, (row, column), at in zip(kinds, cells, sums / cells[:, None], innermost, strict=True)
    ]
    order = ordered(regions, line=LINE_M / resolution_m)
    rank = np.argsort(order).astype(np.int32)
    named = name_regions([regions[at] for at in order])
    return np.where(free, rank[number], -1).astype(np.int32), named, half_width[order].astype(np.float32)


def _kinds(label: Labels, is_pocket: Flags, is_long: Flags) -> Sequence[str]:
    """The kind of each region.  Clutter makes rooms look long: compact ones are rooms all the same."""
    kinds = np.where(is_pocket, "pocket", np.where(is_long, "corridor", "room")).tolist()
    boxes = find_objects(np.where((label >= 0) & is_long[label], label + 1, 0))
    for at in np.flatnonzero(is_long & ~is_pocket):
        inside = (label[boxes[at]] == at).astype(np.uint8)
        longer, shorter = sorted((side + 1 for side in cv2.minAreaRect(cv2.findNonZero(inside))[1]), reverse=True)
        if longer < ELONGATED * shorter and inside.sum() > COMPACT * longer * shorter:
            kinds[at] = "room"
    return [str(kind) for kind in kinds]


def _distance(free: Flags) -> Floats:
    """From each cell to the nearest one that is not free, in cells."""
    return np.asarray(cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
