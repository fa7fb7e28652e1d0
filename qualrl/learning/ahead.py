"""Learners that choose the next action before they learn: SARSA, SARSA(lambda), Watkins's Q(lambda)."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import traces as kernel
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
from qualrl.learning.rules import LearningRule
from qualrl.learning.settings import LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP


class AheadLearner(Seeded):
    """A learner of the loop in ``kernels.traces``."""

    def __init__(self, model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> None:
        self.model = model
        self._episodes = settings.episodes
        self._world = kernel_world(model)
        self._decay = model.gamma * settings.trace if rule.traces else None
        self._on_policy = True if rule.on_policy else None
        self._rates, self._table = rates_of(model, settings), table_of(settings.alpha)
        self._actions = (0,) * model.world.n_actions
        self._rows = len(model) * len(self._actions)

    def _begin(self, seed: int) -> None:
        rows = self._rows
        self.progress = fresh_progress(self._episodes, seed)
        self._q = np.zeros(rows)
        self._trace = None
        if self._decay is not None:
            self._trace = kernel.Trace(self._decay, np.zeros(rows, np.uint32), np.zeros(rows), np.zeros(rows))
        self._visits = visits_of(self._table, rows)

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        made: int = kernel.run_ahead(
            *self._world, self._trace, self._on_policy, self._visits, self._rates, self._actions, self.model.starts,
            self._q, self.progress, n_steps,
        )  # fmt: skip
        return made

    def change_world(self, world: GridWorld) -> None:
        """See Adaptive."""
        self._world = rewired(self._world, world)

    def change_levels(self, model: HybridMDP) -> None:
        """See Exploring.  There is no such level here."""

    def visited(self) -> NDArray[np.bool_]:
        """See Exploring.  States are told by their values: one whose updates came to exactly 0 is missed."""
        found: NDArray[np.bool_] = (self._q.reshape(len(self.model), -1) != 0).any(axis=1)
        return found

    def count_visits(self) -> None:
        """See Counting."""
        self._visits = counting(self._visits, self._rates.alpha, len(self._q))

    def learned(self) -> Learned:
        """See Learner.  Rows on the trace get what they are still owed."""
        q = self._q.copy()
        if self._trace is not None:
            q += self._trace.weight * (self.progress.real[kernel.OWED] - self._trace.given)
        return Learned(q.reshape(len(self.model), -1), visits=tried(self._visits, len(self.model)))
