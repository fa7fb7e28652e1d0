"""Distances to the nearest cell that is not free, and what follows from them."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import both, in_bands
from qualrl.kernels.distances import MOST_STEPS, distances_in_rows, steps_in_columns
from qualrl.kernels.scratch import borrowed
from qualrl.kernels.thickness import disc_centres, local_thickness

Floats = NDArray[np.float32]


def distance_within(free: NDArray[np.bool_]) -> Floats:
    """(H, W) from each cell's centre to that of the nearest one that is not free, in cells; 0 where not free.

    Infinite where all cells are free.
    """
    if len(free) > MOST_STEPS:
        return distance_within(free.T).T  # no map has as many columns, too
    found = borrowed(free.shape, np.float32)
    steps = found.view(np.uint16)  # a row's steps wait where its distances will be
    in_bands(partial(steps_in_columns, np.ascontiguousarray(free), steps), free.shape[::-1])

    def rows(top: int, bottom: int) -> None:
        distances_in_rows(steps, found, np.empty((4, free.shape[1] + 1), np.int64), top, bottom)

    in_bands(rows, free.shape)
    return found


def thickness_over(distance: Floats) -> Floats:
    """(H, W) radius of the largest free disc over each cell, from the distances to what is not free, in cells."""
    centres = np.concatenate(in_bands(partial(disc_centres, distance), distance.shape))
    thickness = borrowed(distance.shape, np.float32)
    largest_first, unpainted = both(partial(_largest_first, distance, centres), partial(_free_in_words, distance))
    in_bands(partial(local_thickness, distance, largest_first, thickness, unpainted), distance.shape)
    return thickness


def _free_in_words(distance: Floats) -> NDArray[np.uint64]:
    """(H, W / 64 or one more) a bit for each cell, set where it is free, the lowest of a word for its first column."""
    bits = np.packbits(distance > 0, axis=1, bitorder="little")
    return np.pad(bits, ((0, 0), (0, -bits.shape[1] % 8))).view("<u8").astype(np.uint64, copy=False)


def _largest_first(distance: Floats, cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Cells (N,), flat indices, from far to near by distance (H, W), in their order where they are equally far."""
    square = np.rint(np.square(distance.ravel()[cells], dtype=np.float64))
    most = square.max(initial=0)
    nearness = (most - square).astype(np.uint16 if most < 2**16 else np.int64)  # few bits are sorted much faster
    return cells[np.argsort(nearness, kind="stable")]
