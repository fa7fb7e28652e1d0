"""Loops that move landmarks to where they belong.

H, W: rows, columns.  N: landmarks, as flat indices of cells.  R: regions.  Lengths are in cells.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_part

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Cells = NDArray[np.int64]
Flags = NDArray[np.bool_]

SIDES = np.array([[-1, 0], [0, -1], [0, 1], [1, 0]], np.int64)
WORTH_A_STEP = 0.5
"""Steps into a corner lead so far outward at least."""


def into_corners(label: Ints, cells: Cells, outward: NDArray[np.float64], most: int) -> Cells:
    """(N,) the cell so many steps on, at most, outward (N, 2), without leaving the region (H, W).

    Each step is that which leads farthest outward; of equal ones the one to the last cell.
    """
    found = cells.copy()
    _step_outward(label.ravel(), label.shape[1], outward, most, found)
    return found


@compiled_bare
def _step_outward(flat: Ints, width: int, outward: NDArray[np.float64], most: int, found: Cells) -> None:
    height = flat.size // width
    for at in range(found.size):
        for _ in range(most):
            row, column = found[at] // width, found[at] % width
            gain, after = 0.0, -1
            for k in range(4):
                r, c = row + SIDES[k, 0], column + SIDES[k, 1]
                if 0 <= r < height and 0 <= c < width and flat[r * width + c] == flat[found[at]]:
                    there = SIDES[k, 0] * outward[at, 0] + SIDES[k, 1] * outward[at, 1]
                    if after < 0 or there >= gain:
                        gain, after = there, r * width + c
            if gain < WORTH_A_STEP:
                break
            found[at] = after


def nearest_of_region(label: Ints, cells: Cells, region: Ints) -> Cells:
    """(N,) the cell of a region (N,), somewhere in the label image (H, W), that is nearest to each cell.

    Of equally near ones it is the first.
    """
    found = cells.copy()
    _look_around(label, region, found)
    return found


@compiled_bare
def _look_around(label: Ints, region: Ints, found: Cells) -> None:
    height, width = label.shape
    for at in range(found.size):
        row, column = found[at] // width, found[at] % width
        reach = 0
        while label[found[at] // width, found[at] % width] != region[at]:
            reach = max(2 * reach, 1)
            nearest = reach**2 + 1  # what lies beyond the square is farther
            for r in range(max(row - reach, 0), min(row + reach + 1, height)):
                for c in range(max(column - reach, 0), min(column + reach + 1, width)):
                    away = (r - row) ** 2 + (c - column) ** 2
                    if away < nearest and label[r, c] == region[at]:
                        nearest, found[at] = away, r * width + c


def within_reach(
    cells: Cells, width: int, others: Ints, start: Cells, region: Ints, reach: Floats
) -> NDArray[np.bool_]:
    """(N,) whether one of the region's other cells is within the region's reach (R,), in rows and in columns.

    others (M, 2) rows and columns, those of region r from start[r] to start[r + 1]; region (N,).
    """
    found = np.zeros(cells.size, np.bool_)
    _mark_near(cells, width, others, start, region, reach, found)
    return found


@compiled_bare
def _mark_near(cells: Cells, width: int, others: Ints, start: Cells, region: Ints, reach: Floats, found: Flags) -> None:
    for at in range(cells.size):
        row, column = cells[at] // width, cells[at] % width
        for other in range(start[region[at]], start[region[at] + 1]):
            away = max(abs(others[other, 0] - row), abs(others[other, 1] - column))
            found[at] |= away <= reach[region[at]]


def clear_of_walls(line: Ints, tips: Cells, distance: Floats, clear: Floats, most: Ints) -> Cells:
    """(N,) the first cell of each line (H, W), from its tip on, whose distance (H, W) is at least ``clear`` (N,).

    Or the last cell before it parts or ends, or after ``most`` (N,) steps.
    """
    found = tips.copy()
    _follow_lines(line, distance, clear, most, np.empty(most.max(initial=0) + 2, np.int64), found)
    return found


@compiled_bare
def _follow_lines(line: Ints, distance: Floats, clear: Floats, most: Ints, passed: Cells, found: Cells) -> None:
    """Passed (greatest of ``most`` + 2,) is scratch."""
    width = line.shape[1]
    for at in range(found.size):
        passed[0], count = found[at], 1
        while distance[found[at] // width, found[at] % width] < clear[at] and count <= most[at]:
            after = _only_way_on(line, found[at], passed, count)
            if after < 0:
                break
            found[at] = passed[count] = after
            count += 1


@compiled_part
def _only_way_on(line: Ints, cell: int, passed: Cells, count: int) -> int:
    """The one cell of the same line beside this one that was not passed; -1 where there are none or more."""
    height, width = line.shape
    row, column = cell // width, cell % width
    found, ways = -1, 0
    for k in range(4):
        r, c = row + SIDES[k, 0], column + SIDES[k, 1]
        if not (0 <= r < height and 0 <= c < width) or line[r, c] != line[row, column]:
            continue
        is_new = True
        for before in range(count):
            is_new &= passed[before] != r * width + c
        if is_new:
            found = r * width + c
            ways += 1
    return found if ways == 1 else -1
