"""Compiled loops that turn widths of free space into regions.

H, W: rows, columns.  F: free cells.  Z: zones.  E: contacts between zones.
All moves are 4-connected.  Lengths and areas are in cells.  -1 stands for "none" in every label.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled, compiled_part

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


class Contacts(NamedTuple):
    """Where zones touch."""

    pair: Ints
    """(E, 2) the two zones."""
    length: Floats
    """(E,) steps that lead from one to the other."""
    way: Floats
    """(E,) half-width of the widest way from one to the other."""


class Links(NamedTuple):
    """A linked list of half-edges for each zone, so that joining two zones links their lists.

    Half-edges 2e and 2e+1 hold contact e as seen from its two ends.
    """

    first: Ints
    """(Z,) first half-edge of each zone, -1 for none."""
    last: Ints
    """(Z,)"""
    following: Ints
    """(2E,) next half-edge of the same zone, -1 at the end."""
    target: Ints
    """(2E,) the zone at the other end, or one that has been joined to it."""
    length: Floats
    """(2E,)"""
    way: Floats
    """(2E,)"""


@compiled_part
def _find(parent: Ints, item: int) -> int:
    """The root of an item's set; the paths passed are halved on the way."""
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item


@compiled_part
def _beside(cell: int, side: int, height: int, width: int) -> int:
    """Flat index of the cell north, west, east or south (side 0 to 3) of a cell, -1 off the map."""
    column = cell % width
    if side == 0:
        return cell - width if cell >= width else -1
    if side == 1:
        return cell - 1 if column > 0 else -1
    if side == 2:
        return cell + 1 if column < width - 1 else -1
    return cell + width if cell < (height - 1) * width else -1


@compiled
def _numbered(parent: Ints, height: int, width: int) -> tuple[Ints, int]:
    """Sets of cells (parent -1: no set) as consecutive numbers, in the order of their first cell."""
    number = np.full(parent.size, -1, np.int32)
    label = np.full(parent.size, -1, np.int32)
    count = 0
    for cell in range(parent.size):
        if parent[cell] >= 0:
            root = _find(parent, cell)
            if number[root] < 0:
                number[root] = count
                count += 1
            label[cell] = number[root]
    return label.reshape(height, width), count


@compiled
def pieces(label: Ints) -> tuple[Ints, int]:
    """4-connected pieces of equal label: (H, W) piece of each cell, -1 where label is; and their number."""
    height, width = label.shape
    flat = label.ravel()
    parent = np.full(flat.size, -1, np.int32)
    for cell in range(flat.size):
        if flat[cell] < 0:
            continue
        parent[cell] = cell
        for side in range(2):
            other = _beside(cell, side, height, width)
            if other >= 0 and flat[other] == flat[cell]:
                a, b = _find(parent, other), _find(parent, cell)
                parent[max(a, b)] = min(a, b)
    return _numbered(parent, height, width)


@compiled
def flat_zones(thickness: Floats, distance: Floats, order: Ints, pinch: float, step: float) -> tuple[Ints, int]:
    """Zones of alike thickness: (H, W) zone of each cell, -1 for cells not in order; and their number.

    order (F,): flat indices of the free cells from thick to thin.  A cell joins the thickest
    (then largest) zone beside it that is no step thicker, and other zones too if the way there is no pinch.
    Thickness tells steps and distance tells pinches: the discs of two rooms may touch in a door of a thin wall.
    """
    height, width = thickness.shape
    thick, way = thickness.ravel(), distance.ravel()
    parent = np.full(thick.size, -1, np.int32)
    peak, area = thick.copy(), np.ones(thick.size, np.int32)
    for cell in order:
        parent[cell] = cell
        best = -1
        for side in range(4):
            other = _beside(cell, side, height, width)
            if other >= 0 and parent[other] >= 0:
                zone = _find(parent, other)
                if thick[cell] < step * peak[zone]:
                    continue
                larger = best >= 0 and peak[zone] == peak[best] and area[zone] > area[best]
                if best < 0 or peak[zone] > peak[best] or larger:
                    best = zone
        if best < 0:
            continue
        parent[cell] = best
        area[best] += 1
        for side in range(4):
            other = _beside(cell, side, height, width)
            if other < 0 or parent[other] < 0:
                continue
            zone = _find(parent, other)
            # Zones of less area than the way is wide are specks in which no place can lie.
            is_one = way[cell] >= pinch * peak[zone] or min(area[zone], area[best]) <= way[cell] ** 2
            if zone != best and thick[cell] >= step * peak[zone] and is_one:
                parent[zone] = best
                area[best] += area[zone]
    return _numbered(parent, height, width)


@compiled
def crossings(label: Ints) -> Ints:
    """(steps, 2) flat indices of the two cells of every step between two labels, neither of them -1."""
    height, width = label.shape
    flat = label.ravel()
    count = 0
    for fill in range(2):
        found = np.empty((count * fill, 2), np.int32)
        count = 0
        for row in range(height):
            for cell in range(row * width, row * width + width):
                here = flat[cell]
                if here < 0:
                    continue
                if cell + 1 < row * width + width and flat[cell + 1] >= 0 and flat[cell + 1] != here:
                    if fill:
                        found[count, 0], found[count, 1] = cell, cell + 1
                    count += 1
                if row + 1 < height and flat[cell + width] >= 0 and flat[cell + width] != here:
                    if fill:
                        found[count, 0], found[count, 1] = cell, cell + width
                    count += 1
    return found


