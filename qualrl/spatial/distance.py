"""Distances to the nearest cell that is not free, and what follows from them."""

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.thickness import disc_centres, local_thickness, round_squares


def distance_within(free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) from each cell's centre to that of the nearest one that is not free, in cells; 0 where not free.

    Equal on every machine and in every run: OpenCV's square roots depend in their last bit on where in memory an
    image lies, but their squares are whole.
    """
    found = np.asarray(
        cv2.distanceTransform(np.asarray(free, np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32
    )
    in_bands(partial(round_squares, found), found.shape)
    return found


def thickness_over(distance: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) radius of the largest free disc over each cell, from the distances to what is not free, in cells."""
    centres = np.concatenate(in_bands(partial(disc_centres, distance), distance.shape))
    largest_first = centres[np.argsort(-distance.ravel()[centres], kind="stable")]
    bits = np.packbits(distance > 0, axis=1, bitorder="little")
    unpainted = np.pad(bits, ((0, 0), (0, -bits.shape[1] % 8))).view("<u8").astype(np.uint64, copy=False)
    thickness = np.zeros(distance.shape, np.float32)
    in_bands(partial(local_thickness, distance, largest_first, thickness, unpainted), distance.shape)
    return thickness
