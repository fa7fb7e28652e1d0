"""How thick free space is at each cell: the radius of the largest free disc that covers it.

H, W: rows, columns.  Distances and radii are in cells.  Rows of cells are also kept as bits, 64 columns to a word.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.instructions import trailing_zeros
from qualrl.kernels.jit import compiled_bare

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Words = NDArray[np.uint64]

UPHILL = np.float32(0.9)
"""Off the ridges distance grows by 1 a cell, and by at least cos(22.5 deg) toward one of eight neighbours."""
ALL = np.uint64(2**64 - 1)


def local_thickness(
    distance: Floats, centres: Ints, thickness: Floats, unpainted: Words, top: int, bottom: int
) -> None:
    """Write to thickness the radius of the largest free disc over each cell, in the rows from top to bottom.

    distance (H, W): from each cell to the nearest cell that is not free, 0 where not free.
    centres: flat indices of the discs' centres, the largest disc first (see ``disc_centres``).
    thickness (H, W): 0 where no disc comes.  unpainted (H, W / 64 or one more): a bit for each free cell that no disc
    has reached, the lowest of a word for its first column.
    Discs are painted from large to small and each cell once; rows that are painted already cost a word or two.
    """
    half = np.empty(len(distance), np.int64)
    thickness[top:bottom] = 0
    _paint(distance.ravel(), centres, thickness, unpainted, top, bottom, half)


@compiled_bare
def _paint(
    flat: Floats, centres: Ints, thickness: Floats, unpainted: Words, top: int, bottom: int, half: NDArray[np.int64]
) -> None:
    """Half (H,): half a disc's width, so many rows from its centre; scratch."""
    height, width = thickness.shape
    radius = np.float32(0)
    reach = 0
    for centre in centres:
        row, column = centre // width, centre % width
        if flat[centre] != radius:
            radius = flat[centre]
            reach = min(int(np.ceil(radius)), height) - 1
            for off in range(reach + 1):
                chord = np.sqrt(max(radius * radius - off * off, 0.0))
                half[off] = max(int(np.ceil(chord - 1e-3)) - 1, 0)
        for r in range(max(row - reach, top), min(row + reach + 1, bottom)):
            first = max(column - half[abs(r - row)], 0)
            last = min(column + half[abs(r - row)], width - 1)
            for at in range(first >> 6, (last >> 6) + 1):
                new = unpainted[r, at]
                if at == first >> 6:
                    new &= ALL << np.uint64(first & 63)
                if at == last >> 6:
                    new &= ALL >> np.uint64(63 - (last & 63))
                unpainted[r, at] ^= new
                while new:
                    thickness[r, 64 * at + np.int64(trailing_zeros(new))] = radius
                    new &= new - np.uint64(1)


def disc_centres(distance: Floats, top: int, bottom: int) -> Ints:
    """Flat indices of the cells on the ridges of the distance (H, W), whose discs lie in no other, from row top to
    bottom.
    """
    centres = np.empty((bottom - top) * distance.shape[1], np.int32)
    return centres[: _write_centres(distance, top, bottom, centres)].copy()


@compiled_bare
def _write_centres(distance: Floats, top: int, bottom: int, centres: Ints) -> int:
    height, width = distance.shape
    count = 0
    for row in range(top, bottom):
        above, below = distance[max(row - 1, 0)], distance[min(row + 1, height - 1)]
        beside = distance[row]
        for column in range(width):
            radius = beside[column]
            if radius <= 0:
                continue
            # At the map's edge a cell stands for its missing neighbour: it is not farther than itself.
            west, east = max(column - 1, 0), min(column + 1, width - 1)
            straight, slanted = radius + UPHILL, radius + UPHILL * np.float32(1.41421)
            nearest = max(max(above[column], below[column]), max(beside[west], beside[east]))
            if nearest >= straight:
                continue
            if max(max(above[west], above[east]), max(below[west], below[east])) < slanted:
                centres[count] = row * width + column
                count += 1
    return count
