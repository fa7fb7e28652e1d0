"""Loops that measure zones and where they touch.

H, W: rows, columns.  Z: zones.  D: directions.  N: steps.  All lengths are in cells.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@compiled
def reaches(zone: Ints, count: int, directions: Floats) -> Floats:
    """(Z, D) how far each zone reaches in each direction: the largest product of it with a corner of the zone's cells.

    zone (H, W), -1 where none; directions (D, 2) unit vectors (row, column); corners are half a cell off the centres.
    """
    height, width = zone.shape
    found = np.full((count, len(directions)), -np.inf)
    for row in range(height):
        for column in range(width):
            here = zone[row, column]
            if here < 0:
                continue
            # The corners of a run of cells are those of its ends.
            west = column == 0 or zone[row, column - 1] != here
            east = column == width - 1 or zone[row, column + 1] != here
            if not (west or east):
                continue
            for k in range(len(directions)):
                down, right = directions[k, 0], directions[k, 1]
                outward = 0.5 * (abs(down) + abs(right))
                found[here, k] = max(found[here, k], row * down + column * right + outward)
    return found


@compiled
def line_at_steps(ends: Ints, line: Ints, support: Floats) -> Ints:
    """(N,) of the lines on or beside the two cells of each step the best supported one, -1 where none.

    ends (N, 2) flat indices; line (H, W) number of the line on each cell, -1 where none; support by line.
    """
    height, width = line.shape
    found = np.full(len(ends), -1, np.int32)
    for step in range(len(ends)):
        row, column = ends[step, 0] // width, ends[step, 0] % width
        for r in range(max(row - 1, 0), min(row + 2, height)):
            for c in range(max(column - 1, 0), min(column + 2, width)):
                here = line[r, c]
                if here >= 0 and (found[step] < 0 or support[here] > support[found[step]]):
                    found[step] = here
    return found
