"""Small worlds for the tests: maps drawn as text, and hypothesis strategies for random ones."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from qualrl.spatial.occupancy_grid import OccupancyGrid

PUZZLE = """
#############
#1.........2#
#.####8####.#
#.#6.....7#.#
#.#.#####.#.#
#.#.#...#.#.#
#.#.#.G.#.#.#
#.#.#...#.#.#
#.#.##9##.#.#
#.#5.....4#.#
#.#########.#
#S.........3#
#############
"""

TWO_ROOMS = """
###################
#........#........#
#........#........#
#........#........#
#.................#
#........#........#
#........#........#
#........#........#
###################
"""


def grid_of(text: str, resolution_m: float = 1.0) -> OccupancyGrid:
    """A map from text: '#' is wall, everything else free."""
    rows = text.strip().splitlines()
    return OccupancyGrid.from_free(np.array([[c != "#" for c in row] for row in rows]), resolution_m)


@st.composite
def free_masks(draw, side: int = 8, connected: bool = True):
    """Random small maps; connected ones keep the 4-connected part around one of their cells."""
    height, width = draw(st.integers(1, side)), draw(st.integers(2, side))
    bits = draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    free = np.array(bits).reshape(height, width)
    assume(free.any())
    return part_around(free, tuple(np.argwhere(free)[0])) if connected else free


def part_around(free: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
    """The 4-connected part of the free cells that a cell lies in."""
    part = np.zeros_like(free)
    stack = [cell]
    while stack:
        row, column = stack.pop()
        if 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and free[row, column] and not part[row, column]:
            part[row, column] = True
            stack += [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
    return part
