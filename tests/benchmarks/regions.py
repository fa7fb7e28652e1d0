"""How right regions are, and how steady: on plans generated here, and on maps with true regions in folders.

    python -m tests.benchmarks.regions [--plans 60] [FOLDER ...]

A folder holds NAME.yaml, a ROS map, and NAME.regions.png, an image of 8 or 16 bits with a number for each true region
(0 = none).  Over the free cells: F1 of regions matched one to one with more than half in common (intersection over
union), the adjusted Rand index, the best intersection over union of each true region, and how far the number of regions
is off, as a share.  True and found regions of up to 100 cells do not count.

Then how far the regions agree (adjusted Rand index) with those of the same map turned, mirrored, drawn with cells half
or twice as large, or with 1 % of its cells black or white, and the share of cells whose region keeps its name; and
seconds and memory.
"""

import argparse
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import qualrl
from qualrl.spatial.floor_plans import STYLES, random_floor_plan
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests.oracles_regions import adjusted_rand_index

FIRST_SEED = 0
"""Training starts from seeds a million later."""
LEAST_CELLS = 101

Ints = NDArray[np.int32]
Case = tuple[str, OccupancyGrid, Ints]


def generated(plans: int, style: str) -> Iterator[Case]:
    """Plans of a style, with the number of each cell's place from 1."""
    for seed in range(FIRST_SEED, FIRST_SEED + plans):
        plan = random_floor_plan(seed, style=style)
        yield f"seed {seed}", plan.grid, plan.place + 1


def in_folder(folder: Path) -> Iterator[Case]:
    """The maps of a folder with their true regions."""
    for picture in sorted(folder.glob("*.regions.png")):
        name = picture.name.removesuffix(".regions.png")
        truth = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED).astype(np.int32)
        yield name, qualrl.read_map(folder / f"{name}.yaml"), truth


def scores(found: Ints, truth: Ints, free: NDArray[np.bool_]) -> list[float]:
    """F1, adjusted Rand index, intersection over union, error of the number of regions."""
    one, other = _without_small(np.where(free, found, 0)), _without_small(np.where(free, truth, 0))
    table = np.zeros((one.max() + 1, other.max() + 1))
    np.add.at(table, (one[free], other[free]), 1)
    both = table[1:, 1:]
    union = table[1:].sum(axis=1)[:, None] + table[:, 1:].sum(axis=0)[None] - both
    share = both / np.maximum(union, 1)
    counts = np.array(share.shape)
    counted = free & (truth > 0)
    return [
        2 * float((share > 0.5).sum()) / max(counts.sum(), 1),
        adjusted_rand_index(other[counted], one[counted]),
        float(share.max(axis=0, initial=0).mean()),
        abs(int(counts[0] - counts[1])) / max(int(counts[1]), 1),
    ]


def _without_small(label: Ints) -> Ints:
    number, cells = np.unique(label, return_counts=True)
    stays = (number != 0) & (cells >= LEAST_CELLS)
    index = np.where(stays, np.cumsum(stays), 0)
    return index[np.searchsorted(number, label)].astype(np.int32)


def changed(grid: OccupancyGrid) -> Iterator[tuple[str, OccupancyGrid, Any]]:
    """The map changed, and what takes its label image back to the cells of the map."""
    free, occupied, cell_m = grid.free, grid.occupied, grid.resolution_m

    def made(change: Any, cell_m: float = cell_m) -> OccupancyGrid:
        return OccupancyGrid(np.ascontiguousarray(change(free)), np.ascontiguousarray(change(occupied)), cell_m)

    yield "turned 90", made(np.rot90), lambda label: np.rot90(label, -1)
    yield "mirrored", made(np.fliplr), np.fliplr
    yield "upside down", made(np.flipud), np.flipud
    yield "cells twice as large", made(lambda image: image[::2, ::2], 2 * cell_m), _twice(free.shape)
    double = made(lambda image: image.repeat(2, 0).repeat(2, 1), cell_m / 2)
    yield "cells half as large", double, lambda label: label[::2, ::2]
    rng = np.random.default_rng(0)
    hit, white = rng.random(free.shape) < 0.01, rng.random(free.shape) < 0.5
    noisy = OccupancyGrid((free & ~hit) | (hit & white), (occupied & ~hit) | (hit & ~white), cell_m)
    yield "1 % noise", noisy, lambda label: label


def _twice(shape: tuple[int, ...]) -> Any:
    return lambda label: label.repeat(2, 0).repeat(2, 1)[: shape[0], : shape[1]]


def steadiness(grid: OccupancyGrid) -> dict[str, tuple[float, float]]:
    """By change, over the cells free in both: how far the changed map's regions agree, the share that keep a name."""
    regions = qualrl.segment(grid)
    first = regions.label_image()
    found = {}
    for name, other, back in changed(grid):
        now = qualrl.segment(other)
        label = back(now.label_image())
        both = (first > 0) & (label > 0)
        one, two = (np.array(seen.region_names) for seen in (regions, now))
        kept = float((one[first[both] - 1] == two[label[both] - 1]).mean())
        found[name] = adjusted_rand_index(first[both], label[both]), kept
    return found


def report(title: str, cases: list[Case]) -> None:
    """Print the scores of each map if there are few, the mean, and the middle half."""
    rows, agreed, seconds = [], [], []
    for name, grid, truth in cases:
        start = time.perf_counter()
        regions = qualrl.segment(grid)
        seconds.append(time.perf_counter() - start)
        rows.append(scores(regions.label_image(), truth, grid.free))
        agreed.append(steadiness(grid))
        if len(cases) < 20:
            print(f"  {name:22s}" + " ".join(f"{value:.3f}" for value in rows[-1]))
    table = np.array(rows)
    spread = np.quantile(table, [0.25, 0.75], axis=0)
    print(f"{title} ({len(cases)} maps): mean, and its middle half")
    for column, name in enumerate(("F1", "ARI", "IoU", "count error")):
        print(f"  {name:22s}{table[:, column].mean():.3f}   {spread[0, column]:.3f} to {spread[1, column]:.3f}")
    for name in agreed[0]:
        values, kept = np.array([row[name] for row in agreed]).T
        low, high = np.quantile(values, [0.25, 0.75])
        print(f"  {name:22s}{values.mean():.3f}   {low:.3f} to {high:.3f}   names {kept.mean():.3f}")
    print(f"  {'seconds':22s}{np.mean(seconds):.3f}   at most {max(seconds):.3f}", flush=True)


def memory(file: Path) -> float:
    """Bytes for each cell that segmenting a map takes at its peak, in a process of its own, the map itself left out."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_memory, file).result()


def _memory(file: Path) -> float:
    qualrl.segment(random_floor_plan(0).grid)  # compiles
    grid = qualrl.read_map(file)
    before = _peak()
    qualrl.segment(grid)
    return (_peak() - before) / grid.free.size


def _peak() -> int:
    """Most bytes that this process ever had; Linux only (``getrusage`` counts what its parent had too)."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--plans", type=int, default=60)
    chosen = parser.parse_args()
    qualrl.segment(random_floor_plan(0).grid)  # compiles
    if not chosen.folders:
        for style in STYLES:
            report(style, list(generated(chosen.plans, style)))
    for folder in chosen.folders:
        cases = list(in_folder(folder))
        report(folder.name, cases)
        name, grid, _ = max(cases, key=lambda case: case[1].free.size)
        used = memory(folder / f"{name}.yaml")
        print(f"  {name}: {grid.shape[0]} x {grid.shape[1]} cells, {used:.1f} bytes a cell")


if __name__ == "__main__":
    main()
