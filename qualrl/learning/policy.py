"""Policies by name, for learners that evaluate one."""

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import action_values, exact_values


def policy_actions(model: HybridMDP, policy: str) -> NDArray[np.int8]:
    """(S,) action of each state of a policy by name; -1 for any of them at random."""
    actions = np.full(len(model), -1, np.int8)
    if policy == "optimal":
        exact = exact_values(model.world)
        for state in np.flatnonzero(model.can_reach):
            actions[state] = np.argmax(action_values(model.world, exact.shifted, exact.shift, int(state)))
    return actions
