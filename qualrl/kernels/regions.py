"""Compiled loops that turn widths of free space into regions.

H, W: rows, columns.  Z: zones, E: contacts between zones.
All moves are 4-connected.  Distances, radii and areas are in cells.  -1 stands for "none" in every label.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Flags = NDArray[np.bool_]

CORE = 0.9
"""The core of a zone is its part that is at least this share as thick as its peak."""


@compiled
def _find(parent: Ints, item: int) -> int:
    """The root of an item's set; paths are halved on the way."""
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item


@compiled
def _disc_centres(distance: Floats) -> Ints:
    """Flat indices of the cells whose disc is not inside the disc of one of their eight neighbours."""
    height, width = distance.shape
    centres = np.empty(distance.size, np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            radius = distance[row, column]
            if radius <= 0:
                continue
            inside = False
            for r in range(max(row - 1, 0), min(row + 2, height)):
                for c in range(max(column - 1, 0), min(column + 2, width)):
                    step = 1.0 if r == row or c == column else 1.41421
                    if (r != row or c != column) and distance[r, c] >= radius + step - 1e-3:
                        inside = True
            if not inside:
                centres[count] = row * width + column
                count += 1
    return centres[:count]


@compiled
def local_thickness(distance: Floats, shrink: float, less: float) -> Floats:
    """Radius of the largest free disc that covers each cell.

    distance (H, W): from each cell to the nearest cell that is not free, 0 where not free.
    Discs are painted from large to small and each cell once: in every row, ``unpainted`` points to the
    next cell that no disc has reached, so the work grows with the discs' rows and not with their areas.
    """
    height, width = distance.shape
    thickness = np.zeros((height, width), np.float32)
    unpainted = np.empty((height, width + 1), np.int32)
    for row in range(height):
        for column in range(width + 1):
            unpainted[row, column] = column
    centres = _disc_centres(distance)
    flat = distance.ravel()
    for centre in centres[np.argsort(-flat[centres])]:
        row, column, value = centre // width, centre % width, flat[centre]
        radius = max(value * shrink - less, 1.0)
        reach = int(np.ceil(radius)) - 1
        for r in range(max(row - reach, 0), min(row + reach + 1, height)):
            half = int(np.ceil(np.sqrt(radius * radius - (r - row) * (r - row)) - 1e-3)) - 1
            last = min(column + max(half, 0), width - 1)
            c = _find(unpainted[r], max(column - max(half, 0), 0))
            while c <= last:
                if distance[r, c] > 0:
                    thickness[r, c] = value
                unpainted[r, c] = c + 1
                c = _find(unpainted[r], c + 1)
    return thickness


@compiled
def flat_zones(thickness: Floats, distance: Floats, order: Ints, rules: Floats) -> tuple[Ints, int]:
    """Zones of alike thickness: (H, W) zone of each cell, -1 where thickness is 0; and their number.

    order (free cells,): flat indices from thick to thin.  A cell joins the zone beside it unless that would
    pass a pinch (thinner than ``pinch`` times the smaller peak) or a step (thinner than ``step`` times the
    larger).  A bulge of little core, as where corridors meet, makes no pinch.  rules: see ``_host``.
    """
    pinch, step, bulge = rules[0], rules[1], rules[5]
    height, width = thickness.shape
    flat, way = thickness.ravel(), distance.ravel()
    parent = np.full(flat.size, -1, np.int32)
    peak = flat.copy()
    core = np.ones(flat.size, np.float32)
    for cell in order:
        parent[cell] = cell
        row, column = cell // width, cell % width
        for side in range(4):
            if side == 0 and row > 0:
                other = cell - width
            elif side == 1 and column > 0:
                other = cell - 1
            elif side == 2 and column < width - 1:
                other = cell + 1
            elif side == 3 and row < height - 1:
                other = cell + width
            else:
                continue
            if parent[other] < 0:
                continue
            a, b = _find(parent, cell), _find(parent, other)
            low, high = min(peak[a], peak[b]), max(peak[a], peak[b])
            if a == b or flat[cell] < step * high:
                continue
            if way[cell] >= pinch * low or min(core[a], core[b]) < bulge * way[cell] ** 2:
                if peak[b] < peak[a]:
                    a, b = b, a
                parent[a] = b
                core[b] = core[a] + core[b] if CORE * peak[b] <= flat[cell] else max(core[a], core[b])
    return _numbered(parent, height, width)


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
    parent = np.full(label.size, -1, np.int32)
    for row in range(height):
        for column in range(width):
            cell = row * width + column
            if label[row, column] < 0:
                continue
            parent[cell] = cell
            if column > 0 and label[row, column - 1] == label[row, column]:
                parent[cell] = _find(parent, cell - 1)
            if row > 0 and label[row - 1, column] == label[row, column]:
                a, b = _find(parent, cell - width), _find(parent, cell)
                parent[max(a, b)] = min(a, b)
    return _numbered(parent, height, width)


@compiled
def contacts(zone: Ints, thickness: Floats) -> tuple[Ints, Floats]:
    """Every step between two zones: (steps, 2) the zones, smaller first; (steps,) the thinner end's thickness."""
    height, width = zone.shape
    count = 0
    for row in range(height):
        for column in range(width):
            count += column + 1 < width and _differ(zone[row, column], zone[row, column + 1])
            count += row + 1 < height and _differ(zone[row, column], zone[row + 1, column])
    pair = np.empty((count, 2), np.int32)
    saddle = np.empty(count, np.float32)
    count = 0
    for row in range(height):
        for column in range(width):
            for down in range(2):
                r, c = row + down, column + 1 - down
                if r < height and c < width and _differ(zone[row, column], zone[r, c]):
                    pair[count, 0] = min(zone[row, column], zone[r, c])
                    pair[count, 1] = max(zone[row, column], zone[r, c])
                    saddle[count] = min(thickness[row, column], thickness[r, c])
                    count += 1
    return pair, saddle


@compiled
def _differ(a: int, b: int) -> bool:
    """Whether two labels are two places."""
    return a >= 0 and b >= 0 and a != b


@compiled
def join_zones(
    area: Floats, peak: Floats, pair: Ints, length: Floats, saddle: Floats, min_area: float, rules: Floats
) -> Ints:
    """Join zones, smallest first, until each is a region of its own; (Z,) the zone that stands for each.

    area, peak (Z,) are read and overwritten; pair (E, 2), length (E,) steps of contact, saddle (E,) the
    thickest step.  rules: see ``_host``.
    Half-edges 2e and 2e+1 hold contact e as seen from its two ends; a zone's half-edges are a linked list,
    and joining two zones links their lists.
    """
    zones, edges = area.size, saddle.size
    parent = np.arange(zones).astype(np.int32)
    first, last = np.full(zones, -1, np.int32), np.full(zones, -1, np.int32)
    following = np.full(2 * edges, -1, np.int32)
    target = np.empty(2 * edges, np.int32)
    half_length, half_saddle = np.empty(2 * edges, np.float32), np.empty(2 * edges, np.float32)
    for half in range(2 * edges):
        here = pair[half // 2, half % 2]
        target[half] = pair[half // 2, 1 - half % 2]
        half_length[half], half_saddle[half] = length[half // 2], saddle[half // 2]
        following[half] = first[here]
        first[here] = half
        if last[here] < 0:
            last[here] = half
    seen = np.full(zones, -1, np.int32)
    joined = True
    while joined:
        joined = False
        for zone in np.argsort(area):
            if parent[zone] != zone or first[zone] < 0:
                continue
            _tidy(zone, parent, first, last, following, target, half_length, half_saddle, seen)
            host = _host(zone, area, peak, first, following, target, half_length, half_saddle, min_area, rules)
            if host < 0:
                continue
            parent[zone] = host
            if rules[6] > 0:
                peak[host] = (peak[host] * area[host] + peak[zone] * area[zone]) / (area[host] + area[zone])
            else:
                peak[host] = max(peak[host], peak[zone])
            area[host] += area[zone]
            if last[host] < 0:
                first[host] = first[zone]
            else:
                following[last[host]] = first[zone]
            last[host] = last[zone]
            joined = True
    for zone in range(zones):
        parent[zone] = _find(parent, zone)
    return parent


@compiled
def _tidy(
    zone: int, parent: Ints, first: Ints, last: Ints, following: Ints, target: Ints,
    length: Floats, saddle: Floats, seen: Ints,
) -> None:
    """Leave one half-edge for each neighbour of a zone, and none to itself."""
    half, kept = first[zone], -1
    first[zone] = -1
    while half >= 0:
        after = following[half]
        other = _find(parent, target[half])
        if other != zone:
            if seen[other] >= 0:
                length[seen[other]] += length[half]
                saddle[seen[other]] = max(saddle[seen[other]], saddle[half])
            else:
                target[half] = other
                seen[other] = half
                if kept < 0:
                    first[zone] = half
                else:
                    following[kept] = half
                kept = half
        half = after
    last[zone] = kept
    if kept >= 0:
        following[kept] = -1
    half = first[zone]
    while half >= 0:
        seen[target[half]] = -1
        half = following[half]


@compiled
def _host(
    zone: int, area: Floats, peak: Floats, first: Ints, following: Ints, target: Ints,
    length: Floats, saddle: Floats, min_area: float, rules: Floats,
) -> int:
    """The neighbour that a zone must join, or -1.

    rules: pinch, step (as in ``flat_zones``); slender: a zone of less area than slender * peak**2 is no
    corridor; long: a contact of more than long * peak is no end of one; roomy: a zone of less area than
    roomy * saddle**2 is no more than a bulge of what it opens to.
    """
    pinch, step, slender, long, roomy = rules[0], rules[1], rules[2], rules[3], rules[4]
    best, best_width = -1, np.float32(-1.0)
    half = first[zone]
    while half >= 0:
        other, width, contact = target[half], saddle[half], length[half]
        half = following[half]
        if area[zone] < min_area or area[zone] < roomy * width * width:
            fits = True
        else:
            level = peak[other] >= rules[7] * peak[zone] and width >= pinch * peak[zone]
            corridor = area[zone] >= slender * peak[zone] ** 2 and width < step * peak[other]
            fits = level and not (corridor and contact < long * peak[zone])
        if fits and contact > best_width:
            best, best_width = other, contact
    return best


@compiled
def flood(label: Ints, mask: Flags, level: Ints) -> Ints:
    """Grow labels over the mask, high levels first; borders settle where the fronts meet.

    label (H, W) the seeds, -1 elsewhere; mask (H, W) where to grow; level (H, W) 0 or more, high is early.
    Cells that no seed reaches stay -1.
    """
    height, width = label.shape
    result = label.copy().ravel()
    inside, height_of = mask.ravel(), level.ravel()
    levels = int(height_of.max()) + 1
    head, tail = np.full(levels, -1, np.int32), np.full(levels, -1, np.int32)
    following = np.full(result.size, -1, np.int32)
    for cell in range(result.size):
        if result[cell] >= 0:
            at = height_of[cell]
            if head[at] < 0:
                head[at] = cell
            else:
                following[tail[at]] = cell
            tail[at] = cell
    top = levels - 1
    while top >= 0:
        cell = head[top]
        if cell < 0:
            top -= 1
            continue
        head[top] = following[cell]
        row, column = cell // width, cell % width
        for side in range(4):
            if side == 0 and row > 0:
                other = cell - width
            elif side == 1 and column > 0:
                other = cell - 1
            elif side == 2 and column < width - 1:
                other = cell + 1
            elif side == 3 and row < height - 1:
                other = cell + width
            else:
                continue
            if not inside[other] or result[other] >= 0:
                continue
            result[other] = result[cell]
            at = min(height_of[other], top)
            following[other] = -1
            if head[at] < 0:
                head[at] = other
            else:
                following[tail[at]] = other
            tail[at] = other
    return result.reshape(height, width)


@compiled
def _runs(free: Flags) -> tuple[Ints, Ints]:
    """(H, W) length of the free run through each cell along its row, and along its column; 0 where not free."""
    height, width = free.shape
    along, across = np.zeros((height, width), np.int32), np.zeros((height, width), np.int32)
    for row in range(height):
        start = 0
        for column in range(width + 1):
            if column == width or not free[row, column]:
                along[row, start:column] = column - start
                start = column + 1
    for column in range(width):
        start = 0
        for row in range(height + 1):
            if row == height or not free[row, column]:
                across[start:row, column] = row - start
                start = row + 1
    # The cell that ended a run is not free, and lies in no run.
    return along, across


@compiled
def crossings(label: Ints, thickness: Floats) -> tuple[Ints, Ints, Floats]:
    """Every step between two regions: its cells, how wide free space is there, and its thickness.

    Returns (E, 2) flat indices of the two cells; (E, 2) length of the free run through each cell at a right
    angle to the step; (E,) thickness at the thinner end.
    """
    height, width = label.shape
    along, across = _runs(label >= 0)
    count = 0
    for row in range(height):
        for column in range(width):
            count += column + 1 < width and _differ(label[row, column], label[row, column + 1])
            count += row + 1 < height and _differ(label[row, column], label[row + 1, column])
    cells, run = np.empty((count, 2), np.int32), np.empty((count, 2), np.int32)
    saddle = np.empty(count, np.float32)
    count = 0
    for row in range(height):
        for column in range(width):
            for down in range(2):
                r, c = row + down, column + 1 - down
                if r < height and c < width and _differ(label[row, column], label[r, c]):
                    cells[count, 0], cells[count, 1] = row * width + column, r * width + c
                    run[count, 0] = along[row, column] if down else across[row, column]
                    run[count, 1] = along[r, c] if down else across[r, c]
                    saddle[count] = min(thickness[row, column], thickness[r, c])
                    count += 1
    return cells, run, saddle


@compiled
def steps_from(label: Ints, start: Ints) -> Ints:
    """(H, W) steps from the start cells (flat indices) without leaving their region; -1 where none leads."""
    height, width = label.shape
    flat = label.ravel()
    steps = np.full(flat.size, -1, np.int32)
    queue = np.empty(flat.size, np.int32)
    count = 0
    for cell in start:
        steps[cell] = 0
        queue[count] = cell
        count += 1
    done = 0
    while done < count:
        cell = queue[done]
        done += 1
        row, column = cell // width, cell % width
        for side in range(4):
            if side == 0 and row > 0:
                other = cell - width
            elif side == 1 and column > 0:
                other = cell - 1
            elif side == 2 and column < width - 1:
                other = cell + 1
            elif side == 3 and row < height - 1:
                other = cell + width
            else:
                continue
            if steps[other] < 0 and flat[other] == flat[cell]:
                steps[other] = steps[cell] + 1
                queue[count] = other
                count += 1
    return steps.reshape(height, width)
