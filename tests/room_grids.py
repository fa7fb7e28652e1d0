"""Grids of square rooms with gaps of one cell in walls of one cell, as benchmarks for path planning use them.

Walls are the rows and columns at multiples of k.  As there, the first row and column are walls with gaps that lead
nowhere, and the map ends at its right and lower edge without a wall.
"""

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]


def room_grid(seed: int, n: int, k: int, share: float = 0.85) -> tuple[NDArray[np.bool_], set[Cell]]:
    """(free cells (n k, n k) of n x n rooms of k - 1 cells a side, the gaps between rooms); each with a chance."""
    draw = np.random.default_rng(seed)
    free = np.ones((n * k, n * k), np.bool_)
    free[::k] = free[:, ::k] = False
    gaps: set[Cell] = set()
    for line in range(n):
        for room in range(n):
            along = room * k + int(draw.integers(1, k))
            across = room * k + int(draw.integers(1, k))
            for gap in ((line * k, along), (across, line * k)):
                if draw.random() < share:
                    free[gap] = True
                    if line:
                        gaps.add(gap)
    return free, gaps


def rooms_between_walls(free: NDArray[np.bool_], k: int) -> dict[Cell, set[Cell]]:
    """By row and column of rooms: the free cells between the wall lines, one cell at a time."""
    rooms: dict[Cell, set[Cell]] = {}
    for row, column in np.argwhere(free).tolist():
        if row % k and column % k:
            rooms.setdefault((row // k, column // k), set()).add((row, column))
    return rooms
