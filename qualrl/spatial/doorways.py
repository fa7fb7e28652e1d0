"""Doorways: where regions touch.

H, W: rows, columns.  E: steps between two regions, each with an end (a flat cell index) in either.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import linking
from qualrl.kernels import regions as kernels
from qualrl.spatial.region_map import Doorway, farthest_apart

Ints = NDArray[np.int32]


def find_doorways(
    label: Ints,
    distance: NDArray[np.float32],
    thing: NDArray[np.signedinteger[Any]],
    narrowest: NDArray[np.float32],
    resolution_m: float,
) -> tuple[Doorway, ...]:
    """One doorway for each separate contact between two regions, in the order of its regions and position.

    label (H, W) regions; distance (H, W) to the nearest cell that is not free; thing (H, W) number of the
    free-standing thing in each cell, -1 where none: it does not divide a contact; narrowest, by region: the
    distance from which on a way out of it is an opening and no door.
    """
    ends = kernels.crossings(label)
    if not len(ends):
        return ()
    pair = label.ravel()[ends]
    backwards = pair[:, 0] > pair[:, 1]
    ends[backwards], pair[backwards] = ends[backwards][:, ::-1], pair[backwards][:, ::-1]
    way = distance.ravel()[ends].min(axis=1)
    breadth = _breadth(label, ends)
    contact = _contacts(ends, pair, thing)
    count = int(contact.max()) + 1
    widest = np.zeros(count, np.float32)
    np.maximum.at(widest, contact, way)
    regions = np.zeros((count, 2), np.int32)
    regions[contact] = pair
    is_open = widest >= narrowest[regions].min(axis=1)
    cells = _narrower_side(ends, breadth, contact, label.size)
    return _named(
        [
            _doorway((int(a), int(b)), np.stack(np.divmod(side, label.shape[1]), axis=1), bool(wide), resolution_m)
            for (a, b), side, wide in zip(regions, cells, is_open, strict=True)
        ]
    )


def _narrower_side(ends: Ints, breadth: Ints, contact: Ints, size: int) -> list[Ints]:
    """The cells (flat indices) of each contact, on the side with fewer of them; if alike, the narrower one."""
    sides = []
    for side in (0, 1):
        owner, cell = np.divmod(np.unique(contact.astype(np.int64) * size + ends[:, side]), size)
        sides.append(np.split(cell, np.flatnonzero(np.diff(owner)) + 1))
    total = [np.bincount(contact, breadth[:, side]) for side in (0, 1)]
    return [
        second if (second.size, wide_b) < (first.size, wide_a) else first
        for first, second, wide_a, wide_b in zip(*sides, *total, strict=True)
    ]


def _doorway(pair: tuple[int, int], cells: Ints, is_open: bool, resolution_m: float) -> Doorway:
    """A doorway without a name."""
    cells = cells.astype(np.int32)
    cells.setflags(write=False)
    width = math.dist(*farthest_apart(cells)) + 1
    return Doorway("", pair, cells, width * resolution_m, is_open)


def _breadth(label: Ints, ends: Ints) -> Ints:
    """(E, 2) cells of the free run through each end, at a right angle to the step."""
    is_down = (ends[:, 0] - ends[:, 1]) % label.shape[1] == 0
    if label.shape[1] == 1:
        is_down[:] = True
    return kernels.run_lengths(label, ends.ravel(), ~is_down.repeat(2)).reshape(-1, 2)


def _contacts(ends: Ints, pair: Ints, thing: NDArray[np.signedinteger[Any]]) -> Ints:
    """(E,) the contact that each step belongs to.

    Steps between the same regions belong together when their ends are 8-adjacent or touch the same thing.
    """
    # A node is an end as seen by one pair of regions; its key holds both.  Places are counted on a map with
    # a margin, so that a neighbour's key never wraps round to the next row or pair.
    stride = thing.shape[1] + 2
    around = np.array([1, stride - 1, stride, stride + 1])
    margined = np.pad(thing, 1, constant_values=-1).ravel()
    row, column = np.divmod(ends.T.ravel().astype(np.int64), thing.shape[1])
    which = np.unique(pair[:, 0].astype(np.int64) * (int(pair.max()) + 1) + pair[:, 1], return_inverse=True)[1]
    key, node = np.unique(np.tile(which, 2) * margined.size + (row + 1) * stride + column + 1, return_inverse=True)
    links = [node.reshape(2, -1)]
    for offset in around:
        at = np.minimum(np.searchsorted(key, key + offset), key.size - 1)
        near = np.flatnonzero(key[at] == key + offset)
        links.append(np.stack([near, at[near]]))
    owner, place = np.divmod(key, margined.size)
    for offset in (*around, *-around):
        touched = margined[place + offset].astype(np.int64)
        near = np.flatnonzero(touched >= 0)
        # Things are further nodes, one for each pair of regions.
        links.append(np.stack([near, -1 - (owner[near] * (int(thing.max()) + 1) + touched[near])]))
    start, end = np.unique(np.concatenate(links, axis=1), return_inverse=True)[1].reshape(2, -1)
    piece: Ints = linking.pieces(start, end, int(max(start.max(), end.max())) + 1)
    return piece[start[: len(ends)]]


def _named(found: list[Doorway]) -> tuple[Doorway, ...]:
    """Doorways in their order, called "door 1" or, when open, "opening 1"."""
    found.sort(key=lambda door: (door.pair, tuple(door.cells[len(door.cells) // 2])))
    count = {"door": 0, "opening": 0}
    named = []
    for door in found:
        kind = "opening" if door.is_open else "door"
        count[kind] += 1
        named.append(replace(door, name=f"{kind} {count[kind]}"))
    return tuple(named)


def renumbered(doorways: Sequence[Doorway], rank: Sequence[int]) -> tuple[Doorway, ...]:
    """The same doorways between regions of other numbers (rank of each old one), named anew in their new order."""
    found = []
    for door in doorways:
        first, second = sorted(rank[region] for region in door.pair)
        found.append(replace(door, pair=(first, second)))
    return _named(found)
