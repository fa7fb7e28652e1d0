"""How thick free space is at each cell: the radius of the largest free disc that covers it.

H, W: rows, columns.  Distances and radii are in cells.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled, compiled_part

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

UPHILL = np.float32(0.9)
"""Off the ridges distance grows by 1 a cell, and by at least cos(22.5 deg) toward one of eight neighbours."""


@compiled
def local_thickness(distance: Floats, centres: Ints, unpainted: Any) -> Floats:
    """(H, W) radius of the largest free disc that covers each cell, 0 where not free.

    distance (H, W): from each cell to the nearest cell that is not free, 0 where not free.
    centres: flat indices of the discs' centres, the largest disc first (see ``disc_centres``).
    unpainted (H, W + 1): room for whole numbers up to W.
    Discs are painted from large to small and each cell once: in every row, ``unpainted`` points to the
    next cell that no disc has reached, so the work grows with the discs' rows and not with their areas.
    """
    height, width = distance.shape
    thickness = np.zeros((height, width), np.float32)
    for column in range(width + 1):
        unpainted[:, column] = column
    flat = distance.ravel()
    for centre in centres:
        row, column, radius = centre // width, centre % width, flat[centre]
        reach = int(np.ceil(radius)) - 1
        for r in range(max(row - reach, 0), min(row + reach + 1, height)):
            chord = np.sqrt(max(radius * radius - (r - row) * (r - row), 0.0))
            half = max(int(np.ceil(chord - 1e-3)) - 1, 0)
            last = min(column + half, width - 1)
            c = _next(unpainted, r, max(column - half, 0))
            while c <= last:
                if distance[r, c] > 0:
                    thickness[r, c] = radius
                unpainted[r, c] = c + 1
                c = _next(unpainted, r, c + 1)
    return thickness


@compiled
def disc_centres(distance: Floats) -> Ints:
    """Flat indices of the cells on the ridges of the distance, whose discs lie in no other."""
    height, width = distance.shape
    centres = np.empty(distance.size, np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            radius = distance[row, column]
            if radius <= 0:
                continue
            straight, slanted = radius + UPHILL, radius + UPHILL * np.float32(1.41421)
            inside = False
            for r in range(max(row - 1, 0), min(row + 2, height)):
                for c in range(max(column - 1, 0), min(column + 2, width)):
                    beside = r == row or c == column
                    inside |= distance[r, c] >= (straight if beside else slanted)
            if not inside:
                centres[count] = row * width + column
                count += 1
    return centres[:count]


@compiled_part
def _next(unpainted: Any, row: int, column: int) -> int:
    """The row's first unpainted column from this one on; the pointers passed are halved on the way."""
    while unpainted[row, column] != column:
        unpainted[row, column] = unpainted[row, unpainted[row, column]]
        column = unpainted[row, column]
    return column
