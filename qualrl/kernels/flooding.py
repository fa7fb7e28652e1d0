"""Labels that grow over a map, and pieces of it that none reaches.

H, W: rows, columns.  All moves are 4-connected.  -1 stands for "none" in every label.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.scratch import borrowed

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Flags = NDArray[np.bool_]

BLOCK = 64
"""So many cells of a row are looked at together, to pass over them where there is nothing to do."""


@compiled_part
def _beside(cell: int, height: int, width: int) -> tuple[int, int, int, int]:
    """Flat indices of the cells north, west, east and south of a cell, -1 off the map."""
    column = np.uint32(cell) % np.uint32(width)  # division takes long, of more bits longer
    return (
        cell - width if cell >= width else -1,
        cell - 1 if column > 0 else -1,
        cell + 1 if column < width - 1 else -1,
        cell + width if cell < (height - 1) * width else -1,
    )


def flood(label: Ints, mask: Flags, depth: Floats) -> Ints:
    """Grow labels over the mask, deep cells first; borders settle where the fronts meet.  The label image is updated.

    label (H, W) the seeds, -1 elsewhere; mask (H, W) where to grow; depth (H, W), or (1,) for one that is that of all
    cells, 0 or more, told apart by eighths.  Cells that no seed reaches stay -1.
    """
    levels = np.full((2, int(8 * depth.max()) + 1), -1, np.int32)
    height, width = label.shape
    bare = np.zeros((height + 2, width // BLOCK + 3), np.bool_)
    in_bands(partial(_find_bare, label, mask, bare), label.shape, is_light=True)
    following = borrowed(label.size, np.int32)
    _grow(label.ravel(), mask.ravel(), depth.ravel(), width, bare, levels[0], levels[1], following)
    return label


@compiled_bare
def _find_bare(label: Ints, inside: Flags, bare: Flags, top: int, bottom: int) -> None:
    """Tell for each block of a row (H + 2, with a margin), in the rows from top to bottom, if labels may grow."""
    width = label.shape[1]
    for row in range(top, bottom):
        for block in range(-(-width // BLOCK)):
            found = False
            for column in range(block * BLOCK, min(block * BLOCK + BLOCK, width)):
                found |= inside[row, column] & (label[row, column] < 0)
            bare[row + 1, block + 1] = found


@compiled_bare
def _grow(
    result: Ints, inside: Flags, depths: Floats, width: int, bare: Flags, head: Ints, tail: Ints, following: Ints
) -> None:
    """A queue for each level: head and tail (levels,), -1 for none, and the cell after each cell (H x W,)."""
    height, top = result.size // width, head.size - 1
    for row in range(height):
        start, end = row * width, (row + 1) * width
        for block in range(bare.shape[1] - 2):
            here = bare[row + 1, block] | bare[row + 1, block + 1] | bare[row + 1, block + 2]
            if not (here | bare[row, block + 1] | bare[row + 2, block + 1]):
                continue
            for cell in range(start + block * BLOCK, min(start + block * BLOCK + BLOCK, end)):
                if result[cell] < 0 or not inside[cell]:
                    continue
                is_front = cell > start and inside[cell - 1] and result[cell - 1] < 0
                is_front |= cell + 1 < end and inside[cell + 1] and result[cell + 1] < 0
                is_front |= row > 0 and inside[cell - width] and result[cell - width] < 0
                is_front |= row + 1 < height and inside[cell + width] and result[cell + width] < 0
                if is_front:
                    _enqueue(cell, _level(depths, cell), head, tail, following)
    while top >= 0:
        cell = head[top]
        if cell < 0:
            top -= 1
            continue
        head[top] = following[cell]
        for other in _beside(cell, height, width):
            if other >= 0 and inside[other] and result[other] < 0:
                result[other] = result[cell]
                _enqueue(other, min(_level(depths, other), top), head, tail, following)


@compiled_part
def _level(depths: Floats, cell: int) -> int:
    """The eighths of a cell's depth."""
    return int(8 * depths[cell if depths.size > 1 else 0])


@compiled_part
def _enqueue(cell: int, level: int, head: Ints, tail: Ints, following: Ints) -> None:
    """Put a cell at the end of its level's queue."""
    following[cell] = -1
    if head[level] < 0:
        head[level] = cell
    else:
        following[tail[level]] = cell
    tail[level] = cell


def number_rest(label: Ints, mask: Flags) -> Ints:
    """Number the 4-connected pieces of the mask (H, W) where no label is, after the last label and in the order of
    their first cell; the label image (H, W), -1 for none, is updated.
    """
    waiting = borrowed(label.size, np.int32)
    _number_rest(label.ravel(), mask.ravel(), label.shape[1], int(label.max()) + 1, waiting)
    return label


@compiled_bare
def _number_rest(flat: Ints, inside: Flags, width: int, number: int, waiting: Ints) -> None:
    height = flat.size // width
    for cell in range(flat.size):
        if flat[cell] >= 0 or not inside[cell]:
            continue
        flat[cell], waiting[0], count = number, cell, 1
        while count:
            count -= 1
            here = waiting[count]
            for other in _beside(here, height, width):
                if other >= 0 and inside[other] and flat[other] < 0:
                    flat[other], waiting[count] = number, other
                    count += 1
        number += 1
