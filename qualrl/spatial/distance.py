"""Distances to the nearest cell that is not free, and what follows from them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.thickness import disc_centres, local_thickness


def distance_within(free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) from each cell's centre to that of the nearest one that is not free, in cells; 0 where not free.

    Equal on every machine and in every run: OpenCV's square roots depend in their last bit on where in memory an
    image lies, but their squares are whole.
    """
    found = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    np.multiply(found, found, out=found)
    np.rint(found, out=found)
    return np.asarray(np.sqrt(found, out=found), np.float32)


def thickness_over(distance: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) radius of the largest free disc over each cell, from the distances to what is not free, in cells."""
    centres = disc_centres(distance)
    largest_first = centres[np.argsort(-distance.ravel()[centres], kind="stable")]
    height, width = distance.shape
    room = np.empty((height, width + 1), np.int16 if width < 2**15 else np.int32)
    return local_thickness(distance, largest_first, room)
