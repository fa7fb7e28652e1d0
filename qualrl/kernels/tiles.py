"""Where cells lie beside, above and below boxes.

N cells, Q boxes.  Coordinates grow to the east and to the north.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled

Floats = NDArray[np.float64]


@compiled
def tile_counts(east: Floats, north: Floats, boxes: Floats) -> NDArray[np.int64]:
    """(Q, 9) how many of the cells (N,), (N,) lie in each of the nine tiles that a box's sides divide the plane into.

    boxes (Q, 4): least and most east, least and most north; what lies on a side is in the middle.
    Tiles as one reads: north-west, north, north-east, west, and so on.
    """
    found = np.zeros((len(boxes), 9), np.int64)
    for box in range(len(boxes)):
        west, far_east, south, far_north = boxes[box]
        for cell in range(east.size):
            column = 0 if east[cell] < west else 2 if east[cell] > far_east else 1
            row = 0 if north[cell] > far_north else 2 if north[cell] < south else 1
            found[box, 3 * row + column] += 1
    return found
