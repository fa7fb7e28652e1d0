"""Compiled loops that turn widths of free space into regions.

H, W: rows, columns.  F: free cells.  Z: zones.  E: contacts between zones.
All moves are 4-connected.  Lengths and areas are in cells.  -1 stands for "none" in every label.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.bonds import Bonds, append, find, tidy
from qualrl.kernels.flooding import BLOCK
from qualrl.kernels.jit import compiled, compiled_bare, compiled_part
from qualrl.kernels.scratch import borrowed

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Flags = NDArray[np.bool_]


class Rules(NamedTuple):
    """When two zones are one place.  Widths of zones and ways are half-widths."""

    pinch: float
    """A way narrower than this share of the narrower zone is a doorway."""
    step: float
    """A corridor is narrower than this share of the place that it opens into."""
    slender: float
    """A corridor's area is at least this many squares of its width."""
    long: float
    """The end of a corridor is at most this many of its widths long."""
    roomy: float
    """A place's area is at least this many squares of the widest way into it."""
    min_area: float
    """A place's area is at least this."""


MANY = 2**14
"""So many steps between labels are written down at a time, or all of a row."""
NO_SET = np.int32(-(2**31))
"""In a forest of sets each cell holds the next one on the way to its root, a root less the size of its set (at most
2**30), and a cell in no set this."""
FIRST_NUMBER = -(2**30) - 1
"""... or a root this, less the number of its set."""


@compiled_part
def root_of(forest: Ints, cell: int) -> int:
    """The root of a cell's set; the paths passed are halved on the way."""
    while forest[cell] >= 0:
        after = forest[cell]
        if forest[after] >= 0:
            forest[cell] = forest[after]
        cell = after
    return cell


def numbered(forest: Ints) -> int:
    """Sets of cells as consecutive numbers, in the order of their first cells: the forest (H, W) becomes their image.

    How many they are.
    """
    count = _number_sets(forest.ravel())
    in_bands(lambda top, bottom: _write_numbers(forest[top:bottom].ravel()), forest.shape, is_light=True)
    return count


@compiled_bare
def _number_sets(forest: Ints) -> int:
    count = 0
    for cell in range(forest.size):
        if forest[cell] == NO_SET:
            continue
        root = root_of(forest, cell)
        if forest[root] > FIRST_NUMBER:
            forest[root] = FIRST_NUMBER - count
            count += 1
        forest[cell] = forest[root]
    return count


@compiled_bare
def _write_numbers(forest: Ints) -> None:
    for cell in range(forest.size):
        forest[cell] = FIRST_NUMBER - forest[cell] if forest[cell] != NO_SET else -1


def pieces(label: Any) -> tuple[Ints, int]:
    """4-connected pieces of equal label: (H, W) int32 piece of each cell, -1 where label is; and their number."""
    forest = forest_of(label)
    return forest, numbered(forest)


def forest_of(label: Any) -> Ints:
    """(H, W) int32: the forest whose sets are the 4-connected pieces of equal label."""
    forest = borrowed(label.shape, np.int32)
    flat, width, sets = label.ravel(), label.shape[1], forest.ravel()

    def united(top: int, bottom: int) -> int:
        forest[top:bottom] = NO_SET
        _unite_pieces(flat, width, top, bottom, sets)
        return top

    _unite_seams(flat, width, np.array(in_bands(united, label.shape)[1:], np.int64), sets)
    return forest


@compiled_bare
def _unite_pieces(flat: Any, width: int, top: int, bottom: int, forest: Ints) -> None:
    """Make the forest, of no sets at first, one of the pieces of the rows from top to bottom of an image (H x W,)."""
    for row in range(top, bottom):
        for cell in range(row * width, (row + 1) * width):
            here = flat[cell]
            if here < 0:
                continue
            forest[cell] = -1
            west = cell > row * width and flat[cell - 1] == here
            if west:
                unite(forest, root_of(forest, cell - 1), cell)
            # With the cell to the northwest both are one already.
            if row > top and flat[cell - width] == here and not (west and flat[cell - width - 1] == here):
                unite(forest, root_of(forest, cell - width), root_of(forest, cell))


