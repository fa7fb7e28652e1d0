"""Zones of alike thickness, piece by piece of the free space.

No zone reaches into another piece, so each piece is put in order and cut into zones by itself: what it needs lies near
in memory, and two threads take half of the pieces each.

H, W: rows, columns.  F: free cells.  P: their 4-connected pieces.  Lengths are in cells.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import LEAST_CELLS, both
from qualrl.kernels.instructions import AHEAD, ask_around, prefetch
from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.labels import as_label
from qualrl.kernels.regions import FIRST_NUMBER, NO_SET, forest_of, numbered, root_of, unite
from qualrl.kernels.scratch import borrowed

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Words = NDArray[np.uint64]
Counts = NDArray[np.int64]

DIGITS, DIGIT, HALF = 4, np.uint64(8), np.uint64(32)
"""Thickness and distance, the upper half of a word, are sorted by so many digits of so many bits."""
LAST = (np.uint64(1) << DIGIT) - np.uint64(1)
"""The greatest digit."""
LOWER_HALF = (np.uint64(1) << HALF) - np.uint64(1)


def flat_zones(thickness: Floats, distance: Floats, pinch: float, step: float) -> tuple[Ints, int]:
    """Zones of alike thickness: (H, W) zone of each cell, -1 where distance is 0; and their number.

    No cell on the map's edge has a distance.  The thickest cell comes first, of equally thick ones the farthest from
    what is not free, then by position; widths in whole sixteenths of a cell, up to 4095 cells.  A cell joins the
    thickest (then largest) zone beside it that is no step thicker, and other zones too if the way there is no pinch.
    A zone's root is the first of its cells, hence the thickest.
    Thickness tells steps and distance tells pinches: the discs of two rooms may touch in a door of a thin wall.
    """
    free = distance > 0
    forest = forest_of(as_label(free))
    order, start = by_piece(forest, int(np.count_nonzero(free)))
    thick, way, sets = thickness.ravel(), distance.ravel(), forest.ravel()

    def cut(first: int, end: int) -> None:
        most = int(np.diff(start[first : end + 1]).max(initial=0))
        spare, count = borrowed((2, most), np.uint64), np.empty(int(LAST) + 1, np.int64)
        _cut(thick, way, thickness.shape[1], order, start[first : end + 1], pinch, step, sets, spare, count)

    last = len(start) - 1
    half = int(np.searchsorted(start, order.size // 2)) if order.size >= LEAST_CELLS else last
    both(partial(cut, 0, half), partial(cut, half, last)) if half < last else cut(0, last)
    return forest, numbered(forest)


def by_piece(forest: Ints, cells: int) -> tuple[Ints, Ints]:
    """(F,) flat indices of the cells in sets, set by set in the order of their first cells, each in image order; and
    (P + 1,) where those of each set begin.  cells: F.  The forest (H, W) is used up; cells of two
    sets are never side by side, and none of any is on the map's edge.
    """
    order, start = borrowed(cells, np.int32), borrowed(cells + 1, np.int32)
    count = _write_by_piece(forest.ravel(), order, start)
    return order, start[: count + 1].copy()


@compiled_bare
def _write_by_piece(forest: Ints, order: Ints, start: Ints) -> int:
    """How many sets there are.  In their roots the forest (H x W,) then holds where their next cell goes."""
    count, total, root = 0, 0, -1
    for cell in range(forest.size):
        if forest[cell] == NO_SET:
            root = -1
            continue
        if root < 0:
            root = root_of(forest, cell)
        if forest[root] > FIRST_NUMBER:
            size = -forest[root]
            forest[root] = FIRST_NUMBER - total
            start[count] = total
            total += size
            count += 1
        order[FIRST_NUMBER - forest[root]] = cell
        forest[root] -= 1
    start[count] = total
    return count


@compiled_bare
def _cut(
    thick: Floats, way: Floats, width: int, order: Ints, start: Ints, pinch: float, step: float, forest: Ints,
    spare: Words, count: Counts,
) -> None:  # fmt: skip
    """Cut the pieces that begin in order at start (P + 1,) into zones: sets of the forest (H x W,).

    spare (2, most cells of a piece) and count (LAST + 1,) are scratch.
    """
    for piece in range(start.size - 1):
        cells = order[start[piece] : start[piece + 1]]
        for cell in cells:
            forest[cell] = NO_SET
        _sort(thick, way, cells, spare, count)
        _unite_alike(thick, way, width, cells, pinch, step, forest)


@compiled_part
def _sort(thick: Floats, way: Floats, cells: Ints, spare: Words, count: Counts) -> None:
    """Put the cells, by position at first, in order: thick before thin and far before near."""
    source, differ = spare[0], np.uint64(0)
    for at in range(cells.size):
        cell = np.uint64(cells[at])
        source[at] = (_narrowness(thick[cell]) << (HALF + DIGIT + DIGIT)) | (_narrowness(way[cell]) << HALF) | cell
        differ |= source[at] ^ source[0]
    now = 0
    for digit in range(DIGITS):
        shift = HALF + np.uint64(digit) * DIGIT
        if not (differ >> shift) & LAST:
            continue
        source, target = spare[now], spare[1 - now]
        count[:] = 0
        for at in range(cells.size):
            count[(source[at] >> shift) & LAST] += 1
        total = 0
        for value in range(count.size):
            total, count[value] = total + count[value], total
        for at in range(cells.size):
            value = (source[at] >> shift) & LAST
            target[np.uint64(count[value])] = source[at]
            count[value] += 1
        now = 1 - now
    for at in range(cells.size):
        cells[at] = spare[now, at] & LOWER_HALF


@compiled_part
def _narrowness(width: float) -> np.uint64:
    """In whole sixteenths, from 0 for the widest on."""
    return np.uint64(65535 - int(min(width * 16, 65535)))


@compiled_part
def _unite_alike(thick: Floats, way: Floats, width: int, order: Ints, pinch: float, step: float, forest: Ints) -> None:
    """Make the cells, from thick to thin, sets of the forest (H x W,)."""
    beside = (-width, -1, 1, width)
    for at in range(order.size):
        ahead = order[min(at + AHEAD, order.size - 1)]
        ask_around(forest, ahead, width)
        prefetch(thick, ahead)
        prefetch(way, ahead)
        cell, best = order[at], -1
        for side in range(4):
            other = cell + beside[side]
            if forest[other] != NO_SET:
                zone = root_of(forest, other)
                if thick[cell] < step * thick[zone]:
                    continue
                larger = best >= 0 and thick[zone] == thick[best] and forest[zone] < forest[best]
                if best < 0 or thick[zone] > thick[best] or larger:
                    best = zone
        forest[cell] = -1
        if best < 0:
            continue
        unite(forest, best, cell)
        for side in range(4):
            other = cell + beside[side]
            if forest[other] == NO_SET:
                continue
            zone = root_of(forest, other)
            # Zones of less area than the way is wide are specks in which no place can lie.
            is_one = way[cell] >= pinch * thick[zone] or min(-forest[zone], -forest[best]) <= way[cell] ** 2
            if thick[cell] >= step * thick[zone] and is_one:
                unite(forest, best, zone)
