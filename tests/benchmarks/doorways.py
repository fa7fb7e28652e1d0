"""Doorways found on maps with true regions: precision, recall and F1 within half a metre.

    python -m tests.benchmarks.doorways FOLDER

The folder holds NAME.yaml, NAME.png and NAME.regions.png: 16 bit, in the map's size, 0 = no region, else its number.
True regions may be apart by a few cells of 0 in a doorway; those go to the nearest region first.  A true doorway is an
8-connected row of cells at which the same two regions touch (4-connected), at least LEAST_M long: where three regions
meet, corners touch too.  Found and true doorways are matched one to one, each pair at most WITHIN_M apart, middle to
middle.  The second score takes ``find_doorways`` alone, on the true regions: what it can reach.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

import qualrl
from qualrl.spatial.doorways import find_doorways
from qualrl.spatial.region_map import Doorway

WITHIN_M = 0.5
LEAST_M = 0.3
BAND_M = 0.5
"""True regions are at most this far apart in a doorway."""

Points = NDArray[np.float64]
Labels = NDArray[np.int32]


def grown(truth: Labels, free: NDArray[np.bool_], reach: int) -> Labels:
    """(H, W) true regions (-1 = none) with the free cells of 0 nearby, each step one cell further."""
    label = np.where(free & (truth > 0), truth - 1, -1).astype(np.int32)
    for _ in range(reach):
        wide = np.pad(label, 1, constant_values=-1)
        beside = np.max([wide[:-2, 1:-1], wide[2:, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:]], axis=0)
        label = np.where(free & (label < 0), beside, label)
    return label


def true_doorways(label: Labels, resolution_m: float) -> Points:
    """(N, 2) row and column of the middle of each contact."""
    rows = {}
    for down, right in ((1, 0), (0, 1)):
        here = label[: label.shape[0] - down, : label.shape[1] - right]
        there = label[down:, right:]
        for row, column in np.argwhere((here != there) & (here >= 0) & (there >= 0)):
            a, b = int(here[row, column]), int(there[row, column])
            cells = rows.setdefault((min(a, b), max(a, b)), np.zeros(label.shape, np.bool_))
            cells[row, column] = cells[row + down, column + right] = True
    middles = []
    for cells in rows.values():
        contact, _ = ndimage.label(cells, np.ones((3, 3)))
        for box in ndimage.find_objects(contact):
            if max(side.stop - side.start for side in box) * resolution_m >= LEAST_M:
                middles.append([(side.start + side.stop - 1) / 2 for side in box])
    return np.array(middles).reshape(-1, 2)


def on_true_regions(label: Labels, resolution_m: float) -> Sequence[Doorway]:
    """What ``find_doorways`` makes of true regions; nothing is furniture and nothing an opening."""
    distance = cv2.distanceTransform(np.pad(label >= 0, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    nothing, wide = np.full_like(label, -1), np.full(int(label.max()) + 1, np.inf, np.float32)
    return find_doorways(label, distance[1:-1, 1:-1], nothing, wide, resolution_m)


def matched(found: Sequence[Doorway], true: Points, within: float) -> int:
    """How many can be matched one to one, none farther apart than ``within`` cells."""
    middles = np.array([door.midpoint for door in found], float).reshape(-1, 2)
    near = np.linalg.norm(middles[:, None] - true[None], axis=2) <= within
    return int(near[linear_sum_assignment(~near)].sum())


def scores(counts: NDArray[np.int64]) -> str:
    """counts: found, true, matched."""
    found, true, both = (int(count) for count in counts)
    parts = both / max(found, 1), both / max(true, 1), 2 * both / max(found + true, 1)
    return f"{found:5d} found {true:5d} true   " + " ".join(f"{part:6.3f}" for part in parts)


def main(folder: Path) -> None:
    """Print the scores of each map and of all together."""
    total = np.zeros((2, 3), np.int64)
    print(f"{'map':20s} {'':24s}   precision, recall, F1; then the same on the true regions")
    for picture in sorted(folder.glob("*.regions.png")):
        name = picture.name.removesuffix(".regions.png")
        grid = qualrl.read_map(folder / f"{name}.yaml")
        image = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED).astype(np.int32)
        label = grown(image, grid.free, round(BAND_M / grid.resolution_m))
        true = true_doorways(label, grid.resolution_m)
        rows = []
        for found in (qualrl.segment(grid).doorways, on_true_regions(label, grid.resolution_m)):
            rows.append([len(found), len(true), matched(found, true, WITHIN_M / grid.resolution_m)])
        total += rows
        print(f"{name:20s} {scores(np.array(rows[0]))}   | {scores(np.array(rows[1]))}")
    print(f"{'all':20s} {scores(total[0])}   | {scores(total[1])}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
