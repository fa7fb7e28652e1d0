"""The training loop, compiled: one source for every learner that bootstraps after each step.

S states, A actions, L landmarks, E arcs (or table entries).  ``q`` is flat: Q(s, a) is q[s * A + a].
What a learner or a world does not have is passed as None (see ``stepping``).
A call runs a number of steps and leaves everything it needs to go on in its arrays, so a run can be
watched, stopped and resumed between calls without changing its result.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_inline
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
    rate_at,
    resumed,
    started,
)

# Slots of Progress.whole and Progress.real that are this loop's own
LANDMARK, LEFT_AT, LEFT_BY, ETA_STEPS = range(OWN_WHOLE, OWN_WHOLE + 4)
MACRO_RETURN, MACRO_DISCOUNT = range(OWN_REAL, OWN_REAL + 2)

COUNT_RUN, COUNT_PAIR, COUNT_EPISODE = range(3)


class Upper(NamedTuple):
    """The level of landmarks: arcs of landmark l are arc_start[l]..arc_start[l + 1]."""

    landmark_of: NDArray[np.int32]
    """(S,) landmark of each state, -1 for none."""
    arc_start: NDArray[np.int64]
    arc_target: NDArray[np.int32]
    arc_q: Floats
    """(E,) value of each arc, updated."""
    arc_visits: NDArray[np.int64]
    """(E,) how often each arc was travelled, updated."""
    pair_count: NDArray[np.int64]
    """(L * A,) how often the landmark step was made for each landmark and action, updated."""
    arc_rate: Floats
    """Learning rate of an arc by how often it was travelled, as ``stepping.rate_at`` reads it."""
    eta: Floats
    """(N,) weight of the n-th landmark step; those after the last weigh nothing."""
    counter: int
    """What n counts: COUNT_RUN, COUNT_PAIR or COUNT_EPISODE."""
    whole_stay: bool
    """Whether a macro starts when the landmark is reached; else at its last departure."""
    once: bool
    """Whether what follows a macro is discounted by gamma once, as step (i) is printed; else by gamma ** tau."""


@compiled_inline
def _best_arc(upper: Any, landmark: Any) -> Any:
    """The largest value among the travelled arcs of a landmark; 0 if none was travelled yet."""
    best = -np.inf
    for arc in range(upper.arc_start[landmark], upper.arc_start[landmark + 1]):
        if upper.arc_visits[arc] > 0 and upper.arc_q[arc] > best:
            best = upper.arc_q[arc]
    return best if best > -np.inf else 0.0


@compiled_inline
def _landmark_step(
    q: Any,
    upper: Any,
    gamma: Any,
    left: Any,
    arrived: Any,
    at: Any,
    by: Any,
    n_actions: Any,
    macro_return: Any,
    macro_discount: Any,
    over: Any,
    eta_steps: Any,
) -> Any:
    """Equation (11) for the arc left -> arrived, then step (ii) of Algorithm 2; the new eta count.

    ``at``, ``by``: the state and action of the last departure from landmark ``left``.
    """
    arc = upper.arc_start[left]
    while upper.arc_target[arc] != arrived:
        arc += 1
        if arc == upper.arc_start[left + 1]:
            return eta_steps  # no arc of the model: the two landmarks share no region
    target = macro_return
    if not over:
        target += (gamma if upper.once else macro_discount) * _best_arc(upper, arrived)
    upper.arc_q[arc] += rate_at(upper.arc_rate, upper.arc_visits[arc]) * (target - upper.arc_q[arc])
    upper.arc_visits[arc] += 1
    pair = left * n_actions + by
    n = upper.pair_count[pair] if upper.counter == COUNT_PAIR else eta_steps
    upper.pair_count[pair] += 1
    if n < upper.eta.size:
        q[at * n_actions + by] += upper.eta[n] * (upper.arc_q[arc] - q[at * n_actions + by])
    return eta_steps + 1


@compiled_bare
def run_steps(
    grid: Any,
    slip: Any,
    table: Any,
    upper: Any,
    policy: Any,
    visits: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    q: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps of one-step Q-learning, with the landmark level when ``upper`` is given.

    policy: (S,) int8 action of each state, -1 for any at random, or None.  When given, TD(0) evaluates it (with the
    share epsilon of random actions) and ``q`` is V (S,).  visits: Visits, or None for the constant rates.alpha.

    grid: Grid, or None when table: Table is given.  slip: float, or None for moves that never fail.
    actions: a tuple of A things; only its length counts, so that A is known when the loop is compiled.
    starts (N,) int64: each episode starts in one of them.  Returns the number of steps made, which is
    smaller than n_steps only when all episodes of ``progress.steps`` are done.
    """
    n_actions = len(actions)
    alpha, gamma = rates.alpha, rates.gamma
    max_steps = rates.max_steps
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, at_first, t, episode, total = resumed(progress)
    whole, real = progress.whole, progress.real
    s = uint64(at_first)
    landmark, left_at, left_by = whole[LANDMARK], whole[LEFT_AT], whole[LEFT_BY]
    eta_steps = whole[ETA_STEPS]
    macro_return, macro_discount = real[MACRO_RETURN], real[MACRO_DISCOUNT]
    episodes = progress.steps.size
    done = 0
    while done < n_steps and episode < episodes:
        if t == 0:
            s, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            total = 0.0
            if upper is not None:
                landmark, left_at = upper.landmark_of[s], -1
                if upper.counter == COUNT_EPISODE:
                    eta_steps = 0
        row = s * uint64(n_actions)
        until, over = t + n_steps - done, False
        if until > max_steps:
            until = max_steps
        done -= t
        while not over and t < until:  # one test a step: what else ends a step is met outside
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            at = s
            if policy is None:
                a = below(u, uint64(n_actions)) if (u >> uint64(32)) < explore else greedy(q, row, n_actions, u)
                at = row + a
            if policy is not None:
                a = below(u, uint64(n_actions))
                if (u >> uint64(32)) >= explore and policy[s] >= 0:
                    a = uint64(policy[s])
            if visits is not None:
                alpha = next_rate(visits, at)
            s2, row2, over, reward, _, r0, r1, r2, r3 = happened(grid, slip, table, s, a, n_actions, r0, r1, r2, r3)
            known, target = q[at], reward  # read before what follows has to be waited for
            if not over:
                if policy is None:
                    target += gamma * largest(q, row2, n_actions)
                if policy is not None:
                    target += gamma * q[s2]
            q[at] = known + alpha * (target - known)
            total += reward
            t += 1
            if upper is not None:
                at_home = landmark >= 0 and upper.landmark_of[s] == landmark
                if at_home and (left_at < 0 or not upper.whole_stay):
                    left_at, left_by, macro_return, macro_discount = int64(s), int64(a), 0.0, 1.0
                macro_return += macro_discount * reward
                macro_discount *= gamma
                here = upper.landmark_of[s2]
                if here >= 0 and here != landmark:
                    if landmark >= 0:
                        eta_steps = _landmark_step(
                            q,
                            upper,
                            gamma,
                            landmark,
                            here,
                            left_at,
                            left_by,
                            n_actions,
                            macro_return,
                            macro_discount,
                            over,
                            eta_steps,
                        )
                    landmark, left_at = here, -1
            s, row = s2, row2
        done += t
        if over or t >= max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    whole[LANDMARK], whole[LEFT_AT], whole[LEFT_BY], whole[ETA_STEPS] = landmark, left_at, left_by, eta_steps
    real[MACRO_RETURN], real[MACRO_DISCOUNT] = macro_return, macro_discount
    return done
