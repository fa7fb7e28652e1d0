"""What a learning run leaves behind.

S states, A actions, E arcs between landmarks.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.settings import LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import ExactValues, action_values, exact_values
from qualrl.solving.policy import ActionValues, greedy_walk


@dataclass(frozen=True, eq=False)
class LearningRun:
    """A finished run: what was learned, how long it took, and the exact values beside it."""

    model: HybridMDP
    algorithm: str
    seed: int
    settings: LearnSettings
    steps: NDArray[np.int64]
    """(episodes,) steps of each episode."""
    returns: NDArray[np.float64]
    """(episodes,) undiscounted sum of rewards of each episode."""
    q: NDArray[np.float64]
    """(S, A) learned action values; terminal rows stay 0."""
    arc_q: NDArray[np.float64]
    """(E,) learned values of the arcs between landmarks; empty for learners without that level."""
    arc_visits: NDArray[np.int64]
    """(E,) how often each arc was travelled."""
    seconds: float

    @property
    def total_steps(self) -> int:
        """Steps of all episodes."""
        return int(self.steps.sum())

    @cached_property
    def exact(self) -> ExactValues:
        """Exact optimal values of the model."""
        return exact_values(self.model.world)

    @property
    def exact_values(self) -> NDArray[np.float64]:
        """(S,) optimal values by dynamic programming."""
        return self.exact.value

    @cached_property
    def max_error(self) -> float:
        """Largest difference between max_a Q(s, a) and the exact value, over the states that can reach the goal."""
        error = np.abs(self.q.max(axis=1) - self.exact_values)
        return float(error[self.model.can_reach].max())

    @cached_property
    def greedy_steps(self) -> int | None:
        """Steps from start to goal by the learned policy; None if it does not get there, or without a fixed start."""
        return self._walked(lambda state: self.q[state])

    @cached_property
    def optimal_steps(self) -> int | None:
        """Steps from start to goal by the optimal policy; None without a fixed start."""
        exact = self.exact
        return self._walked(lambda state: action_values(self.model.world, exact.shifted, exact.shift, state))

    def _walked(self, values: ActionValues) -> int | None:
        if self.model.start is None:
            return None
        walk, arrived = greedy_walk(self.model.world, values, self.model.start)
        return len(walk) - 1 if arrived else None
