"""Order and names of places: the same map gives the same names, and a few stray cells do not change them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

KINDS = ("room", "corridor", "hall", "closet", "open area", "pocket")
"""The order in which regions are listed."""
ALIKE = 0.95
"""Areas are alike, and position decides, when the smallest is at least this share of the largest."""
NEAR_M = 0.5
"""Distances that differ by less are alike."""
LINE_M = 2.0
"""Regions whose centres are within this many metres, north to south, are read as one line."""
MOST_ENDS = 3
"""Places from which distances tell regions apart, beside the middle of the map."""


def letters(index: int) -> str:
    """A, B, .. Z, AA, AB, .. for 0, 1, ..

    >>> letters(0), letters(25), letters(26)
    ('A', 'Z', 'AA')
    """
    name = ""
    index += 1
    while index > 0:
        index, last = divmod(index - 1, 26)
        name = chr(ord("A") + last) + name
    return name


def reading_order(places: Sequence[tuple[float, float]], line: float) -> list[int]:
    """Indices of (row, column) places as one reads: line by line, and from west to east within a line.

    A line takes in all places at most ``line`` rows below its first one.
    """
    order: list[int] = []
    waiting = sorted(range(len(places)), key=lambda index: places[index])
    while waiting:
        last = places[waiting[0]][0] + line
        end = next((at for at, index in enumerate(waiting) if places[index][0] > last), len(waiting))
        order += sorted(waiting[:end], key=lambda index: (places[index][1], places[index][0]))
        waiting = waiting[end:]
    return order


def ordered(
    kinds: Sequence[str], centroid: NDArray[np.float64], cells: NDArray[np.int64], resolution_m: float
) -> list[int]:
    """Indices of regions by kind, then area (largest first), then position; centroid (R, 2), cells (R,).

    Regions of alike areas are told apart by how far they lie from the middle of the map's free space, then from
    its largest regions, and only those that this leaves alike, as on a symmetric map, by reading order.  So neither a
    turned or mirrored map nor a few stray cells change the order of places that differ.
    """
    smallness = [-math.log(size) for size in cells.tolist()]
    linked = [at for at, kind in enumerate(kinds) if kind != "pocket"]
    away = _distances(centroid, cells, linked, smallness)
    order: list[int] = []
    for kind in KINDS:
        members = [at for at in (range(len(kinds)) if kind == "pocket" else linked) if kinds[at] == kind]
        measures = [] if kind == "pocket" else [(far, NEAR_M / resolution_m) for far in away]
        for group in _told_apart(members, [(smallness, -math.log(ALIKE)), *measures]):
            places = [(row, column) for row, column in centroid[group].tolist()]
            order += [group[at] for at in reading_order(places, LINE_M / resolution_m)]
    return order


def _distances(
    centroid: NDArray[np.float64], cells: NDArray[np.int64], linked: list[int], smallness: list[float]
) -> list[list[float]]:
    """From each region, in cells: to the middle of the linked regions, and to the largest that none is like in size."""
    if not linked:
        return []
    alone = [group[0] for group in _alike(linked, smallness, -math.log(ALIKE)) if len(group) == 1]
    middle = np.average(centroid[linked], axis=0, weights=cells[linked])
    ends = [middle, *centroid[alone[:MOST_ENDS]]]
    # Rounded, since sums depend in their last digits on how the map is turned.
    return [np.round(np.hypot(*(centroid - end).T), 6).tolist() for end in ends]


def _told_apart(members: list[int], measures: Sequence[tuple[list[float], float]]) -> list[list[int]]:
    """Members in groups that are alike by every (measure, spread), in the order of the measures."""
    groups = [members] if members else []
    for value, spread in measures:
        groups = [part for group in groups for part in _alike(group, value, spread)]
    return groups


def _alike(members: list[int], value: list[float], spread: float) -> list[list[int]]:
    """Members by increasing value, in groups whose values differ by ``spread`` at most, cut at the widest gaps.

    A gap that is wide stays where it is when values change a little.
    """
    if len(members) == 1:
        return [members]
    members = sorted(members, key=lambda at: value[at])
    sizes = np.array([value[at] for at in members])
    groups, waiting = list[list[int]](), [(0, len(members))]
    while waiting:
        start, end = waiting.pop()
        if sizes[end - 1] - sizes[start] <= spread:
            groups.append(members[start:end])
        else:
            cut = start + 1 + int(np.argmax(np.diff(sizes[start:end])))
            waiting += [(cut, end), (start, cut)]
    return groups


def names_of(kinds: Sequence[str]) -> list[str]:
    """The names of regions, in their order, of some kinds: room A, corridor 1, open area 1."""
    count = dict.fromkeys(KINDS, 0)
    names = []
    for kind in kinds:
        number = count[kind]
        count[kind] += 1
        names.append(f"{kind} {letters(number) if kind == 'room' else number + 1}")
    return names
