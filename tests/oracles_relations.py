"""Relations of places as the definitions say, cell by cell."""

import math
from collections import deque
from itertools import product

TILE_WORDS = {(1, -1): "north-west", (1, 0): "north", (1, 1): "north-east", (0, -1): "west", (0, 0): "middle",
              (0, 1): "east", (-1, -1): "south-west", (-1, 0): "south", (-1, 1): "south-east"}  # fmt: skip


def world_of(grid, cell):
    """x, y of a cell's centre, in cells and not metres, to nine digits."""
    return tuple(round(metres / grid.resolution_m, 9) for metres in grid.to_world(*cell))


def tile_shares(grid, cells, around):
    """The share of the cells in each tile of the box around others, by the world's axes."""
    there = [world_of(grid, cell) for cell in around]
    sides = [(min(axis), max(axis)) for axis in zip(*there, strict=True)]
    found = {}
    for cell in cells:
        x, y = (
            (at > most + 1e-6) - (at < least - 1e-6)
            for at, (least, most) in zip(world_of(grid, cell), sides, strict=True)
        )
        found[TILE_WORDS[y, x]] = found.get(TILE_WORDS[y, x], 0) + 1
    return {tile: count / len(cells) for tile, count in found.items()}


def steps_between(free, start, goal):
    """Breadth first; infinite where no way leads."""
    steps, queue = {start: 0}, deque([start])
    while queue:
        row, column = queue.popleft()
        for cell in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            inside = 0 <= cell[0] < free.shape[0] and 0 <= cell[1] < free.shape[1]
            if inside and free[cell] and cell not in steps:
                steps[cell] = steps[row, column] + 1
                queue.append(cell)
    return steps.get(goal, math.inf)


def rcc8(a, b):
    """Of sets of cells (row, column) of an endless plane, each cell with its border."""
    near = {(r + i, c + j) for r, c in a for i in (-1, 0, 1) for j in (-1, 0, 1)}
    if a == b:
        return "EQ"
    if not a & b:
        return "EC" if near & b else "DC"
    if a < b:
        return "NTPP" if near <= b else "TPP"
    if b < a:
        return {"TPP": "TPPi", "NTPP": "NTPPi"}[rcc8(b, a)]
    return "PO"


def is_inside(corners, x, y):
    """Whether a ray from a point to the east crosses the sides of a polygon an odd number of times."""
    crossings = 0
    for (x1, y1), (x2, y2) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            crossings += 1
    return crossings % 2 == 1


def closed(calculus, things, constraints):
    """Algebraic closure, one base relation after the other, until nothing changes; None for a contradiction."""
    whole = set(range(len(calculus.relations)))

    def base(relation):
        return {bit for bit in whole if relation >> bit & 1}

    def after(first, second):
        return {t for r in first for s in second for t in base(calculus.composition[r][s])}

    network = {(a, b): set(whole) if a != b else {calculus.identity} for a in range(things) for b in range(things)}
    for a, b, relation in constraints:
        network[a, b] &= base(relation)
        network[b, a] &= {calculus.converses[bit] for bit in base(relation)}
    before = None
    while before != network:
        before = dict(network)
        for a, b, c in product(range(things), repeat=3):
            network[a, c] = network[a, c] & after(network[a, b], network[b, c])
    if not all(network.values()):
        return None
    return [[sum(1 << bit for bit in network[a, b]) for b in range(things)] for a in range(things)]
