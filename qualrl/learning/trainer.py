"""The one trainer: it starts the learner of a name, lets it run in slices, and packs up what was learned."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from qualrl.kernels import stepping
from qualrl.learning.ahead import AheadLearner
from qualrl.learning.hierarchical import task_learner
from qualrl.learning.learner import Learner
from qualrl.learning.one_step import OneStepLearner
from qualrl.learning.planners import PlanningLearner
from qualrl.learning.rules import LearningRule, Loop, rule_named
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP

SLICE_S = 0.1
"""Aim of one call of the compiled loop: short enough for a progress bar and for Ctrl-C."""

LEARNERS: dict[Loop, Callable[[HybridMDP, LearningRule, LearnSettings, int], Learner]] = {
    Loop.ONE_STEP: OneStepLearner,
    Loop.AHEAD: AheadLearner,
    Loop.PLANNING: PlanningLearner,
    Loop.TASKS: task_learner,
}
"""Who lays out the arrays of each compiled loop."""


@dataclass(frozen=True)
class Milestone:
    """Where a run stands, for whoever watches it."""

    episode: int
    episodes: int
    total_steps: int
    last_steps: int | None
    """Steps of the last finished episode."""
    last_return: float | None


def start_learner(model: HybridMDP, algorithm: str, settings: LearnSettings, seed: int = 0) -> Learner:
    """A learner that has made no step yet, for whoever wants to look at it on its way.

    Raises UnknownNameError for an unknown algorithm, SettingError for a seed out of its range.
    """
    rule = rule_named(algorithm)
    return LEARNERS[rule.loop](model, rule, settings, seed)


def train(
    model: HybridMDP,
    algorithm: str,
    settings: LearnSettings,
    seed: int = 0,
    watch: Callable[[Milestone], None] | None = None,
) -> LearningRun:
    """Run a learner to the end of its episodes.  The same seed gives the same result, watched or not.

    Raises UnknownNameError for an unknown algorithm, NoPlanError when the goal cannot be reached.
    """
    begun = time.perf_counter()
    learner = start_learner(model, algorithm, settings, seed)
    progress = learner.progress
    slice_steps, total = 20_000, 0
    while progress.whole[stepping.EPISODE] < settings.episodes:
        at = time.perf_counter()
        total += learner.advance(slice_steps)
        if watch is not None:
            watch(_milestone(progress, total))
        spent = time.perf_counter() - at
        slice_steps = int(np.clip(slice_steps * SLICE_S / max(spent, 1e-6), slice_steps // 4, slice_steps * 4)) + 1000
    learned = learner.learned()
    return LearningRun(
        model, algorithm, seed, settings, progress.steps, progress.returns, learned.q, learned.arc_q,
        learned.arc_visits, time.perf_counter() - begun, learned.shifted_q,
    )  # fmt: skip


def _milestone(progress: stepping.Progress, total: int) -> Milestone:
    episode = int(progress.whole[stepping.EPISODE])
    last = episode - 1
    return Milestone(
        episode,
        len(progress.steps),
        total,
        int(progress.steps[last]) if episode else None,
        float(progress.returns[last]) if episode else None,
    )
