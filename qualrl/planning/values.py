"""The values a plan is made from: exact ones or learned ones, seen the same way.

S states, A actions.  Values are shifted (see ``kernels.bellman``); ``plain`` takes the shift off again.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.run import LearningRun
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import ExactValues, action_values


@dataclass(frozen=True, eq=False)
class PlanValues:
    """State values, and action values on demand."""

    source: str
    """"exact" or the learner's name."""
    shifted: NDArray[np.float64]
    """(S,)"""
    shift: float
    actions: Callable[[int], NDArray[np.float64]]
    """From a state to the (A,) shifted values of its actions."""

    def plain(self, shifted: float) -> float:
        """A value as rewards add up to it, from a shifted one."""
        return float(shifted - self.shift)


def exact_plan_values(model: HybridMDP, solved: ExactValues) -> PlanValues:
    """Values by dynamic programming."""

    def actions(state: int) -> NDArray[np.float64]:
        return action_values(model.world, solved.shifted, solved.shift, state)

    return PlanValues("exact", solved.shifted, solved.shift, actions)


def learned_plan_values(run: LearningRun) -> PlanValues:
    """Values as a learner left them."""
    shift = run.exact.shift
    shifted = run.q + shift if run.shifted_q is None else run.shifted_q

    def actions(state: int) -> NDArray[np.float64]:
        learned: NDArray[np.float64] = shifted[state]
        return learned

    return PlanValues(run.algorithm, shifted.max(axis=1), shift, actions)
