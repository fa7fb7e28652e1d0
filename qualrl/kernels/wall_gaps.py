"""Gaps between walls that lie in one line, and runs of walls between places.

H, W: rows, columns.  G: gaps.  All lengths are in cells.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.scratch import borrowed

Flags = NDArray[np.bool_]
Ints = NDArray[np.int32]
Floats = NDArray[np.float64]


def gaps(wall: Flags, free: Flags, bridge: int, least: int, most: int) -> Ints:
    """(G, 5) row, first column, last column of each gap between two walls of a row, and the lengths of the two.

    A wall is a run of cells, at least ``least`` long, with holes of fewer than ``bridge`` cells that make up no
    more than half of it.  Shorter runs are passed over.  A gap has at most ``most`` cells, one or more of them free.
    """
    of_walls = wall, free, bridge, least, most
    found = np.empty((_find_gaps(*of_walls, np.empty((0, 5), np.int32)), 5), np.int32)
    _find_gaps(*of_walls, found)
    return found


@compiled_bare
def _find_gaps(wall: Flags, free: Flags, bridge: int, least: int, most: int, found: Ints) -> int:
    """How many gaps there are; they are written down (G, 5) if there is room for any."""
    height, width = wall.shape
    count = 0
    for row in range(height):
        before_end, before_length = -1, 0
        column = 0
        while column < width:
            if not wall[row, column]:
                column += 1
                continue
            start, end, solid = column, column, 0
            while column < width and column - end <= bridge:
                if wall[row, column]:
                    end = column
                    solid += 1
                column += 1
            column = end + 1
            length = end - start + 1
            if length < least or 2 * solid < length:
                continue
            if before_length and 0 < start - before_end - 1 <= most and _any_of(free, row, before_end + 1, start):
                if len(found):
                    found[count, 0] = row
                    found[count, 1], found[count, 2] = before_end + 1, start - 1
                    found[count, 3], found[count, 4] = before_length, length
                count += 1
            before_end, before_length = end, length
    return count


@compiled_part
def _any_of(mask: Flags, row: int, first: int, end: int) -> bool:
    """Whether a row of the mask (H, W) holds from one column to before another."""
    found = False
    for column in range(first, end):
        found |= mask[row, column]
    return found


def off_middle(found: Ints) -> Ints:
    """(G,) how far each gap (G, 5) is off the middle of the same gaps in the rows above and below, in half rows.

    Gaps come row by row and from west to east, as ``gaps`` finds them.
    """
    off = np.empty(len(found), np.int32)
    _compare_rows(found, np.arange(len(found)), np.ones(len(found), np.int32), off)
    return off


@compiled_bare
def _compare_rows(found: Ints, first: NDArray[np.int64], rows: Ints, off: Ints) -> None:
    """Of the same gaps in adjoining rows, first (G,) is the one in the highest: itself before it is known.

    rows (G,): of the first, how many they are; 1 before.
    """
    above, end = 0, 0  # gaps of the row above that are not west of this one, and where that row ends
    for gap in range(len(found)):
        if gap and found[gap, 0] != found[gap - 1, 0]:
            above = end if found[gap, 0] == found[gap - 1, 0] + 1 else gap
            end = gap
        while above < end and found[above, 1] < found[gap, 1]:
            above += 1
        if above < end and _are_same(found, above, gap):
            first[gap] = first[above]
            rows[first[gap]] += 1
    for gap in range(len(found)):
        off[gap] = abs(2 * (found[gap, 0] - found[first[gap], 0]) - (rows[first[gap]] - 1))


@compiled_part
def _are_same(found: Ints, one: int, other: int) -> bool:
    """Whether two gaps are the same but for their row."""
    alike = True
    for column in range(1, found.shape[1]):
        alike &= bool(found[one, column] == found[other, column])
    return alike


def sharpness(x: Floats, y: Floats, cosine: Floats, sine: Floats) -> Floats:
    """(N,) sum of squares of the two profiles of points x, y (M,), turned by an angle of some cosine and sine (N,).

    A profile counts the points in each row (or column) of cells.
    """
    found = np.empty(cosine.size)
    longest = int(np.hypot(np.ptp(x), np.ptp(y))) + 3
    _write_sharpness(x, y, cosine, sine, np.empty(x.size), np.empty(longest, np.int64), found)
    return found


@compiled_bare
def _write_sharpness(
    x: Floats, y: Floats, cosine: Floats, sine: Floats, along: Floats, profile: NDArray[np.int64], found: Floats
) -> None:
    """Along (M,) and the profile are scratch."""
    for angle in range(cosine.size):
        total = np.int64(0)
        for side in range(2):
            for at in range(x.size):
                if side:
                    along[at] = y[at] * cosine[angle] - x[at] * sine[angle]
                else:
                    along[at] = x[at] * cosine[angle] + y[at] * sine[angle]
            least = along[0]
            for at in range(x.size):
                least = min(least, along[at])
            profile[:] = 0
            for at in range(x.size):
                profile[np.int64(np.rint(along[at] - least))] += 1
            for count in profile:
                total += count * count
        found[angle] = total


def apart(found: Ints, order: Ints, height: int, width: int, rows: int, slack: int) -> Flags:
    """(G,) which gaps stay when of those that lie side by side only the first in order does.

    Side by side: within so many rows, and less than ``slack`` columns from overlapping.
    """
    stays = np.zeros(len(found), np.bool_)
    taken = borrowed((height, width), np.bool_)
    taken.fill(False)
    _mark_apart(found, order, rows, slack, taken, stays)
    return stays


@compiled_bare
def _mark_apart(found: Ints, order: Ints, rows: int, slack: int, taken: Flags, stays: Flags) -> None:
    """Taken (H, W), stays (G,): False at first."""
    height, width = taken.shape
    for gap in order:
        row, first, last = found[gap, 0], found[gap, 1], found[gap, 2]
        top, bottom = max(row - rows, 0), min(row + rows + 1, height)
        stays[gap] = True
        for near in range(top, bottom):
            if _any_of(taken, near, max(first - slack, 0), min(last + slack + 1, width)):
                stays[gap] = False
                break
        if stays[gap]:
            for column in range(first, last + 1):
                taken[row, column] = True


def walls_between(zone: Ints, most: int) -> tuple[Ints, Ints]:
    """(N, 2) the zones on the two sides of each wall, along every row (N,) 0, and every column 1.

    zone (H, W), -1 where no zone is; a wall is a run of such cells, at most ``most``.
    """
    down = np.empty((2, zone.shape[1]), np.int32)
    count = _find_walls(zone, most, down, np.empty((0, 2), np.int32), np.empty(0, np.int32))
    pair, axis = np.empty((count, 2), np.int32), np.empty(count, np.int32)
    _find_walls(zone, most, down, pair, axis)
    return pair, axis


@compiled_bare
def _find_walls(zone: Ints, most: int, down: Ints, pair: Ints, axis: Ints) -> int:
    """How many walls there are; they are written down if there is room for any.  down (2, W) is scratch."""
    height, width = zone.shape
    # Column by column, in the order of memory: what was last met in each is kept.
    last_down, before_down = down[0], down[1]
    for column in range(width):
        last_down[column] = before_down[column] = -1
    count = 0
    for row in range(height):
        last, before = -1, -1
        for column in range(width):
            here = zone[row, column]
            if here < 0:
                continue
            if last >= 0 and 0 < column - last - 1 <= most and before != here:
                if len(axis):
                    pair[count, 0], pair[count, 1], axis[count] = before, here, 0
                count += 1
            above = before_down[column]
            if above >= 0 and 0 < row - last_down[column] - 1 <= most and above != here:
                if len(axis):
                    pair[count, 0], pair[count, 1], axis[count] = above, here, 1
                count += 1
            last, before = column, here
            last_down[column], before_down[column] = row, here
    return count


def single_gaps(free: Flags) -> Flags:
    """(H, W) free cells that are gaps of one cell: walls on two opposite sides, and before and behind them all free."""
    found = np.zeros(free.shape, np.bool_)
    _mark_gaps(free, found)
    return found


@compiled_bare
def _mark_gaps(free: Flags, found: Flags) -> None:
    """Found (H, W): False at first."""
    height, width = free.shape
    for row in range(1, height - 1):
        above, here, below = free[row - 1], free[row], free[row + 1]
        for column in range(1, width - 1):
            west, east, north, south = here[column - 1], here[column + 1], above[column], below[column]
            corners = above[column - 1] & above[column + 1] & below[column - 1] & below[column + 1]
            through = (north & south & (not west) & (not east)) | (west & east & (not north) & (not south))
            found[row, column] = here[column] & corners & through
