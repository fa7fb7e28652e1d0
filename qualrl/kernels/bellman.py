"""Dynamic programming by Gauss-Seidel sweeps, outward from the goal and up from a lower bound.

Values are *shifted*: W = V + K with K = -r_min / (1 - gamma), so that W >= 0 everywhere and rewards
become r - r_min.  The policy is the same, and far from the goal, where V differs from r_min / (1 - gamma)
by less than float64 can hold, W still tells places apart (its relative error is what is bounded).
"""

from typing import Any

import numpy as np

from qualrl.kernels.jit import compiled


@compiled
def grid_backup(
    successor: Any, reward: Any, goal: Any, goal_value: Any, gamma: Any, slip: Any, value: Any, s: Any, q: Any
) -> Any:
    """The shifted Q values of state s, written to q (A,); returns the largest.

    successor (S, A); reward (A,) shifted; a move that reaches the goal is worth goal_value.
    With probability slip one of the other moves happens, each as likely.
    """
    n_actions = successor.shape[1]
    total = 0.0
    for a in range(n_actions):
        t = successor[s, a]
        q[a] = goal_value if t == goal else reward[a] + gamma * value[t]
        total += q[a]
    best = -np.inf
    for a in range(n_actions):
        if slip > 0.0:
            q[a] = (1.0 - slip) * q[a] + slip / (n_actions - 1) * (total - q[a])
        if q[a] > best:
            best = q[a]
    return best


@compiled
def solve_grid(
    successor: Any,
    reward: Any,
    goal: Any,
    goal_value: Any,
    gamma: Any,
    slip: Any,
    order: Any,
    value: Any,
    tolerance: Any,
    max_sweeps: Any,
) -> Any:
    """Sweep the states of ``order`` until none changes by more than tolerance times itself; the sweeps made.

    States that are not in ``order`` keep their value: they are the boundary.
    """
    q = np.empty(successor.shape[1])
    for sweep in range(max_sweeps):
        change = 0.0
        for s in order:
            best = grid_backup(successor, reward, goal, goal_value, gamma, slip, value, s, q)
            change = max(change, abs(best - value[s]) / max(best, 1e-300))
            value[s] = best
        if change <= tolerance:
            return sweep + 1
    return -1


@compiled
def fewest_crossings(
    successor: Any,
    reward: Any,
    goal: Any,
    goal_value: Any,
    gamma: Any,
    slip: Any,
    order: Any,
    value: Any,
    region_of: Any,
) -> Any:
    """(S,) int32: how often the best way to the goal changes region, among the ways that are equally good.

    order: states outward from the goal; value (S,): exact shifted values.
    """
    crossings = np.full(value.size, 2**30, np.int32)
    crossings[goal] = 0
    q = np.empty(successor.shape[1])
    for s in order:
        best = grid_backup(successor, reward, goal, goal_value, gamma, slip, value, s, q)
        for a in range(q.size):
            t = successor[s, a]
            if t != s and q[a] >= best - 1e-12 * abs(best):
                crossings[s] = min(crossings[s], crossings[t] + (region_of[s] != region_of[t]))
    return crossings


@compiled
def table_backup(
    row_start: Any, target: Any, probability: Any, reward: Any, gamma: Any, value: Any, s: Any, q: Any
) -> Any:
    """The shifted Q values of state s of a table, written to q (A,); returns the largest."""
    best = -np.inf
    for a in range(q.size):
        row = s * q.size + a
        q[a] = 0.0
        for e in range(row_start[row], row_start[row + 1]):
            q[a] += probability[e] * (reward[e] + gamma * value[target[e]])
        if q[a] > best:
            best = q[a]
    return best


@compiled
def solve_table(
    row_start: Any,
    target: Any,
    probability: Any,
    reward: Any,
    terminal: Any,
    gamma: Any,
    order: Any,
    value: Any,
    n_actions: Any,
    tolerance: Any,
    max_sweeps: Any,
) -> Any:
    """As ``solve_grid``, for a table; terminal states keep their value."""
    q = np.empty(n_actions)
    for sweep in range(max_sweeps):
        change = 0.0
        for s in order:
            if terminal[s]:
                continue
            best = table_backup(row_start, target, probability, reward, gamma, value, s, q)
            change = max(change, abs(best - value[s]) / max(best, 1e-300))
            value[s] = best
        if change <= tolerance:
            return sweep + 1
    return -1
