"""Runs on a budget of environment steps, whose greedy policy is looked at on the way.

N runs (one a seed), P looks.  Looking costs a learner nothing: it is not told, and the clock stands still.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.learner import Learner
from qualrl.learning.many import Watch
from qualrl.learning.settings import MOST_EPISODES
from qualrl.learning.trainer import start_learner
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.studies.measures import Measure
from qualrl.studies.running import Cell, Measured, Runs, learn_settings, run_all
from qualrl.studies.settings import Budget, StudySettings

QUICK = 1000
"""Steps that stand for an episode where a study is asked for a quick look of so many episodes."""
SLICE = 5_000_000
"""Steps of one call of a compiled loop, so that Ctrl-C is heard."""


@dataclass(frozen=True)
class Look:
    """What a learner's greedy policy is worth."""

    value: float
    """What the study's curve shows."""
    good: bool
    """Whether it is as near the optimum as the study asks."""
    measures: dict[Measure, float]
    """What the study says of it at the end of a run."""
    walk: tuple[int, ...] = field(default=())
    """States of its path, where there is one start."""


class Course(Protocol):
    """A world that learners are put in, and how their greedy policy is judged there."""

    @property
    def optimum(self) -> float:
        """What the curve of an optimal policy shows."""

    def model(self, gamma: float) -> HybridMDP:
        """The world; the same object each time."""

    def look(self, model: HybridMDP, learner: Learner) -> Look:
        """Judge what a learner knows by now."""

    def notes(self) -> list[str]:
        """What to know of the world."""


def looks_at(budget: Budget) -> NDArray[np.int64]:
    """(P,) environment steps made before each look: closer together at first, and none far from the next later."""
    first = min(budget.first, budget.steps)
    tenfolds = float(np.log10(budget.steps / first))
    early = np.geomspace(first, budget.steps, round(tenfolds * budget.looks_per_tenfold) + 1)
    even = np.linspace(0, budget.steps, budget.even_looks + 1)[1:]
    found = np.unique(np.concatenate([early, even[even >= first], [budget.steps]]).round().astype(np.int64))
    return np.asarray(found[found <= budget.steps], np.int64)


def run_budget(
    settings: StudySettings,
    cells: Sequence[Cell],
    course: Course,
    *,
    seeds: int,
    threads: int | None = None,
    watch: Callable[[int], None] | None = None,
) -> list[Runs]:
    """Run every cell with seeds 0, 1, ...; ``watch`` is told how many runs are done."""
    budget = settings.budget
    assert budget is not None
    most = min(MOST_EPISODES, budget.steps)
    looks = looks_at(budget)

    def started(cell: Cell, seed: int) -> tuple[HybridMDP, Learner]:
        model = course.model(settings.gamma if cell.gamma is None else cell.gamma)
        return model, start_learner(model, cell.algorithm, learn_settings(settings, cell, most), seed)

    def one(cell: Cell, seed: int, _: Watch) -> Measured:
        model, learner = started(cell, seed)
        seen, seconds = _watched(learner, looks, lambda: course.look(model, learner))
        return _measured(seen, seconds, looks)

    for cell in cells:  # compile before the clock runs, and ready what the threads share
        model, learner = started(cell, 0)
        learner.advance(1)
        course.look(model, learner)
    return run_all(one, cells, seeds, threads, watch)


def _watched(learner: Learner, looks: NDArray[np.int64], look: Callable[[], Look]) -> tuple[list[Look], list[float]]:
    """What was seen at each look, and the processor seconds of learning until then."""
    seen, seconds, made, spent = list[Look](), list[float](), 0, 0.0
    for point in looks.tolist():
        while made < point:
            asked = min(point - made, SLICE)
            begun = time.thread_time()
            done = learner.advance(asked)
            spent += time.thread_time() - begun
            made += done
            if done < asked:
                break  # its episodes are over
        seen.append(look())
        seconds.append(spent)
    return seen, seconds


def _measured(seen: list[Look], seconds: list[float], looks: NDArray[np.int64]) -> Measured:
    """Measures of a run; one that is not good at the end has lasted as long as the budget."""
    bad = [at for at, look in enumerate(seen) if not look.good]
    settled = min(bad[-1] + 1 if bad else 0, len(seen) - 1)
    found: dict[Measure, float] = {
        "converges": float(seen[-1].good),
        "env_steps": float(looks[settled]),
        "cpu_seconds": seconds[settled],
    }
    return found | seen[-1].measures, np.array([look.value for look in seen]), seen[-1].walk
