"""The skeleton of corridors: lines midway between the walls, without the spurs that corners and niches leave.

H, W: rows, columns.  Lengths are in cells.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.thinning import prune, thin

LEAST_REACH = 1.5
"""A branch reaches at least this many times its joint's distance from the walls beyond the disc there."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


def pruned_skeleton(label: Ints, distance: Floats) -> tuple[Ints, Ints]:
    """(H, W) the shape whose middle line each cell is on, -1 elsewhere; and the flat indices of the cells on lines.

    Lines go from side to side of cells.

    label (H, W), -1 outside every shape; distance (H, W) to the nearest cell that is not free.
    """
    order = np.flatnonzero(label >= 0).astype(np.int32)
    # Whole hundredths: distances that differ by rounding only must not decide.
    depth = np.rint(distance.ravel()[order] * 100)
    depth = depth.astype(np.uint16 if depth.max(initial=0) < 2**16 else np.int32)  # few bits are sorted much faster
    line, cells = thin(label, order[np.argsort(depth, kind="stable")])
    prune(line, cells, distance, LEAST_REACH)
    return line, cells[line.ravel()[cells] >= 0]
