"""What a learner has seen of the world: how often each outcome of each action happened, and what follows from it.

S states, A actions, K outcomes, numbered as in ``stepping.happened``.  ``q`` is flat, row s * A + a;
``value`` (S,) is the largest of a state's q.  Certainty equivalence: an action is worth the mean over the outcomes
seen, which tends to the true mean as they add up (the law of large numbers; alpha_k = 1/k in the paper's terms).
"""

from typing import Any, NamedTuple

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_inline, compiled_part
from qualrl.kernels.stepping import Floats, largest


class Experience(NamedTuple):
    """Counts, and the rewards that backups use: shifted ones where values are shifted."""

    tries: NDArray[np.uint32]
    """(S * A,) how often each action was tried."""
    counts: NDArray[np.uint32]
    """(K,) how often each outcome happened; (1,) and unused where no action has but one."""
    reward: Floats
    """(A,) reward of a move on a grid, (K,) of an outcome in a table."""
    goal_reward: float
    """Reward of reaching a grid's goal."""
    leads_to: NDArray[np.uint32]
    """(S * A,) where each move on a grid was last seen to lead; (1,) and unused in a table."""
    before_start: NDArray[np.int64]
    """(S + 1,) outcomes that lead to state s are before[before_start[s]] .. before[before_start[s + 1]]."""
    before: NDArray[np.uint32]
    """(K,)"""
    row_of: NDArray[np.uint32]
    """(K,) row of each outcome of a table; (1,) and unused on grids."""


@compiled_inline
def remember(grid: Any, slip: Any, table: Any, seen: Any, row: Any, outcome: Any, s2: Any, n_actions: Any) -> Any:
    """Count an outcome.

    Returns (whether the same action has now been seen to lead to two of them, whether the world has changed: a move
    that led elsewhere before).
    """
    seen.tries[row] += 1
    differs, changed = False, False
    if grid is not None:
        move = row
        if slip is not None:
            seen.counts[outcome] += 1
            differs = seen.counts[outcome] < seen.tries[row]
            move = row - row % uint64(n_actions) + outcome % uint64(n_actions)
        changed = seen.tries[row] > 1 and uint64(seen.leads_to[move]) != s2
        seen.leads_to[move] = s2
    if table is not None:
        seen.counts[outcome] += 1
        differs = seen.counts[outcome] < seen.tries[row]
    return differs, changed


@compiled_part
def row_of_outcome(grid: Any, slip: Any, table: Any, seen: Any, outcome: Any, n_actions: Any) -> Any:
    """The row that an outcome belongs to."""
    row = uint64(outcome)
    if slip is not None:
        row = uint64(outcome) // uint64(n_actions)
    if table is not None:
        row = uint64(seen.row_of[outcome])
    return row


@compiled_part
def share(grid: Any, slip: Any, table: Any, seen: Any, outcome: Any, row: Any) -> Any:
    """How often an outcome happened among the tries of its row; 0 where it was never tried."""
    if seen.tries[row] == 0:
        return 0.0
    happened = 1.0
    if slip is not None:
        happened = seen.counts[outcome] / seen.tries[row]
    if table is not None:
        happened = seen.counts[outcome] / seen.tries[row]
    return happened


@compiled_inline
def backed_up(
    grid: Any, slip: Any, table: Any, seen: Any, value: Any, row: Any, a: Any, gamma: Any, n_actions: Any
) -> Any:
    """Mean of reward + gamma * value over the outcomes seen of a row that was tried."""
    total = 0.0
    if grid is not None:
        if slip is None:
            s2 = uint64(seen.leads_to[row])
            reward = seen.goal_reward if s2 == uint64(grid.goal) else seen.reward[a]
            total = reward + gamma * value[s2]
        if slip is not None:
            base = row - a
            for moved in range(n_actions):
                count = seen.counts[row * uint64(n_actions) + uint64(moved)]
                if count > 0:
                    s2 = uint64(seen.leads_to[base + uint64(moved)])
                    reward = seen.goal_reward if s2 == uint64(grid.goal) else seen.reward[moved]
                    total += count * (reward + gamma * value[s2])
            total /= seen.tries[row]
    if table is not None:
        for outcome in range(table.row_start[row], table.row_start[row + uint64(1)]):
            count = seen.counts[outcome]
            if count > 0:
                total += count * (seen.reward[outcome] + gamma * value[table.target[outcome]])
        total /= seen.tries[row]
    return total


@compiled_part
def likeliest(grid: Any, slip: Any, table: Any, seen: Any, row: Any, a: Any, n_actions: Any) -> Any:
    """The state that a row which was tried has led to most often."""
    if grid is not None:
        s2 = uint64(seen.leads_to[row])
        if slip is not None:
            most = uint64(a)
            for moved in range(n_actions):
                first = row * uint64(n_actions)
                if seen.counts[first + uint64(moved)] > seen.counts[first + most]:
                    most = uint64(moved)
            s2 = uint64(seen.leads_to[row - a + most])
    if table is not None:
        best = table.row_start[row]
        for outcome in range(best + 1, table.row_start[row + uint64(1)]):
            if seen.counts[outcome] > seen.counts[best]:
                best = outcome
        s2 = uint64(table.target[best])
    return s2


@compiled_part
def refreshed(
    grid: Any, slip: Any, table: Any, seen: Any, q: Any, value: Any, s: Any, gamma: Any, n_actions: Any
) -> Any:
    """Back up every action tried in a state; returns by how much its value changed."""
    base = s * uint64(n_actions)
    for a in range(n_actions):
        row = base + uint64(a)
        if seen.tries[row] > 0:
            q[row] = backed_up(grid, slip, table, seen, value, row, uint64(a), gamma, n_actions)
    best = largest(q, base, n_actions)
    change = abs(best - value[s])
    value[s] = best
    return change
