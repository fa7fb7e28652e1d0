"""Learners that update once a step: TD(0), Q-learning, and the paper's HQL with its level of landmarks."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import learning as kernel
from qualrl.learning.learner import (
    Learned,
    Seeded,
    counting,
    fresh_progress,
    kernel_world,
    rates_of,
    rewired,
    table_of,
    tried,
    visits_of,
)
from qualrl.learning.levels_anew import same_landmarks, upper_anew
from qualrl.learning.policy import policy_actions
from qualrl.learning.rules import LearningRule
from qualrl.learning.schedule import schedule_of
from qualrl.learning.settings import ETA_COUNTERS, LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP


class OneStepLearner(Seeded):
    """A learner of the loop in ``kernels.learning``."""

    def __init__(self, model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> None:
        self.model = model
        self._episodes = settings.episodes
        self._world = kernel_world(model)
        self._upper = _upper(model, settings) if rule.uses_landmarks else None
        self._landmarks = model.landmarks
        self._policy = policy_actions(model, settings.policy) if rule.evaluates else None
        self._actions = (0,) * model.world.n_actions
        self._shape = len(model), 1 if rule.evaluates else model.world.n_actions
        self._rates, self._table = rates_of(model, settings), table_of(settings.alpha)

    def _begin(self, seed: int) -> None:
        self.progress = fresh_progress(self._episodes, seed)
        self.progress.whole[kernel.LANDMARK] = self.progress.whole[kernel.LEFT_AT] = -1
        self._q = np.zeros(self._shape[0] * self._shape[1])
        self._visits = visits_of(self._table, len(self._q))
        if self._upper is not None:
            arcs, pairs = len(self._upper.arc_q), len(self._upper.pair_count)
            self._upper = self._upper._replace(
                arc_q=np.zeros(arcs), arc_visits=np.zeros(arcs, np.int64), pair_count=np.zeros(pairs, np.int64)
            )

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        made: int = kernel.run_steps(
            *self._world, self._upper, self._policy, self._visits, self._rates, self._actions, self.model.starts,
            self._q, self.progress, n_steps,
        )  # fmt: skip
        return made

    def change_world(self, world: GridWorld) -> None:
        """See Adaptive."""
        self._world = rewired(self._world, world)

    def change_levels(self, model: HybridMDP) -> None:
        """See Exploring.  A way begun at a landmark that is none any more is not learned from."""
        if self._upper is not None:
            kept, whole = same_landmarks(model.landmarks, self._landmarks), self.progress.whole
            self._upper = upper_anew(self._upper, model.landmarks, kept, len(self._actions))
            self._landmarks = model.landmarks
            here = np.flatnonzero((kept == whole[kernel.LANDMARK]) & (kept >= 0))
            if not here.size:
                whole[kernel.LEFT_AT] = -1
            whole[kernel.LANDMARK] = here[0] if here.size else -1

    def visited(self) -> NDArray[np.bool_]:
        """See Exploring.  States are told by their values: one whose updates came to exactly 0 is missed."""
        found: NDArray[np.bool_] = (self._q.reshape(len(self.model), -1) != 0).any(axis=1)
        return found

    def count_visits(self) -> None:
        """See Counting."""
        self._visits = counting(self._visits, self._rates.alpha, len(self._q))

    def learned(self) -> Learned:
        """See Learner."""
        q = self._q.reshape(self._shape).copy()
        visits = tried(self._visits, len(self.model))
        if self._upper is None:
            return Learned(q, visits=visits)
        return Learned(q, None, self._upper.arc_q.copy(), self._upper.arc_visits.copy(), visits)


def _upper(model: HybridMDP, settings: LearnSettings) -> kernel.Upper:
    level = model.landmarks
    return kernel.Upper(
        level.landmark_of, level.arc_start, level.arc_target, np.zeros(len(level.arc_target)),
        np.zeros(len(level.arc_target), np.int64), np.zeros(len(level.names) * model.world.n_actions, np.int64),
        _arc_rate(settings), np.array(settings.eta_weights()), ETA_COUNTERS.index(settings.eta_counter),
        settings.macro_return == "stay", settings.macro_discount == "gamma",
    )  # fmt: skip


def _arc_rate(settings: LearnSettings) -> NDArray[np.float64]:
    schedule = schedule_of(settings.alpha if settings.upper_alpha is None else settings.upper_alpha)
    return schedule.table() if schedule.constant is None else np.array([schedule.constant])