@compiled_bare
def _unite_seams(flat: Any, width: int, rows: NDArray[np.int64], forest: Ints) -> None:
    """Unite the pieces of some rows with those of the rows above."""
    for row in rows:
        for cell in range(row * width, (row + 1) * width):
            if flat[cell] >= 0 and flat[cell - width] == flat[cell]:
                unite(forest, root_of(forest, cell - width), root_of(forest, cell))


@compiled_part
def unite(forest: Ints, host: int, guest: int) -> None:
    """Put a root's set into that of another root, or the same."""
    if host != guest:
        forest[host] += forest[guest]
        forest[guest] = host


def crossings(label: Ints) -> Ints:
    """(steps, 2) flat indices of the two cells of every step between two labels, neither of them -1."""
    return np.concatenate(in_bands(partial(crossings_from, label), label.shape))


def crossings_from(label: Ints, top: int, bottom: int) -> Ints:
    """Those of the steps that begin in the rows from top to bottom."""
    room = np.empty((max(2 * label.shape[1], MANY), 2), np.int32)
    found = [room[:0]]
    while top < bottom:
        top, count = _write_crossings(label, top, bottom, room)
        found.append(room[:count].copy())
    return np.concatenate(found)


@compiled_bare
def _write_crossings(label: Ints, top: int, bottom: int, found: Ints) -> tuple[int, int]:
    """The row before which there was no room for more, or the bottom, and how many were found."""
    height, width = label.shape
    count = 0
    for row in range(top, bottom):
        if count + 2 * width > len(found):
            return row, count
        for first in range(0, width, BLOCK):
            end = min(first + BLOCK, width)
            if not _has_crossing(label, row, first, end):
                continue
            for column in range(first, end):
                cell, here = row * width + column, label[row, column]
                if here < 0:
                    continue
                if column + 1 < width and label[row, column + 1] >= 0 and label[row, column + 1] != here:
                    found[count, 0], found[count, 1] = cell, cell + 1
                    count += 1
                if row + 1 < height and label[row + 1, column] >= 0 and label[row + 1, column] != here:
                    found[count, 0], found[count, 1] = cell, cell + width
                    count += 1
    return bottom, count


@compiled_part
def _has_crossing(label: Ints, row: int, first: int, end: int) -> bool:
    """Whether a step from one of a row's cells, to the right or down, leads from label to label: told many at once."""
    height, width = label.shape
    found = np.int32(0)
    for column in range(first, min(end, width - 1)):
        here, after = label[row, column], label[row, column + 1]
        found |= np.int32((here != after) & ((here | after) >= 0))
    if row + 1 < height:
        for column in range(first, end):
            here, after = label[row, column], label[row + 1, column]
            found |= np.int32((here != after) & ((here | after) >= 0))
    return bool(found != 0)


@compiled
def join_zones(
    order: NDArray[np.int64], parent: Ints, area: Floats, breadth: Floats, bonds: Bonds, rules: Rules
) -> int:
    """Go once over the zones and join each that is no place of its own to its host; how many were joined.

    order: zones, smallest first.  parent (Z,): the zone that each was joined to, itself at first.
    area, breadth (Z,): cells and mean half-width of each zone.  All but order and rules are updated.
    """
    seen = np.full(area.size, -1, np.int32)
    joined = 0
    for zone in order:
        if parent[zone] != zone or bonds.first[zone] < 0:
            continue
        tidy(zone, parent, bonds, seen)
        host = _host(zone, area, breadth, bonds, rules)
        if host < 0:
            continue
        parent[zone] = host
        both = area[host] + area[zone]
        breadth[host] = (breadth[host] * area[host] + breadth[zone] * area[zone]) / both
        area[host] = both
        append(host, zone, bonds)
        joined += 1
    for zone in range(parent.size):
        parent[zone] = find(parent, zone)
    return joined


