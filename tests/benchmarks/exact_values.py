"""Exact values of slippery grids: seconds, memory and error, beside sparse value iteration in scipy.

    python -m tests.benchmarks.exact_values [--largest 1085]

Maps with 15 % of their cells walls at random, the goal in the middle, gamma 0.99.  Ours settles to a relative 1e-12;
value iteration stops where no value can be off by more than 5e-3.  CPU seconds, median of the rounds (range), loops
compiled, successors and their order outward found beforehand ("order" is their time).  MB: peak of a whole process.
"""

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array

from qualrl.models.grid_world import GridWorld
from qualrl.solving.exact import exact_values

SIDES = (109, 345, 1085)
SLIPS = (0.05, 0.2, 0.5)
GAMMA = 0.99
ERROR = 5e-3
ROUNDS = 5


def world(side: int, slip: float) -> GridWorld:
    """A map of side x side cells."""
    generator = np.random.default_rng(0)
    wall = np.pad(generator.random((side - 2, side - 2)) < 0.15, 1, constant_values=True)
    goal = (side // 2, side // 2)
    wall[goal] = False
    piece, _ = ndimage.label(~wall)
    return GridWorld(piece == piece[goal], goal, GAMMA, slip)


def value_iteration(grid: GridWorld) -> NDArray[np.float64]:
    """V of every state by sparse matrices."""
    table = grid.table()
    rows, actions = len(table.row_start) - 1, table.n_actions
    step = csr_array((table.probability, table.target, table.row_start), shape=(rows, len(grid)))
    reward = np.add.reduceat(table.probability * table.reward, table.row_start[:-1])
    value = np.zeros(len(grid))
    change = np.inf
    while change > ERROR * (1 - GAMMA) / GAMMA:
        before = value
        value = (reward + GAMMA * (step @ before)).reshape(-1, actions).max(axis=1)
        value[table.terminal] = 0.0
        change = float(np.abs(value - before).max())
    return value


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU seconds of some work."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


def peak_mb(side: int, slip: float) -> float:
    """Largest memory of a process that solves one map."""
    exact_values(world(side, slip))
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def row(side: int, slip: float) -> str:
    """A line of the table."""
    grid = world(side, slip)
    assert grid.successor.size
    orders = [cpu_seconds(lambda: replace(grid, gamma=GAMMA).outward) for _ in range(ROUNDS)]
    assert grid.outward.size
    solved = [cpu_seconds(lambda: exact_values(grid)) for _ in range(ROUNDS)]
    found: list[NDArray[np.float64]] = []
    sparse = cpu_seconds(lambda: found.append(value_iteration(grid)))
    error = float(np.abs(found[0] - exact_values(grid).value).max())
    assert error < 2 * ERROR, "two ways to the same values"
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        peak = pool.submit(peak_mb, side, slip).result()
    took = float(np.median(solved))
    spread = f"{took:.3f} ({min(solved):.3f} to {max(solved):.3f})"
    return (
        f"{len(grid):9,d}{slip:6.2f}{np.median(orders):9.3f}{spread:>26s}{peak:7.0f}{sparse:10.1f}{sparse / took:8.0f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=SIDES[-1], help="sides of larger maps are left out")
    largest = parser.parse_args().largest
    exact_values(world(21, SLIPS[0]))  # compile
    print(f"{'states':>9s}{'slip':>6s}{'order s':>9s}{'exact values s':>26s}{'MB':>7s}{'scipy s':>10s}{'times':>8s}")
    for side in (side for side in SIDES if side <= largest):
        for slip in SLIPS:
            print(row(side, slip), flush=True)


if __name__ == "__main__":
    main()
