"""Exact values of a given policy, by one sparse linear solve (paper, Definition 1: the criterion V for a fixed policy).

S states, A actions.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.sparse.linalg import spsolve

from qualrl.models.grid_world import GridWorld
from qualrl.solving.exact import World


def policy_values(world: World, actions: NDArray[np.int8], epsilon: float = 0.0) -> NDArray[np.float64]:
    """(S,) values of taking actions[s] (-1: any at random), and with probability epsilon any at random instead."""
    table = world.table() if isinstance(world, GridWorld) else world
    n_states, n_actions = len(table), table.n_actions
    share = np.full((n_states, n_actions), 1.0 / n_actions)
    chosen = np.flatnonzero(actions >= 0)
    share[chosen] = epsilon / n_actions
    share[chosen, actions[chosen]] += 1.0 - epsilon
    share[table.terminal] = 0.0
    reward, transition = np.zeros(n_states), csr_array((n_states, n_states))
    for action in range(n_actions):
        reward += share[:, action] * table.expected_reward[:, action]
        transition = transition + diags_array(share[:, action]) @ table.transition(action)
    onward = transition @ diags_array((~table.terminal).astype(np.float64))
    value: NDArray[np.float64] = spsolve((eye_array(n_states) - table.gamma * onward).tocsc(), reward)
    return value