@compiled_part
def _host(zone: int, area: Floats, breadth: Floats, bonds: Bonds, rules: Rules) -> int:
    """Of the neighbours that a zone is one place with, the one it touches most; -1 for none."""
    host, touch = -1, 0.0
    slender = area[zone] >= rules.slender * breadth[zone] ** 2
    half = bonds.first[zone]
    while half >= 0:
        other, length, way = bonds.target[half], bonds.sums[half, 0], bonds.sums[half, 1]
        half = bonds.following[half]
        speck = area[zone] < rules.min_area or area[zone] < rules.roomy * way**2
        level = way >= rules.pinch * breadth[zone]
        corridor_end = slender and way < rules.step * breadth[other] and length < rules.long * breadth[zone]
        if length > touch and (speck or (level and not corridor_end)):
            host, touch = other, length
    return host


def distance_near(ends: Ints, most: float, away: Floats) -> Floats:
    """From each cell to the nearest of some cells (N, 2), flat indices, written to ``away`` (H, W); beyond ``most`` it
    may be infinite.
    """
    away.fill(np.inf)
    off = np.arange(int(np.ceil(most)) + 1, dtype=np.float32) ** 2
    _write_near(ends.ravel(), np.sqrt(off[:, None] + off), away)
    return away


@compiled_bare
def _write_near(flat: Ints, distance: Floats, away: Floats) -> None:
    """distance: from a cell to one so many rows and columns off, as far as they count."""
    height, width = away.shape
    reach = len(distance) - 1
    for at in range(flat.size):
        row, column = flat[at] // width, flat[at] % width
        for r in range(max(row - reach, 0), min(row + reach + 1, height)):
            for c in range(max(column - reach, 0), min(column + reach + 1, width)):
                away[r, c] = min(away[r, c], distance[abs(r - row), abs(c - column)])


def keep_cores(label: Ints, from_border: Floats, thickness: Floats, most: np.float32) -> None:
    """Take from each label what is nearer to its border than ``most`` and half the thickness, unless nothing is left.

    label, from_border, thickness (H, W); label is -1 where not free and is updated.
    """
    has_core = np.zeros(int(label.max()) + 1, np.bool_)

    def part(top: int, bottom: int) -> Any:
        parts = (image[top:bottom].ravel() for image in (label, from_border, thickness))
        return *parts, most, has_core

    in_bands(lambda top, bottom: _find_cores(*part(top, bottom)), label.shape, is_light=True)
    in_bands(lambda top, bottom: _keep_cores(*part(top, bottom)), label.shape, is_light=True)


@compiled_bare
def _find_cores(flat: Ints, away: Floats, thick: Floats, most: np.float32, has_core: Flags) -> None:
    for cell in range(flat.size):
        if flat[cell] >= 0 and away[cell] > min(thick[cell] / 2, most):
            has_core[flat[cell]] = True


@compiled_bare
def _keep_cores(flat: Ints, away: Floats, thick: Floats, most: np.float32, has_core: Flags) -> None:
    for cell in range(flat.size):
        if flat[cell] >= 0 and has_core[flat[cell]] and away[cell] <= min(thick[cell] / 2, most):
            flat[cell] = -1


def run_lengths(label: Ints, cells: Ints, down: NDArray[np.bool_]) -> Ints:
    """(N,) cells of the free run (label, (H, W), not -1) through each of the cells (N,), along its column if down."""
    length = np.zeros(cells.size, np.int32)
    _add_runs(label, cells, down, length)
    return length


@compiled_bare
def _add_runs(label: Ints, cells: Ints, down: Flags, length: Ints) -> None:
    height, width = label.shape
    for at in range(cells.size):
        for way in (-1, 1):
            row, column = cells[at] // width, cells[at] % width
            while 0 <= row < height and 0 <= column < width and label[row, column] >= 0:
                length[at] += 1
                row, column = (row + way, column) if down[at] else (row, column + way)
        length[at] -= 1  # the cell itself was met from both sides
