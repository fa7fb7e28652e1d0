"""Exact values of slippery grids: seconds, memory and error, beside sparse value iteration in scipy.

    python -m tests.benchmarks.exact_values [--largest 1085]

Maps with 15 % of their cells walls at random, the goal in the middle, gamma 0.99.  Ours settles to a relative 1e-12 (in
the table of all targets so far that no value is off by more than 5e-3); value iteration stops where no value can be off
by more than 5e-3.  CPU seconds, median of the rounds (range), loops compiled, the model there (successors, or
matrices).  "order": a breadth-first search outward, which comes before the exact values.  MB: peak of a whole process.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array

from qualrl.models.grid_world import GridWorld
from qualrl.solving.exact import exact_values
from tests.benchmarks.effort import Effort
from tests.benchmarks.processes import apart, peak_mb
from tests.benchmarks.table import Row, bounded

SIDES = (109, 345, 1085)
SLIPS = (0.05, 0.2, 0.5)
GAMMA = 0.99
ERROR = 5e-3
ROUNDS = 5
BOUNDS = {345: 0.05, 1085: 1.0}
"""CPU seconds that maps of these sides may take."""


def world(side: int, slip: float) -> GridWorld:
    """A map of side x side cells."""
    generator = np.random.default_rng(0)
    wall = np.pad(generator.random((side - 2, side - 2)) < 0.15, 1, constant_values=True)
    goal = (side // 2, side // 2)
    wall[goal] = False
    piece, _ = ndimage.label(~wall)
    return GridWorld(piece == piece[goal], goal, GAMMA, slip)


def sparse_table(grid: GridWorld) -> tuple[csr_array, NDArray[np.float64]]:
    """((S A, S) probabilities, (S A,) expected rewards) of a world whose goal is kept for ever, at no reward."""
    table = grid.table()
    target, reward = table.target.astype(np.int32), table.reward.copy()
    at_goal = slice(*table.row_start[[grid.goal * grid.n_actions, (grid.goal + 1) * grid.n_actions]])
    target[at_goal], reward[at_goal] = grid.goal, 0.0
    rows = len(table.row_start) - 1
    matrix = csr_array((table.probability.copy(), target, table.row_start.astype(np.int32)), (rows, len(grid)))
    matrix.sum_duplicates()
    return matrix, np.add.reduceat(table.probability * reward, table.row_start[:-1])


def value_iteration(grid: GridWorld, step: csr_array, reward: NDArray[np.float64]) -> NDArray[np.float64]:
    """V of every state; step (S A, S) and reward (S A,) as ``sparse_table`` has them."""
    value = np.zeros(len(grid))
    change = np.inf
    while change > ERROR * (1 - GAMMA) / GAMMA:
        before = value
        value = (reward + GAMMA * (step @ before)).reshape(-1, grid.n_actions).max(axis=1)
        change = float(np.abs(value - before).max())
    return value


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU seconds of some work."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


def beside_scipy(grid: GridWorld) -> float:
    """CPU seconds of value iteration, whose values are checked against ours."""
    step, reward = sparse_table(grid)
    found: list[NDArray[np.float64]] = []
    seconds = cpu_seconds(lambda: found.append(value_iteration(grid, step, reward)))
    check_error(found[0], grid)
    return seconds


def check_error(value: NDArray[np.float64], grid: GridWorld) -> None:
    """Raise AssertionError where values are off by more than they were to be."""
    error = float(np.abs(value - exact_values(grid).value).max())
    assert error < ERROR, f"values are off by {error:.2g}"


def peak_of(side: int, slip: float) -> float:
    """Largest memory in MiB of a process that solves one map."""
    exact_values(world(side, slip))
    return peak_mb()


class Solved(NamedTuple):
    """CPU seconds of our own."""

    order: list[float]
    values: list[float]

    @property
    def both(self) -> list[float]:
        """Of what has to be done once the model is there."""
        return [sum(pair) for pair in zip(*self, strict=True)]


def solved(grid: GridWorld, rounds: int, error: float | None = None) -> Solved:
    """What ours takes in each round."""
    found = Solved([], [])
    for _ in range(rounds):
        fresh = replace(grid)
        assert fresh.successor.size
        found.order.append(cpu_seconds(lambda: fresh.outward))  # noqa: B023
        found.values.append(cpu_seconds(lambda: exact_values(fresh, error)))  # noqa: B023
    return found


def rows(effort: Effort) -> Iterator[Row]:
    """Target 3's rows beside its bounds."""
    exact_values(world(21, SLIPS[0]))  # compile
    rounds = effort.rounds(ROUNDS, 3)
    for side, bound in BOUNDS.items():
        for slip in SLIPS:
            grid = world(side, slip)
            found = solved(grid, rounds, ERROR)
            check_error(exact_values(grid, ERROR).value, grid)
            yield bounded(3, f"values to {ERROR:g}, {len(grid):,} states, slip {slip}", "CPU s", found.both, bound)
    yield bounded(3, f"breadth-first distances, {len(grid):,} states", "CPU s", found.order, 0.035)
    for slip in SLIPS:
        yield bounded(3, f"peak, {len(grid):,} states, slip {slip}", "MB", [apart(peak_of, side, slip)], 350)


def line(side: int, slip: float) -> str:
    """A line of the table."""
    grid = world(side, slip)
    found = solved(grid, ROUNDS)
    sparse = beside_scipy(grid)
    took = float(np.median(found.values))
    times = f"{took:.3f} ({min(found.values):.3f} to {max(found.values):.3f})"
    return (
        f"{len(grid):9,d}{slip:6.2f}{np.median(found.order):9.3f}{times:>26s}{apart(peak_of, side, slip):7.0f}"
        f"{sparse:10.1f}{sparse / took:8.0f}"
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
            print(line(side, slip), flush=True)


if __name__ == "__main__":
    main()
