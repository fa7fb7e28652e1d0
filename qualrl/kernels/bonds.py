"""Which places touch, as linked lists, so that merging two places links their lists.

Z: places.  E: contacts between two of them.  C: columns of what is known of a contact.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Bonds(NamedTuple):
    """Linked lists of half-edges: 2e and 2e+1 hold contact e as seen from its two ends."""

    first: Ints
    """(Z,) first half-edge of each place, -1 for none."""
    last: Ints
    """(Z,)"""
    following: Ints
    """(2E,) next half-edge of the same place, -1 at the end."""
    target: Ints
    """(2E,) the place at the other end, or one that has been merged into it."""
    sums: Floats
    """(2E, C) what is known of each: the last column is the way, of which the widest counts, all others add up."""


def linked(pair: Ints, sums: Floats, places: int) -> Bonds:
    """Contacts (E, 2) with what is known of them (E, C) as a list for each place."""
    end = pair.ravel()
    order = np.argsort(end, kind="stable").astype(np.int32)[::-1]
    following = np.full(end.size, -1, np.int32)
    same = end[order[1:]] == end[order[:-1]]
    following[order[:-1][same]] = order[1:][same]
    first, last = np.full(places, -1, np.int32), np.full(places, -1, np.int32)
    first[end[order[::-1]]] = order[::-1]
    last[end[order]] = order
    return Bonds(first, last, following, np.ascontiguousarray(pair[:, ::-1]).ravel(), sums.repeat(2, axis=0))


@compiled_part
def find(parent: Ints, item: int) -> int:
    """The root of an item's set; the paths passed are halved on the way."""
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item


@compiled_part
def tidy(place: int, parent: Ints, bonds: Bonds, seen: Ints) -> None:
    """Leave a place one half-edge for each neighbour, and none to itself.  seen (Z,) is scratch, all -1."""
    half, kept, way = bonds.first[place], -1, bonds.sums.shape[1] - 1
    bonds.first[place] = -1
    while half >= 0:
        after = bonds.following[half]
        other = find(parent, bonds.target[half])
        before = seen[other]
        if other != place and before >= 0:
            for column in range(way):
                bonds.sums[before, column] += bonds.sums[half, column]
            bonds.sums[before, way] = max(bonds.sums[before, way], bonds.sums[half, way])
        elif other != place:
            bonds.target[half] = other
            seen[other] = half
            if kept < 0:
                bonds.first[place] = half
            else:
                bonds.following[kept] = half
            kept = half
        half = after
    bonds.last[place] = kept
    if kept >= 0:
        bonds.following[kept] = -1
    half = bonds.first[place]
    while half >= 0:
        seen[bonds.target[half]] = -1
        half = bonds.following[half]


@compiled_part
def append(host: int, guest: int, bonds: Bonds) -> None:
    """Link the guest's list to the host's."""
    if bonds.first[guest] < 0:
        return
    if bonds.last[host] < 0:
        bonds.first[host] = bonds.first[guest]
    else:
        bonds.following[bonds.last[host]] = bonds.first[guest]
    bonds.last[host] = bonds.last[guest]
