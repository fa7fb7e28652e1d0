"""The gates of a map: each doorway twice, as seen from the regions on its two sides.

N gates, sorted by region; C cells of gates.  Cells are flat indices.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import routing
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.region_map import RegionMap

Ints = NDArray[np.int32]


def gates_of(regions: RegionMap) -> routing.Gates:
    """The gates of a map, each with the step through its doorway that lies nearest the middle."""
    width = regions.label.shape[1]
    found = []
    for number, door in enumerate(regions.doorways):
        crossings = np.array(crossings_of(regions, door), np.int64) @ np.array([width, 1])
        middle = np.array(door.midpoint)
        apart = np.abs(np.stack(np.divmod(crossings, width), axis=-1) - middle).sum(axis=(1, 2))
        step = crossings[apart.argmin()]
        for side, region in enumerate(door.pair):
            found.append((region, number, int(step[side]), np.unique(crossings[:, side])))
    found.sort(key=lambda gate: gate[:2])
    sides: dict[int, list[int]] = {}
    for at, (_, number, _, _) in enumerate(found):
        sides.setdefault(number, []).append(at)
    partner = np.zeros(len(found), np.int32)
    for one, other in sides.values():
        partner[[one, other]] = other, one
    region_of = np.array([region for region, _, _, _ in found], np.int32)
    first = np.searchsorted(region_of, np.arange(len(regions.regions) + 1)).astype(np.int64)
    row_length = np.diff(first)[region_of]
    cells, cell_first = _joined(cells for _, _, _, cells in found)
    return routing.Gates(
        first, np.array([cell for _, _, cell, _ in found], np.int32), region_of, partner,
        (np.cumsum(row_length) - row_length).astype(np.int64), cells, cell_first,
    )  # fmt: skip


def _joined(parts: Iterable[NDArray[np.int64]]) -> tuple[Ints, NDArray[np.int64]]:
    """All cells of all gates, and where each gate's begin."""
    held = [np.zeros(0, np.int64), *parts]
    return np.concatenate(held).astype(np.int32), np.cumsum([len(part) for part in held])


def boxes_of(gates: routing.Gates, width: int) -> Ints:
    """(4, N) first and last row, first and last column of each gate's cells."""
    if not len(gates.cell):
        return np.zeros((4, 0), np.int32)
    ends = np.stack(np.divmod(gates.cells, width))
    low = np.minimum.reduceat(ends, gates.cell_first[:-1], axis=1)
    high = np.maximum.reduceat(ends, gates.cell_first[:-1], axis=1)
    return np.stack([low[0], high[0], low[1], high[1]])


def apart(one: Ints, other: Ints) -> Ints:
    """Steps from box to box as if nothing stood between; (4, ...) each, broadcast."""
    down = np.maximum(np.maximum(other[0] - one[1], one[0] - other[1]), 0)
    across = np.maximum(np.maximum(other[2] - one[3], one[2] - other[3]), 0)
    steps: Ints = down + across
    return steps


def straight(gates: routing.Gates, label: Ints) -> NDArray[np.bool_]:
    """(N,) whether a gate's cells are a row or a staircase without gaps on its own side.

    Then the straight steps between any two of them lead over its own side, and going through the doorway and back by
    it is never shorter than staying.
    """
    owner = np.repeat(np.arange(len(gates.cell)), np.diff(gates.cell_first))
    row, column = np.divmod(gates.cells, label.shape[1])
    found = np.zeros(len(gates.cell), np.bool_)
    for sign in (1, -1):
        order = np.lexsort((sign * column, row, owner))
        r, c, own = row[order], column[order], owner[order]
        down, across = np.diff(r), sign * np.diff(c)
        beside = (down + across == 1) & (down * across == 0)
        side = gates.region[own[1:]]
        stair = (down == 1) & (across == 1) & ((label[r[:-1], c[1:]] == side) | (label[r[1:], c[:-1]] == side))
        gap = (own[1:] == own[:-1]) & ~beside & ~stair
        found |= np.bincount(own[1:][gap], minlength=len(found)) == 0
    return found
