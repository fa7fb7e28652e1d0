"""Loops over labelled regions: their measures, and walks inside them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.scratch import borrowed

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Counts = NDArray[np.int64]

NEARLY = np.float32(0.8)
"""Cells of at least this share of the greatest depth may be a region's centre."""


def steps_within(label: Ints, centres: Ints) -> Ints:
    """(H, W) int32: steps from centres[k] to each cell of region k without leaving it, -1 elsewhere.

    label (H, W), -1 outside every region; centres (K, 2) rows and columns.
    """
    steps = np.full(label.shape, -1, np.int32)
    _write_steps(label, centres, steps, np.empty((label.size, 2), np.int32))
    return steps


@compiled_bare
def _write_steps(label: Ints, centres: Ints, steps: Ints, queue: Ints) -> None:
    height, width = label.shape
    # Region by region: a queue of all would go round the whole map at every step, and memory with it.
    for k in range(centres.shape[0]):
        steps[centres[k, 0], centres[k, 1]] = 0
        queue[0, 0], queue[0, 1] = centres[k, 0], centres[k, 1]
        head, end = 0, 1
        while head < end:
            row, column = queue[head, 0], queue[head, 1]
            head += 1
            for move in range(4):
                r = row + (move == 1) - (move == 0)
                c = column + (move == 3) - (move == 2)
                if 0 <= r < height and 0 <= c < width and steps[r, c] < 0 and label[r, c] == label[row, column]:
                    steps[r, c] = steps[row, column] + 1
                    queue[end, 0], queue[end, 1] = r, c
                    end += 1


def as_label(mask: NDArray[np.bool_]) -> NDArray[np.int8]:
    """(H, W) 0 where the mask is, -1 elsewhere."""
    return mask.view(np.int8) - np.int8(1)


def sizes(label: Ints, count: int) -> Counts:
    """(count,) cells of each label (H, W), -1 where none."""

    def counted(top: int, bottom: int) -> Counts:
        cells = np.zeros(count, np.int64)
        _count_cells(label[top:bottom].ravel(), cells)
        return cells

    found: Counts = np.sum(in_bands(counted, label.shape, is_light=True), axis=0)
    return found


@compiled_bare
def _count_cells(flat: Ints, cells: Counts) -> None:
    for cell in range(flat.size):
        if flat[cell] >= 0:
            cells[flat[cell]] += 1


def boxes(label: Ints, count: int) -> Counts:
    """(count, 4) top, bottom, left and right of the box around each label (H, W); bottom and right are past its end."""
    found = np.zeros((count, 4), np.int64)
    found[:, 0], found[:, 2] = label.shape
    _widen_boxes(label, found)
    return found


@compiled_bare
def _widen_boxes(label: Ints, found: Counts) -> None:
    height, width = label.shape
    for row in range(height):
        for column in range(width):
            here = label[row, column]
            if here >= 0:
                found[here, 0] = min(found[here, 0], row)
                found[here, 1] = row + 1
                found[here, 2] = min(found[here, 2], column)
                found[here, 3] = max(found[here, 3], column + 1)


def row_ends(label: Ints, box: Counts) -> tuple[Counts, Ints]:
    """The first and last column (N, 2) of each label (H, W) in each row of its box (count, 4), see ``boxes``; and
    (count + 1,) where those of each label begin.  The last is -1 in rows without it.
    """
    start = np.zeros(len(box) + 1, np.int64)
    start[1:] = np.cumsum(box[:, 1] - box[:, 0])
    ends = np.empty((start[-1], 2), np.int32)
    ends[:] = label.shape[1], -1
    _widen_rows(label, np.ascontiguousarray(box[:, 0]), start, ends)
    return start, ends


@compiled_bare
def _widen_rows(label: Ints, first: Counts, start: Counts, ends: Ints) -> None:
    """The first row of each label: first (count,)."""
    for row in range(label.shape[0]):
        before = -1
        for column in range(label.shape[1]):
            here = label[row, column]
            if here != before and here >= 0:
                at = start[here] + row - first[here]
                ends[at, 0] = min(ends[at, 0], column)
            if here != before and before >= 0:
                ends[start[before] + row - first[before], 1] = column - 1
            before = here
        if before >= 0:
            ends[start[before] + row - first[before], 1] = label.shape[1] - 1


