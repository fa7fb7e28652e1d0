"""What a learning run leaves behind.

S states, A actions, E arcs between landmarks.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.changes import WorldChange
from qualrl.learning.growth import Growth
from qualrl.learning.policy import policy_actions
from qualrl.learning.rules import rule_named
from qualrl.learning.settings import LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import ExactValues, action_values, exact_values
from qualrl.solving.policy import ActionValues, greedy_walk

if TYPE_CHECKING:
    from qualrl.learning.recovery import Recovery


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
    """(S, A) learned action values, -inf where a learner never takes an action; terminal rows stay 0.

    (S, 1) for a learner that evaluates a policy: the values of the states.
    """
    arc_q: NDArray[np.float64]
    """(E,) learned values of the arcs between landmarks; empty for learners without that level."""
    arc_visits: NDArray[np.int64]
    """(E,) how often each arc was travelled."""
    seconds: float
    shifted_q: NDArray[np.float64] | None = None
    """(S, A) the same plus ``exact.shift``, from learners that keep digits where q has none left; else None."""
    changes: tuple[WorldChange, ...] = ()
    """What changed in the world meanwhile; ``model`` is the world at the end."""
    growth: Growth | None = None
    """How the map became known, for a robot that did not know it; ``arc_q`` and ``arc_visits`` are empty then."""
    visits: NDArray[np.uint32] | None = None
    """(S, A) how often each action was tried, from learners that plan or whose learning rate is a formula; else None.

    (S, 1) how often each state was left, for a learner that evaluates a policy.
    """

    @cached_property
    def recovery(self) -> "tuple[Recovery, ...]":
        """How long it took to get over each change; learns each changed world from nothing, to compare."""
        from qualrl.learning.recovery import recovery_of

        return recovery_of(self)

    @cached_property
    def knew_map(self) -> "LearningRun | None":
        """The same run of a robot that knows the map, to compare; None for one that does."""
        from qualrl.learning.trainer import train

        return None if self.growth is None else train(self.model, self.algorithm, self.settings, self.seed)

    @property
    def total_steps(self) -> int:
        """Steps of all episodes."""
        return int(self.steps.sum())

    @cached_property
    def exact(self) -> ExactValues:
        """Exact optimal values of the model."""
        return exact_values(self.model.world)

    @cached_property
    def exact_values(self) -> NDArray[np.float64]:
        """(S,) optimal values by dynamic programming; those of the policy for a learner that evaluates one."""
        if not self.chooses:
            from qualrl.solving.policy_values import policy_values  # SciPy loads slowly, and few runs need it

            policy = policy_actions(self.model, self.settings.policy)
            return policy_values(self.model.world, policy, self.settings.epsilon)
        return self.exact.value

    @property
    def chooses(self) -> bool:
        """Whether the learner learns what to do, and not only what a policy is worth."""
        return not rule_named(self.algorithm).evaluates

    def action_values(self, state: int) -> NDArray[np.float64]:
        """(A,) learned values of a state's actions, shifted if the learner kept them so."""
        values: NDArray[np.float64] = (self.q if self.shifted_q is None else self.shifted_q)[state]
        return values

    @cached_property
    def max_error(self) -> float:
        """Largest difference between max_a Q(s, a) and the exact value, over the states that can reach the goal."""
        error = np.abs(self.q.max(axis=1) - self.exact_values)
        return float(error[self.model.can_reach].max())

    @cached_property
    def greedy_steps(self) -> int | None:
        """Steps from start to goal by the learned policy; None if it does not get there, or without a fixed start."""
        return self._walked(self.action_values) if self.chooses else None

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
