"""Many seeds at once: what a second thread gains, and what each task costs beside its steps.

    python -m tests.benchmarks --only 6

Wall seconds.  The speed-up needs two cores that nobody else uses.  A task of the second kind is a single step, cut off
then; what is asked for is a whole ``Training``, so that is what the overhead holds.
"""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import qualrl
from tests.benchmarks.effort import Effort
from tests.benchmarks.table import Row, at_least, bounded, short
from tests.worlds import PUZZLE, grid_of

LEARNERS = "q-learning", "hql", "hql-replay", "option-q"
RUNS, EPISODES = 16, {"q-learning": 60_000, "hql-replay": 40_000}
TASKS = 500


def took(
    model: qualrl.HybridMDP, seeds: int, learner: str, threads: int | None, episodes: int, steps: int | None = None
) -> tuple[float, float]:
    """(wall, CPU) seconds of so many runs; steps: after so many an episode is cut off."""
    begun, cpu_begun = time.perf_counter(), time.process_time()
    qualrl.train_seeds(
        model, seeds, learner, threads=threads, episodes=episodes, alpha=0.1, epsilon=0.01, max_steps=steps
    )
    return time.perf_counter() - begun, time.process_time() - cpu_begun


def check_same(model: qualrl.HybridMDP, learner: str) -> None:
    """Raise AssertionError unless neither threads nor order change a bit."""
    one = qualrl.train_seeds(model, range(4), learner, threads=1, episodes=50)
    other = qualrl.train_seeds(model, range(3, -1, -1), learner, threads=2, episodes=50)[::-1]
    for here, there in zip(one, other, strict=True):
        np.testing.assert_array_equal(here.q, there.q)
        np.testing.assert_array_equal(here.steps, there.steps)


def rows(effort: Effort) -> Iterator[Row]:
    """Target 6's rows."""
    regions = qualrl.segment(grid_of(PUZZLE))
    whole = qualrl.build(regions, [6, 6], start=[11, 1], gamma=0.9)
    rounds = effort.rounds(7, 3)
    for learner, episodes in EPISODES.items():
        check_same(whole, learner)
        times = [[took(whole, RUNS, learner, threads, episodes)[0] for threads in (1, 2)] for _ in range(rounds)]
        one, two = np.median(times, axis=0)
        yield Row(
            6, f"{RUNS} seeds of {learner}, two threads", f"{two:.2f} wall s", f"one thread {one:.2f} wall s",
            [alone / both for alone, both in times], at_least(1.8),
        )  # fmt: skip
    for learner in LEARNERS:
        took(whole, 10, learner, None, 1, 1)  # compile
        times = [took(whole, TASKS, learner, None, 1, 1) for _ in range(rounds)]
        wall, cpu = 1e6 * np.transpose(times) / TASKS
        row = bounded(6, f"overhead a task, {TASKS} seeds of {learner}", "wall us", wall.tolist(), 50)
        yield replace(row, ours=f"{row.ours}, {short(float(np.median(cpu)))} CPU us")
