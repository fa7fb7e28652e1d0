"""Doorways: where regions touch.

N: border nodes, a cell as one region's side of its contact with another region.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from qualrl.kernels import regions as kernels
from qualrl.spatial.region_map import Doorway

Cells = NDArray[np.int32]


def find_doorways(
    label: Cells, thickness: NDArray[np.float32], thing: Cells, resolution_m: float, pinch: float
) -> tuple[Doorway, ...]:
    """One doorway for each separate contact between two regions, in the order of their regions and position.

    label (H, W) regions; thickness (H, W) radius of the largest free disc over each cell, any unit;
    thing (H, W) number of the free-standing thing in each cell, -1 where none: it does not divide a contact.
    A doorway is open when the way through it is not thinner than ``pinch`` times the thinner region.
    """
    crossing, side_run, saddle = kernels.crossings(label, thickness)
    if not len(crossing):
        return ()
    ends = label.ravel()[crossing]
    swap = ends[:, 0] > ends[:, 1]
    for array in (crossing, side_run, ends):
        array[swap] = array[swap][:, ::-1]
    contact = _contacts(crossing, ends, thing, int(label.max()) + 1)
    widest = np.zeros(int(label.max()) + 1, np.float32)
    np.maximum.at(widest, label[label >= 0], thickness[label >= 0])
    order = np.lexsort((crossing[:, 0], contact))
    found = []
    for group in np.split(order, np.flatnonzero(np.diff(contact[order])) + 1):
        sides = [np.unique(crossing[group, side]) for side in (0, 1)]
        cost = [(len(sides[side]), int(side_run[group, side].sum())) for side in (0, 1)]
        row, column = np.divmod(sides[cost[1] < cost[0]], label.shape[1])
        pair = int(ends[group[0], 0]), int(ends[group[0], 1])
        is_open = bool(saddle[group].max() >= pinch * min(widest[pair[0]], widest[pair[1]]))
        cells = np.stack([row, column], axis=1).astype(np.int32)
        cells.setflags(write=False)
        found.append(Doorway("", pair, cells, _span(cells) * resolution_m, is_open))
    return _named(found)


def _contacts(crossing: Cells, ends: Cells, thing: Cells, regions: int) -> NDArray[np.int32]:
    """(E,) the contact that each crossing belongs to.

    Crossings of one pair of regions belong together when their cells are 8-adjacent or touch one thing.
    """
    height, width = thing.shape
    edges = len(crossing)
    pair = ends[:, 0].astype(np.int64) * regions + ends[:, 1]
    # Keys are places on a map with a margin, so that a neighbour's key never wraps round to the next row.
    stride = (height + 2) * (width + 2)
    row, column = np.divmod(np.concatenate([crossing[:, 0], crossing[:, 1]]).astype(np.int64), width)
    pairs = np.unique(pair, return_inverse=True)[1]
    place = (row + 1) * (width + 2) + column + 1
    key, node = np.unique(np.tile(pairs, 2) * stride + place, return_inverse=True)
    links = [(node[:edges], node[edges:])]
    for offset in (1, width + 1, width + 2, width + 3):
        at = np.minimum(np.searchsorted(key, key + offset), key.size - 1)
        near = np.flatnonzero(key[at] == key + offset)
        links.append((near, at[near]))
    padded = np.pad(thing, 1, constant_values=-1).ravel()
    for offset in (-width - 3, -width - 2, -width - 1, -1, 1, width + 1, width + 2, width + 3):
        touched = padded[key % stride + offset]
        near = np.flatnonzero(touched >= 0)
        _, first, group = np.unique(
            key[near] // stride * (int(thing.max()) + 2) + touched[near], return_index=True, return_inverse=True
        )
        links.append((near, near[first][group]))
    start, end = (np.concatenate(parts) for parts in zip(*links, strict=True))
    graph = coo_array((np.ones(start.size, np.bool_), (start, end)), shape=(key.size, key.size))
    piece: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return piece[node[:edges]]


def _span(cells: Cells) -> float:
    """Length in cells of the chord between a doorway's ends, each end's own cell counted in full."""
    away = cells - cells[0]
    first = cells[np.argmax((away**2).sum(axis=1))]
    return float(np.sqrt(((cells - first) ** 2).sum(axis=1).max())) + 1.0


def _named(found: list[Doorway]) -> tuple[Doorway, ...]:
    """Doorways in order, called "door 1" or, when open, "opening 1"."""
    from dataclasses import replace

    found.sort(key=lambda door: (door.pair, tuple(door.cells[len(door.cells) // 2])))
    count = {False: 0, True: 0}
    named = []
    for door in found:
        count[door.is_open] += 1
        named.append(replace(door, name=f"{'opening' if door.is_open else 'door'} {count[door.is_open]}"))
    return tuple(named)
