"""From a map's image to its hybrid MDP: seconds, memory, and how the cost of a cell grows with the map.

    python -m tests.benchmarks.maps [--largest 10000]

Squares of 500 x 500 cells of 0.05 m, each with a generated floor plan (furniture, clutter, scans) as far as it fits.
Each size in a process of its own, all loops compiled before: wall and CPU seconds of the quickest of 3 rounds (1 for
more than 4000), and the peak of its memory.  "segment" is a part of the whole, which reads a PNG and builds a model.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import qualrl
from qualrl.spatial.floor_plans import random_floor_plan

SIDES = (500, 1000, 2000, 4000, 8000, 10000)
TILE = 500
PLANS = 40


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


def measured(path: str, rounds: int) -> dict[str, float]:
    """What one process measures."""
    best = {"whole": np.inf, "segment": np.inf, "cpu": np.inf}
    for _ in range(rounds):
        begun, cpu = time.perf_counter(), time.process_time()
        grid = qualrl.read_map(path)
        read = time.perf_counter()
        regions = qualrl.segment(grid)
        cut = time.perf_counter()
        qualrl.build(regions, regions.regions[0].centre)
        spent = {"whole": time.perf_counter() - begun, "segment": cut - read, "cpu": time.process_time() - cpu}
        best = {name: min(best[name], spent[name]) for name in best}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return best | {"mb": peak, "regions": len(regions.regions)}


def alone(side: int) -> dict[str, float]:
    """What a process of its own measures on a map of that side."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.png"
        cv2.imwrite(str(path), image(side))
        rounds = "3" if side <= 4000 else "1"
        own = [sys.executable, "-m", "tests.benchmarks.maps", "--one", str(path), "--rounds", rounds]
        done = subprocess.run(own, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def main() -> None:
    """Print the table, or be one of its processes."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--largest", type=int, default=4000)
    parser.add_argument("--one", default=None, help=argparse.SUPPRESS)
    parser.add_argument("--rounds", type=int, default=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one is not None:
        print(json.dumps(measured(chosen.one, chosen.rounds)))
        return
    print(f"{'side':>6s}{'regions':>9s}{'whole s':>9s}{'segment s':>11s}{'CPU s':>8s}{'MB':>7s}{'us a cell':>11s}")
    sides = [side for side in SIDES if side <= chosen.largest]
    alone(sides[0])  # the first compiles
    whole = []
    for side in sides:
        found = alone(side)
        whole.append(found["whole"])
        print(
            f"{side:6d}{found['regions']:9.0f}{found['whole']:9.2f}{found['segment']:11.2f}{found['cpu']:8.2f}"
            f"{found['mb']:7.0f}{1e6 * found['whole'] / side**2:11.3f}",
            flush=True,
        )
    exponent = np.polyfit(np.log(np.square(sides)), np.log(whole), 1)[0]
    print(f"seconds grow as cells to the power of {exponent:.2f}")


if __name__ == "__main__":
    main()