def fill_holes(label: Ints, hole: Any, box: Any, width: Floats) -> None:
    """Fill what one label alone surrounds and is shorter than that label is wide; the label image (H, W) is updated.

    hole (H, W) number of the 8-connected piece of what has no label, 0 elsewhere; box (holes, 4) the left, top,
    columns and rows of each; width by label.  What touches the image's edge stays.
    """
    _fill_holes(label, hole, box, width, width.max(initial=0))


@compiled_bare
def _fill_holes(label: Ints, hole: Any, box: Any, width: Floats, widest: float) -> None:
    height, breadth = label.shape
    for at in range(1, len(box)):
        left, top, right, bottom = box[at, 0], box[at, 1], box[at, 0] + box[at, 2], box[at, 1] + box[at, 3]
        if min(left, top) == 0 or right == breadth or bottom == height or max(box[at, 2], box[at, 3]) >= widest:
            continue
        around, alike = -1, True
        for row in range(top, bottom):
            for column in range(left, right):
                if hole[row, column] != at:
                    continue
                for k in range(9):
                    r, c = row + k // 3 - 1, column + k % 3 - 1
                    if hole[r, c] != at:
                        alike &= around < 0 or label[r, c] == around
                        around = label[r, c]
        if not alike or max(box[at, 2], box[at, 3]) >= width[around]:
            continue
        for row in range(top, bottom):
            for column in range(left, right):
                if hole[row, column] == at:
                    label[row, column] = around


def renumber(label: Ints, number: Ints) -> Ints:
    """Put the number (count,) of each label in its place; -1 stays.  The label image (H, W) is updated."""
    in_bands(lambda top, bottom: _renumber(label[top:bottom].ravel(), number), label.shape, is_light=True)
    return label


@compiled_bare
def _renumber(flat: Ints, number: Ints) -> None:
    for cell in range(flat.size):
        if flat[cell] >= 0:
            flat[cell] = number[flat[cell]]


def only(label: Ints, kept: NDArray[np.bool_], depth: Floats) -> Ints:
    """(H, W) the labels (H, W) that are kept (count,), where the depth (H, W) is above 0; -1 elsewhere."""
    found = borrowed(label.shape, np.int32)
    _write_only(label, kept, depth, found)
    return found


@compiled_bare
def _write_only(label: Ints, kept: NDArray[np.bool_], depth: Floats, found: Ints) -> None:
    for row in range(label.shape[0]):
        for column in range(label.shape[1]):
            here = label[row, column]
            found[row, column] = here if here >= 0 and kept[here] and depth[row, column] > 0 else -1


def cells_with(label: Ints, wanted: NDArray[np.bool_]) -> Counts:
    """Flat indices of the cells whose label (H, W) is wanted (count,), in image order."""
    width = label.shape[1]

    def chosen(top: int, bottom: int) -> Counts:
        flat = label[top:bottom].ravel()
        found = np.empty(_count_with(flat, wanted), np.int64)
        _write_with(flat, wanted, found)
        found += top * width
        return found

    return np.concatenate(in_bands(chosen, label.shape, is_light=True))


@compiled_bare
def _count_with(flat: Ints, wanted: NDArray[np.bool_]) -> int:
    count = 0
    for cell in range(flat.size):
        if flat[cell] >= 0 and wanted[flat[cell]]:
            count += 1
    return count


@compiled_bare
def _write_with(flat: Ints, wanted: NDArray[np.bool_], found: Counts) -> None:
    count = 0
    for cell in range(flat.size):
        if flat[cell] >= 0 and wanted[flat[cell]]:
            found[count] = cell
            count += 1


def consecutive(label: Ints) -> int:
    """Number the labels that are used from 0 without gaps, in their order; how many.  (H, W) label is updated."""
    number = np.cumsum(sizes(label, int(label.max()) + 1) > 0)
    renumber(label, (number - 1).astype(np.int32))
    return int(number.max(initial=0))


