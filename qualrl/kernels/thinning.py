"""Thinning: labelled shapes worn down to lines one cell wide."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import both
from qualrl.kernels.instructions import AHEAD, ask_around
from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.scratch import borrowed

Ints = NDArray[np.int32]
Cells = NDArray[np.int64]
RING = np.array([[0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1]], np.int64)
"""The cells around one, counterclockwise from the east."""


def _may_go(around: int) -> bool:
    """Whether the rest of a shape hangs together as before without a cell, which is no end of a line.

    around: a bit for each cell of the RING, set for those of the shape.
    """
    # Yokoi's number: pieces of the shape that the cell holds together, by sides and not by corners.
    pieces, sides = 0, 0
    for k in range(0, 8, 2):
        here, corner, after = around >> k & 1, around >> (k + 1) & 1, around >> ((k + 2) % 8) & 1
        pieces += here & ~(corner & after)
        sides += here
    return pieces == 1 and sides > 1


MAY_GO = np.array([_may_go(around) for around in range(256)])


@compiled_part
def _ring(flat: Ints, height: int, width: int, cell: int) -> int:
    """Which cells around one are of its shape, of an image (H x W,): a bit for each of the RING."""
    row, column = cell // width, cell % width
    around = 0
    if 0 < row < height - 1 and 0 < column < width - 1:
        steps = (1, 1 - width, -width, -1 - width, -1, width - 1, width, width + 1)
        for k in range(8):
            around |= (flat[cell + steps[k]] == flat[cell]) << k
        return around
    for k in range(8):
        r, c = row + RING[k, 0], column + RING[k, 1]
        if 0 <= r < height and 0 <= c < width and flat[r * width + c] == flat[cell]:
            around |= 1 << k
    return around


def thin(label: Ints, order: Ints) -> tuple[Ints, Ints]:
    """(H, W) the shapes, each worn down, cells in the given order, to a line, -1 elsewhere; and the lines' cells.

    label (H, W), -1 outside every shape; order: flat indices of the cells, those near the edge first.  The cells are
    flat indices, too, in image order.
    """
    line = borrowed(label.shape, np.int32)
    line[:] = label
    # No cell of a shape looks at those of another, so that two threads may go over the same image.
    is_even = label.ravel()[order] % 2 == 0
    halves = [order[part] for part in (is_even, ~is_even)]
    counts = both(*(partial(_wear_down, line.ravel(), line.shape[1], half) for half in halves))
    return line, np.sort(np.concatenate([half[:count] for half, count in zip(halves, counts, strict=True)]))


@compiled_bare
def _wear_down(flat: Ints, width: int, rest: Ints) -> int:
    """The image (H x W,) and the cells are updated; the first so many cells stay."""
    height = flat.size // width
    count, before = rest.size, rest.size + 1
    while count < before:
        before, count = count, 0
        for at in range(before):
            ask_around(flat, rest[min(at + AHEAD, before - 1)], width)
            cell = rest[at]
            if MAY_GO[_ring(flat, height, width, cell)]:
                flat[cell] = -1
            else:
                rest[count] = cell
                count += 1
    return count


def prune(line: Ints, cells: Ints, distance: NDArray[np.float32], least: float) -> None:
    """Take away, from the image, the spurs that corners and niches leave on lines.

    line (H, W): number of the shape that each cell of its line belongs to, -1 elsewhere; cells: flat indices of these,
    in image order; distance (H, W) to the nearest cell that is not free.  A spur leads from a joint to its tip and
    reaches less than ``least`` times the joint's distance beyond the disc there.  At each joint the shortest goes,
    again and again: what it met there may be one line with the longer one.
    """
    ends = cells[degrees(line, cells) == 1].astype(np.int64)
    while True:
        joints, tips, reaches = np.empty_like(ends), np.empty_like(ends), np.empty(ends.size)
        count = _find_spurs(line, ends, distance, least, joints, tips, reaches)
        if not count:
            return
        by_joint = np.lexsort((reaches[:count], joints[:count]))
        joints, tips = joints[by_joint], tips[by_joint]
        is_shortest = np.diff(joints, prepend=-1) > 0
        _take_away(line, joints[is_shortest], tips[is_shortest])
        # Only where a spur began there may be a new tip.
        ends = np.union1d(ends, joints)
        ends = ends[line.ravel()[ends] >= 0]


def degrees(line: Ints, cells: NDArray[Any]) -> Ints:
    """(N,) how many cells of the same line (H, W) share a side with each of the cells, flat indices on lines."""
    found = np.empty(cells.size, np.int32)
    _write_degrees(line, cells.astype(np.int64, copy=False), found)
    return found


@compiled_bare
def _write_degrees(line: Ints, cells: Cells, found: Ints) -> None:
    for at in range(cells.size):
        found[at] = _degree(line, cells[at])


@compiled_bare
def _take_away(line: Ints, joints: Cells, tips: Cells) -> None:
    """Take spurs from the image (H, W), from the tip of each to before its joint."""
    for spur in range(tips.size):
        here = tips[spur]
        while here != joints[spur]:
            after = _next_on_line(line, here, -1)
            line[here // line.shape[1], here % line.shape[1]] = -1
            here = after


@compiled_bare
def _find_spurs(
    left: Ints, cells: Cells, distance: NDArray[np.float32], least: float, joints: Cells, tips: Cells,
    reaches: NDArray[np.float64],
) -> int:  # fmt: skip
    """Write the joints, tips and reaches (N,) of all lines that end and are too short, by tip; how many there are."""
    width = left.shape[1]
    count = 0
    for tip in cells:
        if _degree(left, tip) != 1:
            continue
        before, here = tip, _next_on_line(left, tip, -1)
        while _degree(left, here) == 2:
            before, here = here, _next_on_line(left, here, before)
        there = distance[here // width, here % width]
        away = np.hypot(float(tip // width - here // width), float(tip % width - here % width))
        reach = away + distance[tip // width, tip % width] - there
        if _degree(left, here) > 2 and reach < least * there:
            joints[count], tips[count], reaches[count] = here, tip, reach
            count += 1
    return count


@compiled_part
def _degree(left: Any, cell: int) -> int:
    """How many cells of the same line share a side with this one."""
    height, width = left.shape
    row, column = cell // width, cell % width
    degree = 0
    for k in range(0, 8, 2):
        r, c = row + RING[k, 0], column + RING[k, 1]
        degree += 0 <= r < height and 0 <= c < width and left[r, c] == left[row, column]
    return degree


@compiled_part
def _next_on_line(left: Any, cell: int, before: int) -> int:
    """A cell of the same line that shares a side with this one, and is not the one before; -1 if there is none."""
    height, width = left.shape
    row, column = cell // width, cell % width
    for k in range(0, 8, 2):
        r, c = row + RING[k, 0], column + RING[k, 1]
        if 0 <= r < height and 0 <= c < width and left[r, c] == left[row, column] and r * width + c != before:
            return int(r * width + c)
    return -1
