"""Loops that measure zones and where they touch.

H, W: rows, columns.  Z: zones.  D: directions.  N: steps.  All lengths are in cells.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def reaches(zone: Ints, count: int, directions: Floats) -> Floats:
    """(Z, D) how far each zone reaches in each direction: the largest product of it with a corner of the zone's cells.

    zone (H, W), -1 where none; directions (D, 2) unit vectors (row, column); corners are half a cell off the centres.
    """
    found = np.full((count, len(directions)), -np.inf)
    _widen_reaches(zone, directions, found)
    return found


@compiled_bare
def _widen_reaches(zone: Ints, directions: Floats, found: Floats) -> None:
    height, width = zone.shape
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


def amounts(zone: Ints, thickness: NDArray[np.float32], count: int) -> Floats:
    """(Z, 3) of each zone its cells, these times their half-width, and its largest half-width.

    zone (H, W), -1 where none; thickness (H, W) half-width at each cell: half a cell at least where it is summed.
    """
    found = np.zeros((count, 3))
    _add_amounts(zone, thickness, found)
    return found


@compiled_bare
def _add_amounts(zone: Ints, thickness: NDArray[np.float32], found: Floats) -> None:
    for row in range(zone.shape[0]):
        for column in range(zone.shape[1]):
            here = zone[row, column]
            if here >= 0:
                wide = float(thickness[row, column])
                found[here, 0] += 1
                found[here, 1] += max(wide, 0.5)
                found[here, 2] = max(found[here, 2], wide)


def line_at_steps(ends: Ints, line: Any) -> Ints:
    """(N,) of the lines on or beside the two cells of each step the one of the highest number, -1 where none.

    ends (N, 2) flat indices, the smaller first; line (H, W) number of the line on each cell, -1 where none.
    """
    found = np.full(len(ends), -1, np.int32)
    _find_lines(ends, line, found)
    return found


@compiled_bare
def _find_lines(ends: Ints, line: Any, found: Ints) -> None:
    height, width = line.shape
    for step in range(len(ends)):
        row, column = ends[step, 0] // width, ends[step, 0] % width
        down, right = ends[step, 1] // width, ends[step, 1] % width
        for r in range(max(row - 1, 0), min(down + 2, height)):
            for c in range(max(column - 1, 0), min(right + 2, width)):
                found[step] = max(found[step], line[r, c])