def labels_at(piece: Ints, count: int, label: Ints) -> Ints:
    """(count,) label (H, W) of the last cell of each piece (H, W), -1 where none."""

    def last(top: int, bottom: int) -> Ints:
        found = np.full(count, -1, np.int32)
        _write_labels_at(piece[top:bottom], label[top:bottom], found)
        return found

    found, *below = in_bands(last, label.shape, is_light=True)
    for later in below:
        np.copyto(found, later, where=later >= 0)
    return found


@compiled_bare
def _write_labels_at(piece: Ints, label: Ints, found: Ints) -> None:
    for row in range(piece.shape[0]):
        for column in range(piece.shape[1]):
            if piece[row, column] >= 0:
                found[piece[row, column]] = label[row, column]


def measured(label: Ints, count: int, depth: Floats) -> tuple[Counts, NDArray[np.float64], Ints]:
    """Of each label: (count,) its cells, (count, 2) the sums of their rows and columns, (count,) its centre.

    depth (H, W).  The centre, a flat index, is of the cells nearly as deep as the deepest the one nearest the mean
    of all cells; of equally near ones the first.
    """
    cells, sums, centre = np.zeros(count, np.int64), np.zeros((count, 2)), np.full(count, -1, np.int32)
    _measure(label, depth, cells, sums, centre, np.full(count, -np.inf, np.float32), np.full(count, np.inf))
    return cells, sums, centre


@compiled_bare
def _measure(
    label: Ints, depth: Floats, cells: Counts, sums: NDArray[np.float64], centre: Ints, most: Floats,
    nearest: NDArray[np.float64],
) -> None:  # fmt: skip
    """The greatest depth, most (count,), and the centre's square distance from the mean, nearest (count,)."""
    height, width = label.shape
    for row in range(height):
        for column in range(width):
            here = label[row, column]
            if here >= 0:
                cells[here] += 1
                sums[here, 0] += row
                sums[here, 1] += column
                most[here] = max(most[here], depth[row, column])
    for row in range(height):
        for column in range(width):
            here = label[row, column]
            if here >= 0 and depth[row, column] >= NEARLY * most[here]:
                away = (row - sums[here, 0] / cells[here]) ** 2 + (column - sums[here, 1] / cells[here]) ** 2
                if away < nearest[here]:
                    nearest[here] = away
                    centre[here] = row * width + column


@compiled_part
def _is_inside(label: Any, row: int, column: int) -> bool:
    """Whether there is a label on all four sides of a cell: so it is for most, and soon told."""
    if not (0 < row < label.shape[0] - 1 and 0 < column < label.shape[1] - 1):
        return False
    across = label[row, column - 1] | label[row, column + 1]
    return bool((across | label[row - 1, column] | label[row + 1, column]) >= 0)


@compiled_part
def _is_wall(occupied: NDArray[np.bool_], row: int, column: int) -> bool:
    """Whether a cell or one right beside it is occupied."""
    for r in range(max(row - 1, 0), min(row + 2, occupied.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, occupied.shape[1])):
            if occupied[r, c]:
                return True
    return False


def borders(label: Ints, occupied: NDArray[np.bool_], count: int) -> Counts:
    """(count, 2): of each label the sides of its cells that face a wall, and those that face what is unknown.

    label (H, W), -1 where not free; occupied (H, W).  A wall is an occupied cell, one right beside the cell faced,
    as scans leave them, or the map's edge.
    """
    sides = np.zeros((count, 2), np.int64)
    read_only = occupied.view()  # as the map's own is: compiled only once
    read_only.setflags(write=False)
    _count_borders(label, read_only, sides)
    return sides


@compiled_bare
def _count_borders(label: Ints, occupied: NDArray[np.bool_], sides: Counts) -> None:
    height, width = label.shape
    for row in range(height):
        for column in range(width):
            here = label[row, column]
            if here < 0 or _is_inside(label, row, column):
                continue
            for move in range(4):
                r = row + (move == 1) - (move == 0)
                c = column + (move == 3) - (move == 2)
                if not (0 <= r < height and 0 <= c < width):
                    sides[here, 0] += 1
                elif label[r, c] < 0:
                    sides[here, 0 if _is_wall(occupied, r, c) else 1] += 1
