"""Thinning: labelled shapes worn down to lines one cell wide."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled, compiled_part

Ints = NDArray[np.int32]
RING = np.array([[0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1]], np.int64)
"""The cells around one, counterclockwise from the east."""


@compiled_part
def _may_go(label: Any, row: int, column: int) -> bool:
    """Whether the rest of the shape hangs together as before without this cell, which is no end of a line."""
    height, width = label.shape
    around = 0
    for k in range(8):
        r, c = row + RING[k, 0], column + RING[k, 1]
        if 0 <= r < height and 0 <= c < width and label[r, c] == label[row, column]:
            around |= 1 << k
    # Yokoi's number: pieces of the shape that the cell holds together, by sides and not by corners.
    pieces, sides = 0, 0
    for k in range(0, 8, 2):
        here, corner, after = around >> k & 1, around >> (k + 1) & 1, around >> ((k + 2) % 8) & 1
        pieces += here & ~(corner & after)
        sides += here
    return pieces == 1 and sides > 1


@compiled
def thin(label: Ints, order: Ints) -> NDArray[np.bool_]:
    """(H, W) the cells that stay when each shape is worn down, cells in the given order, to a line.

    label (H, W), -1 outside every shape; order: flat indices of the cells, those near the edge first.
    """
    left = label.copy()
    width = label.shape[1]
    gone = 1
    while gone > 0:
        gone = 0
        for k in range(order.size):
            row, column = order[k] // width, order[k] % width
            if left[row, column] >= 0 and _may_go(left, row, column):
                left[row, column] = -1
                gone += 1
    return left >= 0
