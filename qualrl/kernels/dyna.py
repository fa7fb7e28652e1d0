"""Dyna-Q (Sutton 1990): Q-learning on what happens, and on outcomes drawn from what has happened.

S states, A actions; see ``experience`` for the rest.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_inline
from qualrl.kernels.stepping import below, draw, largest, next_rate, rate_at, unit


class Dyna(NamedTuple):
    """Rows in the order they were first tried, and how many to replay a step."""

    order: NDArray[np.uint32]
    """(S * A,)"""
    steps: int


@compiled_inline
def learn_dyna(
    seen: Any, dyna: Any, visits: Any, rates: Any, q: Any, tried: Any, row: Any, s2: Any, over: Any, reward: Any,
    n_actions: Any,
) -> Any:  # fmt: skip
    """Q-learning on what just happened.  Returns how many rows were ever tried."""
    if seen.tries[row] == 1:
        dyna.order[tried] = row
        tried += 1
    alpha = rates.alpha
    if visits is not None:
        alpha = next_rate(visits, row)
    _update(q, rates.gamma, row, s2, over, reward, alpha, n_actions)
    return tried


@compiled_inline
def imagine(
    grid: Any, slip: Any, table: Any, seen: Any, dyna: Any, visits: Any, rates: Any, q: Any, tried: Any, n_actions: Any,
    r0: Any, r1: Any, r2: Any, r3: Any,
) -> Any:  # fmt: skip
    """Q-learning on outcomes drawn from what was seen.  Returns the stream."""
    for _ in range(dyna.steps):
        u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        row = uint64(dyna.order[below(u, uint64(tried))])
        if slip is not None:
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        if table is not None:
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        s2, over, reward = _remembered(grid, slip, table, seen, row, u, n_actions)
        alpha = rates.alpha
        if visits is not None:
            alpha = rate_at(visits.rate, visits.counts[row])
        _update(q, rates.gamma, row, s2, over, reward, alpha, n_actions)
    return r0, r1, r2, r3


@compiled_inline
def _remembered(grid: Any, slip: Any, table: Any, seen: Any, row: Any, u: Any, n_actions: Any) -> Any:
    """An outcome of a row, as likely as it was often: (next state, whether the episode is over, reward)."""
    if grid is not None:
        moved = row % uint64(n_actions)
        if slip is not None:
            first = row * uint64(n_actions)
            moved = _nth(seen.counts, first, first + uint64(n_actions - 1), unit(u) * seen.tries[row]) - first
        s2 = uint64(seen.leads_to[row - row % uint64(n_actions) + moved])
        over = s2 == uint64(grid.goal)
        reward = seen.goal_reward if over else seen.reward[moved]
    if table is not None:
        first, last = uint64(table.row_start[row]), uint64(table.row_start[row + uint64(1)]) - uint64(1)
        outcome = _nth(seen.counts, first, last, unit(u) * seen.tries[row])
        s2 = uint64(table.target[outcome])
        over = table.terminal[s2]
        reward = seen.reward[outcome]
    return s2, over, reward


@compiled_inline
def _nth(counts: Any, first: Any, last: Any, left: Any) -> Any:
    """Where among first..last the counts summed up pass ``left``."""
    at = first
    while at < last and left >= counts[at]:
        left -= counts[at]
        at += uint64(1)
    return at


@compiled_inline
def _update(q: Any, gamma: Any, row: Any, s2: Any, over: Any, reward: Any, alpha: Any, n_actions: Any) -> Any:
    target = reward
    if not over:
        target += gamma * largest(q, s2 * uint64(n_actions), n_actions)
    q[row] += alpha * (target - q[row])