@compiled
def join_zones(
    order: NDArray[np.int64], parent: Ints, area: Floats, breadth: Floats, links: Links, rules: Rules
) -> int:
    """Go once over the zones and join each that is no place of its own to its host; how many were joined.

    order: zones, smallest first.  parent (Z,): the zone that each was joined to, itself at first.
    area, breadth (Z,): cells and mean half-width of each zone.  All but order and rules are updated.
    """
    seen = np.full(area.size, -1, np.int32)
    joined = 0
    for zone in order:
        if parent[zone] != zone or links.first[zone] < 0:
            continue
        _tidy(zone, parent, links, seen)
        host = _host(zone, area, breadth, links, rules)
        if host < 0:
            continue
        parent[zone] = host
        both = area[host] + area[zone]
        breadth[host] = (breadth[host] * area[host] + breadth[zone] * area[zone]) / both
        area[host] = both
        if links.last[host] < 0:
            links.first[host] = links.first[zone]
        else:
            links.following[links.last[host]] = links.first[zone]
        links.last[host] = links.last[zone]
        joined += 1
    for zone in range(parent.size):
        parent[zone] = _find(parent, zone)
    return joined


@compiled
def linked(zones: int, contacts: Contacts) -> Links:
    """The contacts as a list for each zone."""
    first, last = np.full(zones, -1, np.int32), np.full(zones, -1, np.int32)
    following = np.full(2 * len(contacts.pair), -1, np.int32)
    target = np.empty(following.size, np.int32)
    length, way = np.empty(following.size, np.float32), np.empty(following.size, np.float32)
    for half in range(following.size):
        contact, end = half // 2, half % 2
        here = contacts.pair[contact, end]
        target[half] = contacts.pair[contact, 1 - end]
        length[half], way[half] = contacts.length[contact], contacts.way[contact]
        following[half] = first[here]
        first[here] = half
        if last[here] < 0:
            last[here] = half
    return Links(first, last, following, target, length, way)


@compiled_part
def _tidy(zone: int, parent: Ints, links: Links, seen: Ints) -> None:
    """Leave a zone one half-edge for each neighbour, and none to itself.  seen (Z,) is scratch, all -1."""
    half, kept = links.first[zone], -1
    links.first[zone] = -1
    while half >= 0:
        after = links.following[half]
        other = _find(parent, links.target[half])
        before = seen[other]
        if other != zone and before >= 0:
            links.length[before] += links.length[half]
            links.way[before] = max(links.way[before], links.way[half])
        elif other != zone:
            links.target[half] = other
            seen[other] = half
            if kept < 0:
                links.first[zone] = half
            else:
                links.following[kept] = half
            kept = half
        half = after
    links.last[zone] = kept
    if kept >= 0:
        links.following[kept] = -1
    half = links.first[zone]
    while half >= 0:
        seen[links.target[half]] = -1
        half = links.following[half]


@compiled_part
def _host(zone: int, area: Floats, breadth: Floats, links: Links, rules: Rules) -> int:
    """Of the neighbours that a zone is one place with, the one it touches most; -1 for none."""
    host, touch = -1, np.float32(0.0)
    slender = area[zone] >= rules.slender * breadth[zone] ** 2
    half = links.first[zone]
    while half >= 0:
        other, way, length = links.target[half], links.way[half], links.length[half]
        half = links.following[half]
        speck = area[zone] < rules.min_area or area[zone] < rules.roomy * way**2
        level = way >= rules.pinch * breadth[zone]
        corridor_end = slender and way < rules.step * breadth[other] and length < rules.long * breadth[zone]
        if length > touch and (speck or (level and not corridor_end)):
            host, touch = other, length
    return host


@compiled
def flood(label: Ints, mask: Flags, level: Ints) -> Ints:
    """Grow labels over the mask, high levels first; borders settle where the fronts meet.

    label (H, W) the seeds, -1 elsewhere; mask (H, W) where to grow; level (H, W) 0 or more.
    Cells that no seed reaches stay -1.
    """
    height, width = label.shape
    result, inside, level_of = label.copy().ravel(), mask.ravel(), level.ravel()
    top = 0
    for cell in range(result.size):
        top = max(top, level_of[cell])
    head = np.full(top + 1, -1, np.int32)
    tail = head.copy()
    following = np.full(result.size, -1, np.int32)
    for cell in range(result.size):
        if result[cell] < 0 or not inside[cell]:
            continue
        for side in range(4):
            other = _beside(cell, side, height, width)
            if other >= 0 and inside[other] and result[other] < 0:
                _enqueue(cell, level_of[cell], head, tail, following)
                break
    while top >= 0:
        cell = head[top]
        if cell < 0:
            top -= 1
            continue
        head[top] = following[cell]
        for side in range(4):
            other = _beside(cell, side, height, width)
            if other >= 0 and inside[other] and result[other] < 0:
                result[other] = result[cell]
                _enqueue(other, min(level_of[other], top), head, tail, following)
    return result.reshape(height, width)


@compiled_part
def _enqueue(cell: int, level: int, head: Ints, tail: Ints, following: Ints) -> None:
    """Put a cell at the end of its level's queue."""
    following[cell] = -1
    if head[level] < 0:
        head[level] = cell
    else:
        following[tail[level]] = cell
    tail[level] = cell


@compiled
def free_runs(free: Flags) -> tuple[Ints, Ints]:
    """(H, W) cells of the free run through each cell along its row, and along its column; 0 where not free."""
    height, width = free.shape
    along, across = np.zeros((height, width), np.int32), np.zeros((height, width), np.int32)
    first_row = np.zeros(width, np.int32)
    for row in range(height + 1):
        start = 0
        for column in range(width + 1):
            if row < height and (column == width or not free[row, column]):
                along[row, start:column] = column - start
                start = column + 1
            if column < width and (row == height or not free[row, column]):
                across[first_row[column] : row, column] = row - first_row[column]
                first_row[column] = row + 1
    return along, across
