"""How well two ways to divide the same cells agree."""

import math

import numpy as np


def adjusted_rand_index(one, other):
    """Hubert and Arabie (1985), from the counts of pairs: 1 for the same division, about 0 for chance."""
    _, first = np.unique(one, return_inverse=True)
    _, second = np.unique(other, return_inverse=True)
    table = np.zeros((first.max() + 1, second.max() + 1), int)
    np.add.at(table, (first, second), 1)
    together = sum(math.comb(int(count), 2) for count in table.ravel())
    rows = sum(math.comb(int(count), 2) for count in table.sum(axis=1))
    columns = sum(math.comb(int(count), 2) for count in table.sum(axis=0))
    expected = rows * columns / math.comb(int(table.sum()), 2)
    most = (rows + columns) / 2
    return 1.0 if most == expected else (together - expected) / (most - expected)


def beside(cell, shape):
    """The cells north, west, east and south of a cell."""
    row, column = cell
    around = [(row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column)]
    return [(r, c) for r, c in around if 0 <= r < shape[0] and 0 <= c < shape[1]]


def thick_first(thickness, distance):
    """The cells (row, column) with a distance: thick before thin, far before near, then by position; in sixteenths."""
    near, thin = (-np.minimum(np.floor(width.ravel() * np.float32(16)), 65535) for width in (distance, thickness))
    order = np.lexsort((np.arange(near.size), near, thin)).tolist()
    return [divmod(cell, distance.shape[1]) for cell in order if distance.ravel()[cell] > 0]


def flat_zones(thickness, distance, order, pinch, step):
    """The zones as a set of sets of cells; order: cells (row, column) from thick to thin."""
    zones = {}
    for cell in order:
        thick = thickness[cell]
        near = [zones[other] for other in beside(cell, thickness.shape) if other in zones]
        level = [zone for zone in near if thick >= step * thickness[zone[0]]]
        if not level:
            zones[cell] = [cell]
            continue
        best = max(level, key=lambda zone: (thickness[zone[0]], len(zone)))
        best.append(cell)
        zones[cell] = best
        for zone in near:
            if zone is best or zones[zone[0]] is best or thick < step * thickness[zone[0]]:
                continue
            if distance[cell] >= pinch * thickness[zone[0]] or min(len(zone), len(best)) <= distance[cell] ** 2:
                best += zone
                zones |= dict.fromkeys(zone, best)
    return {frozenset(zone) for zone in zones.values()}


def flooded(label, mask, depth):
    """Labels grown over the mask from the deepest eighth on, first come first served."""
    label, queues = label.copy(), {}

    def wait(cell, most):
        queues.setdefault(min(int(8 * depth[cell]), most), []).append(cell)

    for cell in map(tuple, np.argwhere(mask & (label >= 0)).tolist()):
        if any(mask[other] and label[other] < 0 for other in beside(cell, label.shape)):
            wait(cell, np.inf)
    while queues:
        level = max(queues)
        cell = queues[level].pop(0)
        for other in beside(cell, label.shape):
            if mask[other] and label[other] < 0:
                label[other] = label[cell]
                wait(other, level)
        queues = {at: queue for at, queue in queues.items() if queue}
    return label


def distances(free):
    """(H, W) from each cell to the nearest that is not free, looked for among all of them; infinite without any."""
    found = np.zeros(free.shape, np.float32)
    rows, columns = np.nonzero(~free)
    for row, column in np.argwhere(free).tolist():
        square = ((rows - row) ** 2 + (columns - column) ** 2).min(initial=2**62)
        found[row, column] = np.sqrt(np.float32(square)) if rows.size else np.inf
    return found


def local_thickness(distance):
    """(H, W) of each free cell the radius of the largest disc over it, of those whose centre is on a ridge."""
    height, width = distance.shape
    found = np.zeros_like(distance)
    for row, column in np.argwhere(distance > 0).tolist():
        radius = distance[row, column]
        around = [(r, c) for r in (row - 1, row, row + 1) for c in (column - 1, column, column + 1)
                  if (r, c) != (row, column) and 0 <= r < height and 0 <= c < width]  # fmt: skip
        rise = [np.float32(0.9) * np.float32(1.0 if r == row or c == column else 1.41421) for r, c in around]
        if any(distance[cell] >= radius + up for cell, up in zip(around, rise, strict=True)):
            continue
        for r, c in np.argwhere(distance > 0).tolist():
            # All of a row's cells whose centres are inside the disc, and the centre's own column.
            off = max(float(radius) ** 2 - (r - row) ** 2, 0.0)
            if abs(r - row) < radius and (c == column or abs(c - column) < math.sqrt(off) - 1e-3):
                found[r, c] = max(found[r, c], radius)
    return found


def holes_filled(label, width):
    """The labels with what one of them alone surrounds, and is shorter than it is wide, filled."""
    filled = label.copy()
    for hole in pieces_by_corners(label):
        rows, columns = zip(*hole, strict=True)
        around = {(row + down, column + right) for row, column in hole for down in (-1, 0, 1) for right in (-1, 0, 1)}
        if any(not (0 <= row < label.shape[0] and 0 <= column < label.shape[1]) for row, column in around):
            continue
        (number, *others) = {int(label[cell]) for cell in around - hole}
        longer = max(max(side) - min(side) + 1 for side in (rows, columns))
        if not others and longer < width[number]:
            for cell in hole:
                filled[cell] = number
    return filled


def pieces_by_corners(label):
    """Sets of the cells without a label that hang together by sides or corners."""
    left = {tuple(cell) for cell in np.argwhere(label < 0).tolist()}
    while left:
        waiting, piece = [left.pop()], set()
        while waiting:
            row, column = waiting.pop()
            piece.add((row, column))
            near = {(row + down, column + right) for down in (-1, 0, 1) for right in (-1, 0, 1)} & left
            left -= near
            waiting += near
        yield piece
