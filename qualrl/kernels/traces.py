"""The loop of the learners that choose the next action before they learn: SARSA, SARSA(lambda), Watkins's Q(lambda).

S states, A actions.  ``q`` is flat: row s * A + a.  See ``stepping`` for what None means.

Replacing traces (Singh and Sutton 1996), exact and at a cost of A a step whatever lambda is (Wiering and Schmidhuber
1998): the updates of all rows on the trace differ only by a factor, so ``owed`` sums up what a row that was visited
when ``fade`` was 1 should have got, and a row is given its share when it is next looked at.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.stepping import (
    OWN_REAL,
    OWN_WHOLE,
    Floats,
    below,
    draw,
    ended,
    greedy,
    happened,
    largest,
    left_off,
    next_rate,
    resumed,
    started,
)

NEXT, ON_TRACE = range(OWN_WHOLE, OWN_WHOLE + 2)
OWED, FADE = range(OWN_REAL, OWN_REAL + 2)
FADED = 1e-3
"""Sums are started anew when ``fade`` falls below this, before they lose digits."""
FORGOTTEN = 1e-10
"""A row whose update is below this share of the error is off the trace."""


class Trace(NamedTuple):
    """Eligibility traces."""

    decay: float
    """gamma * lambda."""
    rows: NDArray[np.uint32]
    """(S * A,) rows on the trace."""
    weight: Floats
    """(S * A,) alpha / fade at the row's visit; 0 = not on the trace."""
    given: Floats
    """(S * A,) ``owed`` when the row last got its share."""


@compiled_part
def _give(q: Any, trace: Any, row: Any, owed: Any) -> Any:
    """Give a row its share of what has been owed since."""
    if trace.weight[row] > 0.0:
        q[row] += trace.weight[row] * (owed - trace.given[row])
        trace.given[row] = owed


@compiled_part
def _start_anew(q: Any, trace: Any, size: Any, owed: Any, fade: Any) -> Any:
    """Give every row its share, and sum up from 0 again; fade = 0 ends the trace.  Returns how many rows stay."""
    kept = 0
    for i in range(size):
        row = trace.rows[i]
        _give(q, trace, row, owed)
        trace.weight[row] *= fade
        trace.given[row] = 0.0
        if trace.weight[row] > FORGOTTEN:
            trace.rows[kept] = row
            kept += 1
        else:
            trace.weight[row] = 0.0
    return kept


@compiled_bare
def run_ahead(
    grid: Any,
    slip: Any,
    table: Any,
    trace: Any,
    on_policy: Any,
    visits: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    q: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps; see ``learning.run_steps``.

    trace: Trace, or None.  on_policy: True for SARSA's target, None for that of Q-learning, where an exploring
    action ends the trace.  visits: Visits, or None for the constant rates.alpha.
    """
    n_actions = len(actions)
    alpha, gamma = rates.alpha, rates.gamma
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, at_first, t, episode, total = resumed(progress)
    whole, real = progress.whole, progress.real
    s, a, size = uint64(at_first), uint64(whole[NEXT]), whole[ON_TRACE]
    owed, fade = real[OWED], real[FADE]
    episodes = progress.steps.size
    done = 0
    while done < n_steps and episode < episodes:
        if t == 0:
            s, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            a = (
                below(u, uint64(n_actions))
                if (u >> uint64(32)) < explore
                else greedy(q, s * uint64(n_actions), n_actions, u)
            )
            total, owed, fade = 0.0, 0.0, 1.0
        row = s * uint64(n_actions) + a
        until, over = t + n_steps - done, False
        if until > rates.max_steps:
            until = rates.max_steps
        done -= t
        while not over and t < until:
            if visits is not None:
                alpha = next_rate(visits, row)
            if trace is not None:
                _give(q, trace, row, owed)
                if trace.weight[row] == 0.0:
                    trace.rows[size] = row
                    size += 1
                trace.weight[row] = alpha / fade
                trace.given[row] = owed
            s2, next_row, over, reward, _, r0, r1, r2, r3 = happened(grid, slip, table, s, a, n_actions, r0, r1, r2, r3)
            error = reward - q[row]
            on_course = False
            t += 1
            if not over:
                if trace is not None:
                    for b in range(n_actions):
                        _give(q, trace, next_row + uint64(b), owed)
                    error = reward - q[row]  # which may be one of them
                u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                a = below(u, uint64(n_actions)) if (u >> uint64(32)) < explore else greedy(q, next_row, n_actions, u)
                best = largest(q, next_row, n_actions)
                on_course = t < rates.max_steps
                if on_policy is not None:
                    error += gamma * q[next_row + a]
                if on_policy is None:
                    error += gamma * best
                    on_course = on_course and q[next_row + a] == best
            if trace is None:
                q[row] += alpha * error
            if trace is not None:
                owed += error * fade
                fade *= trace.decay
                if not on_course or fade < FADED:
                    size = _start_anew(q, trace, size, owed, fade if on_course else 0.0)
                    owed, fade = 0.0, 1.0
            total += reward
            s = s2
            row = next_row + a
        done += t
        if over or t >= rates.max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    whole[NEXT], whole[ON_TRACE], real[OWED], real[FADE] = a, size, owed, fade
    return done
