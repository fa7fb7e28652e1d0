"""A plan as a robot's laser scanner would have mapped it.

H, W: rows, columns of the plan.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.scanning import scan
from qualrl.spatial.floor_plans.layout import CELL_M, cells

Flags = NDArray[np.bool_]
Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


class Scan(NamedTuple):
    """What is known after a tour."""

    free: Flags
    """(H, W)"""
    occupied: Flags
    """(H, W)"""


def scanned(
    free: Flags, wall: Flags, place: Ints, is_corridor: list[bool], rng: np.random.Generator, *, everywhere: bool
) -> Scan:
    """The map of a tour through a building: through all of it, or through its first part only.

    free, wall (H, W): what is so, wall with the furniture; place (H, W) number of the room or corridor of each cell.
    Windows let some rays out, some stretches of wall are never hit, rooms that the tour leaves out are seen
    through their doors, and a few cells stay unknown in between.
    """
    outer = cv2.dilate((place < 0).astype(np.uint8), np.ones((cells(0.5),) * 2, np.uint8)) > 0
    glass = np.zeros(place.shape, np.float32)
    if rng.random() < 0.6:
        glass[outer & (patches(place.shape, 1.2, rng) < rng.uniform(0.02, 0.35))] = rng.uniform(0.15, 0.8)
    missing = float(rng.choice([0, rng.uniform(0.02, 0.1), rng.uniform(0.1, 0.3)]))
    solid = wall & (patches(place.shape, 0.5, rng) >= missing) if rng.random() < 0.8 else wall
    reach = cells(rng.uniform(8, 25))
    rays = int(rng.choice([360, 720]))
    poses = _tour(free, place, is_corridor, rng, everywhere)
    seen, hit = scan(solid, glass, poses, reach, rays, rng.random(100_003).astype(np.float32))
    occupied = hit >= int(rng.choice([1, 1, 2]))
    if rng.random() < 0.7:
        occupied = cv2.dilate(occupied.astype(np.uint8), np.ones((2, 2), np.uint8)) > 0
    unknown = rng.random(place.shape) < rng.choice([0, 0.003, 0.02])
    return Scan((seen > 0) & ~occupied & ~unknown, occupied)


def patches(shape: tuple[int, ...], size_m: float, rng: np.random.Generator) -> Floats:
    """(H, W) numbers from 0 to 1, the same over squares of this side."""
    height, width = (side // cells(size_m) + 1 for side in shape)
    coarse = rng.random((height, width)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_NEAREST), np.float32)


def _tour(
    free: Flags, place: Ints, is_corridor: list[bool], rng: np.random.Generator, everywhere: bool
) -> NDArray[np.float64]:
    """(N, 2) rows and columns from which the robot looks around: more in large places, none in some rooms."""
    reached = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5) > cells(0.25)
    if not everywhere:
        longer = int(place.shape[1] >= place.shape[0])
        share = int(place.shape[longer] * rng.uniform(0.2, 0.8))
        reached[(slice(share, None), slice(None)) if longer == 0 else (slice(None), slice(share, None))] = False
    visited = rng.choice([0.3, 0.7, 1.0])
    poses: list[int] = []
    for number, corridor in enumerate(is_corridor):
        stands = np.flatnonzero((place == number) & reached)
        if stands.size and (corridor or rng.random() < visited):
            poses += rng.choice(stands, size=int(min(3 + stands.size * CELL_M**2 / 4, 40))).tolist()
    if len(poses) < 3:
        poses = rng.choice(np.flatnonzero(free), size=10).tolist()
    return np.stack(np.divmod(np.array(poses), place.shape[1]), axis=1) + 0.5
