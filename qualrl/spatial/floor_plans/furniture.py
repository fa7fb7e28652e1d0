"""Furniture: cupboards along walls, tables, legs of chairs, half partitions.

H, W: rows, columns of the plan.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.spatial.floor_plans.layout import CELL_M, cells

Flags = NDArray[np.bool_]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]

MOST_PIECES = 60
"""In one place."""


def furniture(
    free: Flags, place: Ints, is_corridor: list[bool], rng: np.random.Generator, density: float, crowded: bool
) -> Flags:
    """(H, W) cells under furniture: about ``density`` fifths of a piece a square metre; if crowded, desks in rows.

    free (H, W); place (H, W) number of the room or corridor of each cell.
    """
    taken = np.zeros(free.shape, np.uint8)
    to_wall = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5)
    for number, corridor in enumerate(is_corridor):
        rows, columns = np.nonzero((place == number) & free)
        area_m2 = rows.size * CELL_M**2
        by_wall = np.flatnonzero(to_wall[rows, columns] < cells(0.15))
        if area_m2 < 0.5 or not by_wall.size:
            continue
        for _ in range(min(int(rng.poisson(density * area_m2 * (0.05 if corridor else 0.22))), MOST_PIECES)):
            against_wall = rng.random() < 0.45
            at = by_wall[rng.integers(by_wall.size)] if against_wall else rng.integers(rows.size)
            _put(taken, place, number, (int(rows[at]), int(columns[at])), against_wall, rng)
        if crowded and not corridor and area_m2 > 18 and rng.random() < 0.2 * min(density, 1.5):
            taken |= _desks((place == number) & (to_wall > cells(0.4)), rng)
        if not corridor and area_m2 > 12 and rng.random() < 0.12 * min(density, 1.5):
            for at in rng.choice(by_wall, size=int(rng.integers(1, 4))):
                taken |= _partition(place == number, (int(rows[at]), int(columns[at])), rng)
    return taken > 0


def _desks(inside: Flags, rng: np.random.Generator) -> Bytes:
    """(H, W) the same group of a desk and chairs again and again, in rows and columns all over the inside of a room."""
    group = np.zeros([cells(rng.uniform(0.5, 2.4)) for _ in range(2)], np.uint8)
    down, right = (side + cells(rng.uniform(0.6, 2.0)) for side in group.shape)
    margin = cells(rng.uniform(0.1, 0.5))
    group[margin:-margin, margin:-margin] = 1
    if rng.random() < 0.4:
        group[margin + 2 : -margin - 2, margin + 2 : -margin - 2] = 0
    drawn = np.zeros(inside.shape, np.uint8)
    rows, columns = np.nonzero(inside)
    for row in range(int(rows.min(initial=0)), int(rows.max(initial=0)), down):
        for column in range(int(columns.min(initial=0)), int(columns.max(initial=0)), right):
            chairs = _piece(group.shape, False, rng) if rng.random() < 0.7 else np.zeros_like(group)
            window = drawn[row : row + group.shape[0], column : column + group.shape[1]]
            if window.shape == group.shape and rng.random() < 0.9:
                window |= group | chairs
    return drawn & inside


def _put(
    taken: Bytes, place: Ints, number: int, at: tuple[int, int], against_wall: bool, rng: np.random.Generator
) -> None:
    """Put a piece down around a cell, unless it would stand half in another place."""
    sides = (
        [rng.uniform(0.5, 2.2), rng.uniform(0.3, 0.8)] if against_wall else [rng.uniform(0.6, 2), rng.uniform(0.5, 1)]
    )
    height, width = (cells(side) // 2 for side in rng.permutation(sides))
    row, column = at
    window = (slice(max(row - height, 0), row + height + 1), slice(max(column - width, 0), column + width + 1))
    inside = place[window] == number
    if inside.mean() > 0.55:
        taken[window] |= _piece(inside.shape, against_wall, rng) & inside


def _piece(shape: tuple[int, ...], against_wall: bool, rng: np.random.Generator) -> Bytes:
    """What stands on a rectangle: all of it, its rim, four legs, or some of a chair's."""
    piece = np.zeros(shape, np.uint8)
    kind = rng.random()
    if against_wall or kind < 0.27:
        piece[:] = 1
    elif kind < 0.42:
        piece[[0, -1]] = 1
        piece[:, [0, -1]] = 1
    elif kind < 0.64:
        for corner in ((slice(0, 2), slice(0, 2)), (slice(-2, None), slice(0, 2))):
            piece[corner] = 1
            piece[corner[0], -2:] = 1
    else:
        for _ in range(int(rng.integers(1, 7))):
            row, column = (int(rng.integers(side)) for side in shape)
            piece[row : row + 2, column : column + 2] = 1
    return piece


def _partition(inside: Flags, at: tuple[int, int], rng: np.random.Generator) -> Bytes:
    """(H, W) a thin wall that stands out from a cell into its room, and divides nothing."""
    drawn = np.zeros(inside.shape, np.uint8)
    row, column = at
    down, right = ((1, 0), (-1, 0), (0, 1), (0, -1))[int(rng.integers(4))]
    length = cells(rng.uniform(0.8, 2.6))
    cv2.line(drawn, (column, row), (column + right * length, row + down * length), 1, cells(rng.uniform(0.05, 0.2)))
    return drawn & inside
