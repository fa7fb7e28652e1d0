"""Q-learning's compiled loop beside the same loop in C, on the same random stream.

    python -m tests.benchmarks.against_c

Compiles ``q_learning.c`` with gcc -O2 and -O3, without fused multiply-adds, which round differently; the one
that is faster by its median counts.  Both loops write down steps and return of every episode, and must agree in each of
them and in every value.  CPU seconds of one thread; they take turns, so that a machine that slows down slows both.
"""

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import qualrl
from qualrl.kernels.stepping import EPISODE
from qualrl.learning.one_step import OneStepLearner
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from tests.benchmarks.effort import Effort
from tests.benchmarks.table import Row, at_least, short
from tests.worlds import PUZZLE, grid_of

ROUNDS = REPEATED = 9
STEPS = (200_000, 2_000_000, 20_000_000)
SIDES = (100, 320, 1000)
"""Cells along the empty halls that stand for larger maps."""
ALPHA = EPSILON = 0.01
LEAST_EPISODE = 20
"""No way on these maps is shorter."""


class Result(NamedTuple):
    """What a loop learned, and its million steps a second."""

    speed: float
    steps: NDArray[np.int64]
    returns: NDArray[np.float64]
    q: NDArray[np.float64]


def compiled_with(level: str, folder: Path) -> Any:
    """The C loop."""
    library = folder / f"q_learning{level}.so"
    source = Path(__file__).with_name("q_learning.c")
    subprocess.run(["gcc", level, "-ffp-contract=off", "-shared", "-fPIC", "-o", library, source], check=True)
    loop = ctypes.CDLL(str(library)).q_learning
    pointer, whole, real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    loop.restype = whole
    loop.argtypes = [pointer, whole, whole, real, real, whole, pointer, pointer, real, real, real, pointer, pointer]
    return loop


def learner(model: qualrl.HybridMDP, steps: int, seed: int) -> OneStepLearner:
    """Q-learning that has made no step yet, with room for all episodes; what it reads and writes was written to."""
    settings = LearnSettings(episodes=steps // LEAST_EPISODE, alpha=ALPHA, epsilon=EPSILON)
    made = start_learner(model, "q-learning", settings, seed)
    assert isinstance(made, OneStepLearner)
    assert model.starts.size  # worked out once for a model
    made._q.fill(0.0)
    return made


def ours(model: qualrl.HybridMDP, steps: int, seed: int) -> Result:
    """One run of this project's loop."""
    run = learner(model, steps, seed)
    begun = time.thread_time()
    run.advance(steps)
    seconds = time.thread_time() - begun
    progress, over = run.progress, int(run.progress.whole[EPISODE])
    return Result(steps / seconds / 1e6, progress.steps[:over], progress.returns[:over], run.learned().q)


def in_c(loop: Any, model: qualrl.HybridMDP, steps: int, seed: int) -> Result:
    """One run of the C loop, on a learner's arrays: which memory is new, and what is still in the caches, matters."""
    run, grid = learner(model, steps, seed), model.grid
    rows, progress = run._world[0].next_row, run.progress
    begun = time.thread_time()
    over = loop(
        rows.ctypes.data, model.start, grid.goal, grid.step_reward, grid.goal_reward, steps,
        progress.stream.ctypes.data, run._q.ctypes.data, ALPHA, grid.gamma, EPSILON, progress.steps.ctypes.data,
        progress.returns.ctypes.data,
    )  # fmt: skip
    seconds = time.thread_time() - begun
    return Result(steps / seconds / 1e6, progress.steps[:over], progress.returns[:over], run.learned().q)


def usual_speed(model: qualrl.HybridMDP, steps: int, seed: int) -> float:
    """Our million steps a second: the median of some runs, where one takes but milliseconds."""
    return float(np.median([ours(model, steps, seed).speed for _ in range(REPEATED)]))


def check_same(one: Result, other: Result) -> None:
    """Raise AssertionError unless two loops did the same."""
    for found, expected in zip(one[1:], other[1:], strict=True):
        np.testing.assert_array_equal(found, expected)


def puzzle() -> qualrl.HybridMDP:
    """The paper's puzzle."""
    return qualrl.build(qualrl.segment(grid_of(PUZZLE)), [6, 6], start=[11, 1], gamma=0.9)


def worlds() -> dict[str, qualrl.HybridMDP]:
    """The puzzle, and empty halls with start and goal 40 cells apart."""
    found = {"13 x 13 puzzle": puzzle()}
    for side in SIDES:
        hall = qualrl.OccupancyGrid.from_free(np.pad(np.ones((side - 2, side - 2), np.bool_), 1), 0.05)
        middle = side // 2
        found[f"{side} x {side} hall"] = qualrl.build(
            qualrl.segment(hall), [middle, middle + 20], start=[middle, middle - 20], gamma=0.9
        )
    return found


def speeds(model: qualrl.HybridMDP, steps: int, loops: list[Any], rounds: int) -> NDArray[np.float64]:
    """(rounds, 2) million steps a second: ours, and the faster of the C loops."""
    runs = [ours, *(partial(in_c, loop) for loop in loops)]
    found = []
    for seed in range(rounds):
        results = {}
        for at in range(len(runs)):  # who begins changes: the caches hold less for it
            turn = (seed + at) % len(runs)
            results[turn] = runs[turn](model, steps, seed)
        for turn in range(1, len(runs)):
            check_same(results[0], results[turn])
        found.append([results[turn].speed for turn in range(len(runs))])
    best = 1 + int(np.median(found, axis=0)[1:].argmax())
    return np.array(found)[:, [0, best]]


def measured(steps: Sequence[int], rounds: int) -> Iterator[tuple[str, int, NDArray[np.float64]]]:
    """(world, steps, ``speeds``) of each world and number of steps."""
    with tempfile.TemporaryDirectory() as folder:
        loops = [compiled_with(level, Path(folder)) for level in ("-O2", "-O3")]
        models = worlds()
        ours(models["13 x 13 puzzle"], 1000, 0)  # compile
        for name, model in models.items():
            for count in steps:
                yield name, count, speeds(model, count, loops, rounds)


def rows(effort: Effort) -> Iterator[Row]:
    """Target 1's rows beside C."""
    steps = STEPS[: effort.rounds(3, 2)]
    for name, count, found in measured(steps, effort.rounds(ROUNDS, 5)):
        mine, best = np.median(found, axis=0)
        yield Row(
            1, f"Q-learning, {name}, {count:,} steps", f"{short(mine)} M steps/s", f"C {short(best)} M steps/s",
            found[:, 0] / found[:, 1], at_least(0.85),
        )  # fmt: skip


def main() -> None:
    """Print the table."""
    print(f"{'million steps/s':18s}{'steps':>12s}{'qualrl':>12s}{'C':>8s}{'share of C (range)':>24s}")
    for name, steps, found in measured(STEPS, ROUNDS):
        (mine, best), shares = np.median(found, axis=0), found[:, 0] / found[:, 1]
        spread = f"{np.median(shares):.2f} ({shares.min():.2f} to {shares.max():.2f})"
        print(f"{name:18s}{steps:12,d}{mine:12.0f}{best:8.0f}{spread:>24s}", flush=True)


if __name__ == "__main__":
    main()
