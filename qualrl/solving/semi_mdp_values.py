"""Solving a semi-MDP as an MDP (paper, equations (7) to (10)): exact, by policy iteration.

N states, P pairs.  V(i) = max over a of r(i,a) + sum over j of E[gamma^tau; j] V(j), equation (10).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from qualrl.errors import SettingError
from qualrl.models.semi_mdp import SemiMDP

MOST_ROUNDS = 1000
BETTER = 1e-12
"""An action must be better by this much, relatively, to replace another: rounding must not make policies go round."""


@dataclass(frozen=True, eq=False)
class SemiValues:
    """Optimal values and a policy of a semi-MDP."""

    value: NDArray[np.float64]
    """(N,)"""
    pair: NDArray[np.int64]
    """(N,) the best action of each state, as a pair; -1 in terminal states."""
    rounds: int


def semi_values(smdp: SemiMDP, reward: NDArray[np.float64] | None = None, terminal_value: float = 0.0) -> SemiValues:
    """Optimal values.  ``reward`` (P,) and ``terminal_value`` may stand in for the model's, as shifted ones do."""
    reward = smdp.reward if reward is None else reward
    acting = np.flatnonzero(~smdp.terminal)
    pair = np.full(len(smdp), -1, np.int64)
    pair[acting] = smdp.action_start[:-1][acting]
    if not len(acting):
        return SemiValues(np.full(len(smdp), terminal_value), pair, 0)
    starts = smdp.action_start[:-1][acting]
    for round_number in range(1, MOST_ROUNDS + 1):
        value = policy_values(smdp, pair, reward, terminal_value)
        q = reward + smdp.discounted @ value
        best = np.maximum.reduceat(q, starts)
        chosen = pair[acting]
        improved = best > q[chosen] + BETTER * np.abs(q[chosen])
        if not improved.any():
            return SemiValues(value, pair, round_number)
        pair[acting] = np.where(improved, _first_best(q, best, smdp, acting), chosen)
    raise SettingError(f"policies did not settle in {MOST_ROUNDS} rounds; choose gamma below {smdp.gamma}")


def policy_values(
    smdp: SemiMDP, pair: NDArray[np.int64], reward: NDArray[np.float64], terminal_value: float = 0.0
) -> NDArray[np.float64]:
    """(N,) values of a policy: V = r + F V, solved at once.  pair (N,): its action in each state, -1 if terminal."""
    value = np.full(len(smdp), terminal_value)
    acting = np.flatnonzero(~smdp.terminal)
    if len(acting):
        chosen = smdp.discounted[pair[acting]]
        ended = np.asarray(chosen @ np.where(smdp.terminal, terminal_value, 0.0))
        matrix = sparse.eye_array(len(acting), format="csc") - sparse.csc_array(chosen[:, acting])
        value[acting] = splu(sparse.csc_array(matrix)).solve(reward[pair[acting]] + ended)
    return value


def _first_best(
    q: NDArray[np.float64], best: NDArray[np.float64], smdp: SemiMDP, acting: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The first pair of each acting state that is worth as much as its best."""
    spread = np.full(len(smdp), np.inf)
    spread[acting] = best
    good = np.flatnonzero(q >= spread[smdp.source])
    states, first = np.unique(smdp.source[good], return_index=True)
    assert len(states) == len(acting)
    found: NDArray[np.int64] = good[first]
    return found
