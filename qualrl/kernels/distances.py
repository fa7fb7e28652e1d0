"""Distances to the nearest cell that is not free: first down and up each column, then along each row.

H, W: rows, columns.  After Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions" (2012), in whole
numbers: along a row the squares of the distances are the lowest of parabolas, one for each cell, and between two cells
that are not free only those between count.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_part

Floats = NDArray[np.float32]
Steps = NDArray[np.uint16]
Ints = NDArray[np.int64]

MOST_STEPS = 2**16 - 2
"""In a column; no more rows than that."""
NOWHERE = np.uint16(MOST_STEPS + 1)
"""So many steps stand for a column without a cell that is not free."""


@compiled_bare
def steps_in_columns(free: NDArray[np.bool_], steps: Steps, left: int, right: int) -> None:
    """Write from each cell (H, W) to the nearest in its column that is not free, in the columns from left to right.

    Steps (H, W or more).
    """
    height = len(free)
    for row in range(height):
        before = steps[max(row - 1, 0)]
        for column in range(left, right):
            above = NOWHERE if row == 0 else before[column]
            steps[row, column] = (above + np.uint16(above != NOWHERE)) * np.uint16(free[row, column])
    for row in range(height - 2, -1, -1):
        for column in range(left, right):
            below = steps[row + 1, column]
            steps[row, column] = min(steps[row, column], below + np.uint16(below != NOWHERE))


@compiled_bare
def distances_in_rows(steps: Steps, distance: Floats, lowest: Ints, top: int, bottom: int) -> None:
    """Write the distances (H, W) in the rows from top to bottom, from the steps in columns (H, W or more).

    A row of steps may share its memory with the same row of distances.  lowest (4, W + 1) is scratch.
    """
    width = distance.shape[1]
    line = lowest[3]
    for row in range(top, bottom):
        for column in range(width):
            line[column] = steps[row, column]
        column = 0
        while column < width:
            first = column
            while column < width and line[column] > 0:
                column += 1
            if column > first:
                _between(line, first, column, width, lowest, distance[row])
            if column < width:
                distance[row, column] = 0
            column += 1


@compiled_part
def _between(line: Ints, first: int, end: int, width: int, lowest: Ints, distance: Floats) -> None:
    """The distances of a row's free cells from ``first`` to before ``end``, by the steps in its columns (W,)."""
    base, height, start = lowest[0], lowest[1], lowest[2]
    count = 0
    for column in range(max(first - 1, 0), min(end + 1, width)):
        if line[column] == NOWHERE:
            continue
        square, begin = line[column] ** 2, first
        # Of two parabolas, the one farther right is lower from some column on.
        while count and (start[count - 1] - base[count - 1]) ** 2 + height[count - 1] > (
            (start[count - 1] - column) ** 2 + square
        ):
            count -= 1
        if count:
            before = base[count - 1]
            off = column - before
            begin = (off * (column + before) + square - height[count - 1]) // (2 * off) + 1
        if begin < end:
            base[count], height[count], start[count] = column, square, begin
            count += 1
    last = end
    for at in range(count - 1, -1, -1):
        for column in range(start[at], last):
            distance[column] = np.sqrt(np.float32((column - base[at]) ** 2 + height[at]))
        last = start[at]
    if not count:
        distance[first:end] = np.inf
