"""From a map's image to its hybrid MDP: seconds, memory, and how the cost of a cell grows with the map.

    python -m tests.benchmarks.maps [--largest 10000]

Squares of 500 x 500 cells of 0.05 m, each with a generated floor plan (furniture, clutter, scans) as far as it fits.
Each size in a process of its own, all loops compiled before: wall and CPU seconds of the quickest of 3 rounds (1 for
more than 4000), and the peak of its memory.  "segment" is a part of the whole, which reads a PNG and builds a model.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

import qualrl
from qualrl.spatial.floor_plans import random_floor_plan
from tests.benchmarks.effort import Effort
from tests.benchmarks.processes import apart, peak_mb
from tests.benchmarks.table import Row, at_most, bounded

SIDES = (500, 1000, 2000, 4000, 8000, 10000)
TILE = 500
PLANS = 40
SECONDS = {1000: 0.3, 4000: 4.0}
"""Wall seconds that maps of these sides may take."""
FLAT = 1.1
"""An exponent up to this counts as a flat cost a cell: caches do not reach as far on larger maps."""
MEGABYTES = {4000: 1500.0, 10000: 12000.0}


def image(side: int) -> NDArray[np.uint8]:
    """(side, side) grey values as a SLAM writes them."""
    tiles = []
    for seed in range(min(PLANS, (side // TILE) ** 2)):
        grid = random_floor_plan(seed).grid
        pixels = np.where(grid.free, 254, np.where(grid.occupied, 0, 205)).astype(np.uint8)[:TILE, :TILE]
        rows, columns = (TILE - length for length in pixels.shape)
        tiles.append(np.pad(pixels, ((0, rows), (0, columns)), constant_values=205))
    across = side // TILE
    rows_of_tiles = [[tiles[(row * across + column) % len(tiles)] for column in range(across)] for row in range(across)]
    return np.block(rows_of_tiles)


class Measured(NamedTuple):
    """What one process measures on one map."""

    regions: int
    whole: list[float]
    """Wall seconds of each round from image to model."""
    segment: list[float]
    """Of which for the regions."""
    cpu: list[float]
    mb: float


def measured(path: Path, rounds: int) -> Measured:
    """Read an image, find its regions and build a model, so many times, all loops loaded before."""
    qualrl.segment(random_floor_plan(0).grid)
    whole, segment, cpu = [], [], []
    for _ in range(rounds):
        begun, cpu_begun = time.perf_counter(), time.process_time()
        grid = qualrl.read_map(path)
        read = time.perf_counter()
        regions = qualrl.segment(grid)
        segment.append(time.perf_counter() - read)
        qualrl.build(regions, regions.regions[0].centre)
        whole.append(time.perf_counter() - begun)
        cpu.append(time.process_time() - cpu_begun)
    return Measured(len(regions.regions), whole, segment, cpu, peak_mb())


def alone(side: int, rounds: int) -> Measured:
    """What a process of its own measures on a map of that side."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.png"
        cv2.imwrite(str(path), image(side))
        return apart(measured, path, rounds)


def exponent(sides: Sequence[int], seconds: Sequence[float]) -> float:
    """Seconds grow as cells to the power of this."""
    return float(np.polyfit(np.log(np.square(sides)), np.log(seconds), 1)[0])


def rows(effort: Effort) -> Iterator[Row]:
    """Target 4's rows."""
    sides = (500, 1000, 2000, 4000) if effort.quick else (500, 1000, 2000, 4000, 10000)
    alone(sides[0], 1)  # the first compiles
    cpu = []
    for side in sides:
        found = alone(side, 1 if side > 4000 else effort.rounds(3, 2))
        cpu.append(float(np.median(found.cpu)))
        what = f"image to model, {side} x {side} cells"
        if side in SECONDS:
            row = bounded(4, what, "wall s", found.whole, SECONDS[side])
            yield replace(row, ours=f"{row.ours}, {np.median(found.cpu):.2f} CPU s")
        if side in MEGABYTES:
            yield bounded(4, f"{what}, peak", "MB", [found.mb], MEGABYTES[side])
    powers = [exponent(sides, cpu)]
    yield Row(
        4, f"growth of CPU s, {sides[0]} to {sides[-1]} a side, {len(sides)} sizes", f"power {powers[0]:.2f}",
        "flat cost a cell: power 1", powers, at_most(FLAT),
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=4000)
    sides = [side for side in SIDES if side <= parser.parse_args().largest]
    print(f"{'side':>6s}{'regions':>9s}{'whole s':>9s}{'segment s':>11s}{'CPU s':>8s}{'MB':>7s}{'us a cell':>11s}")
    alone(sides[0], 1)  # the first compiles
    quickest = []
    for side in sides:
        found = alone(side, 3 if side <= 4000 else 1)
        whole = min(found.whole)
        quickest.append(whole)
        print(
            f"{side:6d}{found.regions:9d}{whole:9.2f}{min(found.segment):11.2f}{min(found.cpu):8.2f}"
            f"{found.mb:7.0f}{1e6 * whole / side**2:11.3f}",
            flush=True,
        )
    print(f"seconds grow as cells to the power of {exponent(sides, quickest):.2f}")


if __name__ == "__main__":
    main()
