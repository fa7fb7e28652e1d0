"""Learners that update once a step, with or without the level of landmarks: Q-learning and the paper's HQL."""

import numpy as np

from qualrl.kernels import learning as kernel
from qualrl.kernels import stepping
from qualrl.learning.learner import NO_LIMIT, Learned, fresh_progress, kernel_world
from qualrl.learning.rules import LearningRule
from qualrl.learning.settings import ETA_COUNTERS, LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP


class OneStepLearner:
    """A learner of the loop in ``kernels.learning``."""

    def __init__(self, model: HybridMDP, rule: LearningRule, settings: LearnSettings, seed: int) -> None:
        self.model = model
        self.progress = fresh_progress(settings.episodes, seed)
        self.progress.whole[kernel.LANDMARK] = self.progress.whole[kernel.LEFT_AT] = -1
        self._world = kernel_world(model)
        self._upper = _upper(model, settings) if rule.uses_landmarks else None
        self._rates = stepping.Rates(settings.alpha, model.gamma, settings.epsilon, settings.max_steps or NO_LIMIT)
        self._actions = (0,) * model.world.n_actions
        self._q = np.zeros(len(model) * model.world.n_actions)

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        made: int = kernel.run_steps(
            *self._world, self._upper, self._rates, self._actions, self.model.starts, self._q, self.progress, n_steps
        )
        return made

    def learned(self) -> Learned:
        """See Learner."""
        q = self._q.reshape(len(self.model), -1).copy()
        if self._upper is None:
            return Learned(q)
        return Learned(q, self._upper.arc_q.copy(), self._upper.arc_visits.copy())


def _upper(model: HybridMDP, settings: LearnSettings) -> kernel.Upper:
    level = model.landmarks
    return kernel.Upper(
        level.landmark_of, level.arc_start, level.arc_target, np.zeros(len(level.arc_target)),
        np.zeros(len(level.arc_target), np.int64), np.zeros(len(level.names) * model.world.n_actions, np.int64),
        np.array(settings.eta_weights()), ETA_COUNTERS.index(settings.eta_counter),
    )  # fmt: skip
