"""The one trainer: it lays out arrays, calls the compiled loop in slices, and packs up what was learned."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import learning as kernel
from qualrl.kernels import stepping
from qualrl.learning.rules import LearningRule, rule_named
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import ETA_COUNTERS, LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP

SLICE_S = 0.1
"""Aim of one call of the compiled loop: short enough for a progress bar and for Ctrl-C."""
NO_LIMIT = 2**62


@dataclass(frozen=True)
class Milestone:
    """Where a run stands, for whoever watches it."""

    episode: int
    episodes: int
    total_steps: int
    last_steps: int | None
    """Steps of the last finished episode."""
    last_return: float | None


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
    rule = rule_named(algorithm)
    if not 0 <= seed < 2**63:
        raise SettingError(f"seed must be a whole number from 0 to 2**63 - 1, got {seed}")
    begun = time.perf_counter()
    upper = _upper(model, rule, settings)
    progress = _fresh_progress(settings.episodes, seed)
    q = np.zeros(len(model) * model.world.n_actions)
    rates = stepping.Rates(settings.alpha, model.gamma, settings.epsilon, settings.max_steps or NO_LIMIT)
    world = _kernel_world(model)
    actions = (0,) * model.world.n_actions
    slice_steps, total = 20_000, 0
    while progress.whole[stepping.EPISODE] < settings.episodes:
        at = time.perf_counter()
        total += kernel.run_steps(*world, upper, rates, actions, model.starts, q, progress, slice_steps)
        if watch is not None:
            watch(_milestone(progress, total))
        spent = time.perf_counter() - at
        slice_steps = int(np.clip(slice_steps * SLICE_S / max(spent, 1e-6), slice_steps // 4, slice_steps * 4)) + 1000
    return LearningRun(
        model, algorithm, seed, settings, progress.steps, progress.returns, q.reshape(len(model), -1),
        upper.arc_q if upper else np.empty(0), upper.arc_visits if upper else np.empty(0, np.int64),
        time.perf_counter() - begun,
    )  # fmt: skip


def seed_stream(seed: int) -> NDArray[np.uint64]:
    """(4,) state of xoshiro256++ for a seed, by splitmix64 as its authors advise."""
    mask, words = 2**64 - 1, []
    for _ in range(4):
        seed = (seed + 0x9E3779B97F4A7C15) & mask
        z = ((seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        words.append(z ^ (z >> 31))
    return np.array(words, np.uint64)


def _fresh_progress(episodes: int, seed: int) -> stepping.Progress:
    whole = np.zeros(stepping.SLOTS, np.int64)
    whole[kernel.LANDMARK] = whole[kernel.LEFT_AT] = -1
    return stepping.Progress(
        seed_stream(seed), whole, np.zeros(stepping.SLOTS), np.zeros(episodes, np.int64), np.zeros(episodes)
    )


def _kernel_world(model: HybridMDP) -> tuple[stepping.Grid | None, float | None, stepping.Table | None]:
    """What the loop needs of a world: (grid, slip, None) or (None, None, table)."""
    world = model.world
    if isinstance(world, GridWorld):
        grid = stepping.Grid(world.successor.ravel(), world.move_reward, world.goal, float(world.goal_reward))
        return grid, world.slip or None, None
    table = stepping.Table(world.row_start, world.target, world.cumulative, world.reward, world.terminal)
    return None, None, table


def _upper(model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> kernel.Upper | None:
    if not rule.uses_landmarks:
        return None
    level = model.landmarks
    return kernel.Upper(
        level.landmark_of, level.arc_start, level.arc_target, np.zeros(len(level.arc_target)),
        np.zeros(len(level.arc_target), np.int64), np.zeros(len(level.names) * model.world.n_actions, np.int64),
        np.array(settings.eta_weights()), ETA_COUNTERS.index(settings.eta_counter),
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
