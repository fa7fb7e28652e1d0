"""Dynamic programming by Gauss-Seidel sweeps, outward from the goal.

Values are *shifted*: W = V + K with K = -r_min / (1 - gamma), so that W >= 0 everywhere and rewards
become r - r_min.  The policy is the same, and far from the goal, where V differs from r_min / (1 - gamma)
by less than float64 can hold, W still tells places apart (its relative error is what is bounded).
"""

from typing import Any

import numpy as np
from numba import int64, uint64

from qualrl.kernels.jit import compiled, compiled_bare

FIRST, REACHED, SWEEPS, SURE = range(4)
MOST_RELAXED = 100_000
"""After so many sweeps no step is longer than to its backup: that way values settle for sure."""


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


@compiled_bare
def number_outward(successor: Any, states: Any, number: Any, near: Any) -> None:
    """Write the place of each state in ``states`` (S,) to number (S,), and to near (N, A) where moves lead by those.

    successor (S, A); the moves asked for are those of the first N of ``states``.
    """
    for i in range(states.size):
        number[states[i]] = i
    for i in range(near.shape[0]):
        for a in range(near.shape[1]):
            near[i, a] = number[successor[states[i], a]]


@compiled
def settle_grid(
    near: Any,
    layer_end: Any,
    reward: Any,
    goal: Any,
    goal_value: Any,
    gamma: Any,
    slip: Any,
    relaxation: Any,
    value: Any,
    waiting: Any,
    at: Any,
    tolerance: Any,
    floor: Any,
    max_sweeps: Any,
) -> Any:
    """Sweep states until none is further from its backup than tolerance times itself, or times the floor.

    Returns the sweeps made, or -1 if that was not enough.

    The N states are numbered outward from the goal, so that a sweep hands values outward, and
    layer_end[k] is the end of layer k.  near (N, A): where moves lead; from N on: states with values that stay.
    reward: as in ``grid_backup``, but a tuple, so that loops over actions unroll.
    Each sweep takes in one more layer: farther ones would start from values that are still wrong.
    A state waits for its backup, waiting (N + B,) bool, while its own value or one beside it changes; at the
    end a sweep over all states makes sure.  relaxation: steps to the backup are so many times as long.
    ``at``: (FIRST, REACHED, SWEEPS, SURE), all 0 at first, kept from call to call.
    """
    n, n_actions = near.shape[0], len(reward)
    other = slip / (n_actions - 1)
    chosen = 1.0 - slip - other
    for sweep in range(max_sweeps):
        first = at[FIRST]
        while first < n and not waiting[first]:
            first += 1
        if first == n and at[SURE]:
            return sweep
        if first == n:
            waiting[:], first, at[SURE], at[REACHED] = True, 0, 1, layer_end.size - 1
        ahead = 1.0 if at[SURE] or at[SWEEPS] > MOST_RELAXED else relaxation
        back, sure = first, at[SURE]
        for s in range(uint64(first), uint64(layer_end[at[REACHED]])):
            if not waiting[s]:
                continue
            waiting[s] = False
            best, worst, total = -np.inf, np.inf, 0.0
            for a in range(n_actions):
                t = near[s, uint64(a)]
                worth = goal_value if t == goal else reward[a] + gamma * value[t]
                best, worst, total = max(best, worth), min(worst, worth), total + worth
            backup = chosen * (best if chosen >= 0.0 else worst) + other * total
            change = backup - value[s]
            value[s] = backup + (ahead - 1.0) * change
            if abs(change) > tolerance * max(backup, floor):
                waiting[s], sure = True, 0
                for a in range(n_actions):
                    t = near[s, uint64(a)]
                    waiting[t] = True
                    back = min(back, int64(t))
        at[FIRST], at[SURE], at[SWEEPS] = back, sure, at[SWEEPS] + 1
        at[REACHED] = min(at[REACHED] + 1, layer_end.size - 1)
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
    floor: Any,
    max_sweeps: Any,
) -> Any:
    """Sweep the states of ``order`` until none changes by more than tolerance times itself, or times the floor.

    Returns the sweeps made, or -1 if that was not enough.  Terminal states keep their value, as do those that are
    not in ``order``.
    """
    q = np.empty(n_actions)
    for sweep in range(max_sweeps):
        change = 0.0
        for s in order:
            if terminal[s]:
                continue
            best = table_backup(row_start, target, probability, reward, gamma, value, s, q)
            change = max(change, abs(best - value[s]) / max(best, floor))
            value[s] = best
        if change <= tolerance:
            return sweep + 1
    return -1
