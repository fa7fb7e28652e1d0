"""Which places of a layout have a door between them, and where.

H, W: rows, columns of the layout.  P: places.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import DisjointSet

from qualrl.spatial.floor_plans.layout import CELL_M, Layout, cells

Pair = tuple[int, int]


class Side(NamedTuple):
    """A straight stretch where two places meet."""

    upright: bool
    """True when the wall runs from top to bottom."""
    line: int
    """The column (row, if not upright) before the wall."""
    start: int
    end: int
    """First row (column) along the wall, and the one behind the last."""


class Door(NamedTuple):
    """An opening in a wall."""

    pair: Pair
    """The two places, the smaller first."""
    middle: tuple[float, float]
    """Row and column, in cells."""
    width_m: float
    upright: bool
    """True when its wall runs from top to bottom."""


def random_doors(layout: Layout, wall_m: float, crowded: bool) -> tuple[list[Door], NDArray[np.bool_]]:
    """Doors between places, and (H, W) the cells of the walls that they open.

    Nearly all places can be reached; there are few ways round.  crowded: see ``random_floor_plan``.
    """
    rng = layout.rng
    sides = _sides(layout.place)
    reached: DisjointSet[int] = DisjointSet(range(len(layout.is_corridor)))
    pairs = [list(sides)[at] for at in rng.permutation(len(sides))]
    pairs.sort(key=lambda pair: -_corridors(layout, pair))
    cubicles = bool(rng.random() < 0.12)
    doors: list[Door] = []
    opened = np.zeros(layout.place.shape, np.bool_)
    for pair in pairs:
        side = max(sides[pair], key=lambda side: side.end - side.start)
        most_m = (side.end - side.start) * CELL_M - wall_m
        ways_round = 0.12 if _corridors(layout, pair) else 0.05
        if most_m < 0.85 or rng.random() > (ways_round if reached.connected(*pair) else 0.97):
            continue
        if rng.random() < (0.4 if crowded else 0.15) and _is_mouth(layout, pair, side):
            doors.append(_mouth(pair, side, wall_m, opened))
            reached.merge(*pair)
            continue
        for _ in range(_openings(layout, pair, most_m, crowded)):
            width_m = _width_m(layout, pair, most_m, cubicles)
            doors.append(_door(rng, pair, side, width_m, wall_m, opened))
        reached.merge(*pair)
    return doors, opened


def _openings(layout: Layout, pair: Pair, most_m: float, crowded: bool) -> int:
    """How many doors a side has: mostly one; a long side along a corridor may be hardly more than a row of them."""
    rng = layout.rng
    if crowded and _corridors(layout, pair) == 1 and most_m > 6 and rng.random() < 0.12:
        return int(most_m / rng.uniform(2.5, 4.5))
    return 1 + int(rng.random() < 0.12 and most_m > 5)


def _corridors(layout: Layout, pair: Pair) -> int:
    return sum(layout.is_corridor[number] for number in pair)


def _sides(place: NDArray[np.int32]) -> dict[Pair, list[Side]]:
    """Where each two places meet."""
    found: dict[Pair, list[Side]] = {}
    for upright, image in ((True, place), (False, place.T)):
        before, after = image[:, :-1], image[:, 1:]
        meets = (before != after) & (before >= 0) & (after >= 0)
        for line in np.flatnonzero(meets.any(axis=0)):
            rows = np.flatnonzero(meets[:, line])
            first, second = before[rows, line], after[rows, line]
            breaks = (np.diff(rows) > 1) | (np.diff(first) != 0) | (np.diff(second) != 0)
            for part in np.split(np.arange(rows.size), np.flatnonzero(breaks) + 1):
                a, b = sorted((int(first[part[0]]), int(second[part[0]])))
                side = Side(upright, int(line), int(rows[part[0]]), int(rows[part[-1]]) + 1)
                found.setdefault((a, b), []).append(side)
    return found


def _width_m(layout: Layout, pair: Pair, most_m: float, cubicles: bool) -> float:
    """The width of a door: now and then a double one, or an opening nearly as wide as the room."""
    rng = layout.rng
    if _corridors(layout, pair) == 2:
        width_m = max(most_m * rng.uniform(0.3, 0.6), 0.8)
    elif cubicles and rng.random() < 0.8:
        width_m = min(most_m * rng.uniform(0.4, 0.75), 3.0)
    else:
        usual = rng.random()
        if usual < 0.82:
            width_m = rng.uniform(0.7, 1.1)
        elif usual < 0.94:
            width_m = rng.uniform(1.1, 2.0)
        else:
            width_m = min(rng.uniform(1.5, 4.0), 0.75 * most_m)
    return float(min(width_m, most_m - CELL_M))


def _is_mouth(layout: Layout, pair: Pair, side: Side) -> bool:
    """Whether a side is the end of a corridor at a room that is much wider."""
    if _corridors(layout, pair) != 1 or (side.end - side.start) * CELL_M > 4:
        return False
    room = pair[0] if layout.is_corridor[pair[1]] else pair[1]
    along = np.flatnonzero((layout.place == room).any(axis=1 if side.upright else 0))
    return along.size > 1.8 * (side.end - side.start)


def _mouth(pair: Pair, side: Side, wall_m: float, opened: NDArray[np.bool_]) -> Door:
    """An opening as wide as the side, walls beside it excepted; its cells are added to the opened ones."""
    half = cells(wall_m / 2)
    return _opened(pair, side, (side.start + half, side.end - half), wall_m, opened)


def _opened(pair: Pair, side: Side, stretch: tuple[int, int], wall_m: float, opened: NDArray[np.bool_]) -> Door:
    """The door that a stretch of a side is, once its cells are added to the opened ones."""
    deep, (start, end) = cells(wall_m) // 2 + 2, stretch
    (opened if side.upright else opened.T)[start:end, max(side.line + 1 - deep, 0) : side.line + 1 + deep] = True
    row, column = (start + end - 1) / 2, side.line + 0.5
    return Door(pair, (row, column) if side.upright else (column, row), (end - start) * CELL_M, side.upright)


def _door(
    rng: np.random.Generator, pair: Pair, side: Side, width_m: float, wall_m: float, opened: NDArray[np.bool_]
) -> Door:
    """A door of some width anywhere in a side, as often in its corners; its cells are added to the opened ones."""
    spare_m = (side.end - side.start) * CELL_M - wall_m - width_m
    start = side.start + cells(float(rng.choice([rng.uniform(0, 1), 0.06, 0.94])) * spare_m + wall_m / 2)
    end = min(start + cells(width_m), side.end - 1)
    return _opened(pair, side, (start, end), wall_m, opened)
