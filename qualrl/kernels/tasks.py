"""The training loop of learners that choose where to go before they choose a move; compiled.

S states, A moves, O options ("go to landmark l within region g"), K options that live in a state, C kinds of
states (states of one kind have the same K options).  A state's row of ``q`` holds its K + A top choices, the
options first and then the moves, and after them, for learners that learn how to carry an option out, K blocks
of A moves.  What may not be chosen is -inf.  What a learner does not have is passed as None (see ``stepping``).
A call runs a number of steps and leaves everything it needs to go on in its arrays.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_inline, compiled_part
from qualrl.kernels.stepping import (
    OWN_REAL,
    OWN_WHOLE,
    below,
    draw,
    ended,
    happened,
    left_off,
    next_rate,
    resumed,
    started,
)

# Slots of Progress.whole and Progress.real that are this loop's own
RUNNING, PENDING = range(OWN_WHOLE, OWN_WHOLE + 2)
GAIN, DISCOUNT = range(OWN_REAL, OWN_REAL + 2)


class Rows(NamedTuple):
    """Where everything about a state stands."""

    first: NDArray[np.int64]
    """(S,) where the row of each state begins."""
    kind_of: NDArray[np.int32]
    """(S,)"""
    option_start: NDArray[np.int64]
    """(C + 1,) the options of kind c are option[option_start[c]] .. option[option_start[c + 1]]."""
    option: NDArray[np.int32]
    position: NDArray[np.int32]
    """(C * O,) place of an option among those of a kind, -1 where it does not live."""
    base_after: NDArray[np.unsignedinteger]
    """(S * A,) where in ``position`` the kind begins of the state that each move on a grid leads to; (1,) and unused in
    a table."""
    first_after: NDArray[np.unsignedinteger]
    """The same for where its row begins; by top choice, as ``q``, where each makes one move that never slips."""


class Spot(NamedTuple):
    """Where a state's numbers stand."""

    row: int
    k: int
    """How many options it has."""
    start: int
    """Where they stand in ``Rows.option``."""
    base: int
    """Where its kind begins in ``Rows.position``; another for each kind."""


class Agents(NamedTuple):
    """Sub-agents: one an option, each learning a Q of its own from every step."""

    landmark: NDArray[np.int32]
    """(O,) where each wants to be."""
    landmark_of: NDArray[np.int32]
    """(S,)"""


@compiled_inline
def scan(q: Any, low: Any, high: Any) -> Any:
    """(largest of q[low:high], where it stands first, how often it is there)."""
    best, where, ties = q[uint64(low)], uint64(low), 1
    for i in range(uint64(low) + uint64(1), uint64(high)):
        if q[i] > best:
            best, where, ties = q[i], i, 1
        elif q[i] == best:
            ties += 1
    return best, int64(where), ties


@compiled_part
def chosen(q: Any, low: Any, high: Any, best: Any, ties: Any, exploring: Any, u: Any) -> Any:
    """A place in q[low:high], each as likely: any that is open when exploring, otherwise one of the ``ties`` best."""
    count = ties
    if exploring:
        count = 0
        for i in range(low, high):
            count += q[i] > -np.inf
    skip = int64(below(u, uint64(count)))
    place = low
    while skip > 0 or not (q[place] > -np.inf if exploring else q[place] == best):
        if q[place] > -np.inf if exploring else q[place] == best:
            skip -= 1
        place += 1
    return place


@compiled_inline
def spot_of(rows: Any, n_options: Any, s: Any) -> Any:
    """Where the numbers of a state stand."""
    kind = uint64(rows.kind_of[s])
    start = rows.option_start[kind]
    k = rows.option_start[kind + uint64(1)] - start
    return Spot(rows.first[uint64(s)], k, start, int64(kind) * n_options)


@compiled_inline
def _spot_after(
    grid: Any, slip: Any, rows: Any, policy: Any, n_options: Any, here: Any, place: Any, s: Any, s2: Any, outcome: Any,
    n_actions: Any,
) -> Any:  # fmt: skip
    """The same for s2, to which a step from s led, where ``here`` is the spot.

    On a grid what the next step waits for is looked up by the move, while s2 itself is; or by the choice at ``place``,
    before its move is known.
    """
    if grid is None:
        row, base = rows.first[s2], int64(rows.kind_of[s2]) * n_options
    if grid is not None:
        move = outcome
        if slip is not None:
            move = s * uint64(n_actions) + outcome % uint64(n_actions)
        by = move
        if slip is None and policy is not None:
            by = uint64(here.row + place)
        row, base = int64(rows.first_after[by]), int64(rows.base_after[move])
    k, start = here.k, here.start
    if base != here.base:
        _, k, start, _ = spot_of(rows, n_options, s2)
    return Spot(row, k, start, base)


@compiled_inline
def _learn(q: Any, visits: Any, alpha: Any, entry: Any, target: Any) -> Any:
    """Move an entry towards a target, by alpha or, with visits, by the rate that has come to it."""
    if visits is not None:
        alpha = next_rate(visits, entry)
    entry = uint64(entry)
    q[entry] += alpha * (target - q[entry])


@compiled_inline
def _look(q: Any, visits: Any, alpha: Any, low: Any, high: Any, pending: Any, gain: Any, discount: Any) -> Any:
    """``scan`` of the choices low..high, from which the choice made before (-1: none) has learned by then."""
    best, pick, ties = scan(q, low, high)
    if pending >= 0:
        _learn(q, visits, alpha, pending, gain + discount * best)
        if low <= pending < high:
            best, pick, ties = scan(q, low, high)
    return best, pick, ties


@compiled_inline
def _learn_options(
    q: Any, visits: Any, rates: Any, rows: Any, policy: Any, n_actions: Any, here: Any, there: Any, a: Any, over: Any,
    reward: Any,
) -> Any:  # fmt: skip
    """All choices that agree with the move made learn from it; what is left of an option, or the best after it."""
    best = 0.0
    if not over:
        best, _, _ = scan(q, there.row, there.row + there.k + n_actions)
    for x in range(here.k + n_actions):
        if policy[here.row + x] == a:
            value = best
            if x < here.k and not over:
                place = int64(rows.position[there.base + rows.option[here.start + x]])
                if place >= 0 and q[there.row + place] > -np.inf:
                    value = q[there.row + place]
            _learn(q, visits, rates.alpha, here.row + x, reward + rates.gamma * value)


@compiled_part
def _worth(q: Any, n_actions: Any, there: Any, worst: Any) -> Any:
    """The best that any sub-agent of a state hopes for; ``worst`` where there is none."""
    worth, found = worst, False
    for x in range(there.k):
        if q[there.row + x] > -np.inf:
            low = there.row + there.k + n_actions + x * n_actions
            best = scan(q, low, low + n_actions)[0]
            if not found or best > worth:
                worth = best
            found = True
    return worth


@compiled_inline
def _learn_agents(
    q: Any, visits: Any, rates: Any, rows: Any, agents: Any, worst: Any, n_actions: Any, here: Any, there: Any, s2: Any,
    a: Any, over: Any, reward: Any,
) -> Any:  # fmt: skip
    """Every sub-agent of a state learns from the step to s2; with ``worst`` also how much it minds not being obeyed.

    worst: None when arriving pays 1 and nothing else pays; else sub-agents are paid in the world's rewards, what
    their landmark is worth on arriving, and ``worst`` for ending anywhere else than there or at the goal.
    """
    for x in range(here.k):
        if q[here.row + x] > -np.inf:
            o = rows.option[here.start + x]
            place = rows.position[there.base + o]
            arrived = agents.landmark_of[s2] == agents.landmark[o]
            value = 0.0
            if not over and not arrived and place >= 0 and q[there.row + place] > -np.inf:
                low = there.row + there.k + n_actions + place * n_actions
                value = scan(q, low, low + n_actions)[0]
            elif worst is not None and not over:
                value = _worth(q, n_actions, there, worst) if arrived else worst
            target = rates.gamma * value
            if worst is None and arrived:
                target = 1.0
            if worst is not None:
                target += reward
            low = here.row + here.k + n_actions + x * n_actions
            if worst is not None:
                wanted = scan(q, low, low + n_actions)[0]
                if q[low + a] < wanted:
                    _learn(q, visits, rates.alpha, here.row + x, wanted - target)
            _learn(q, visits, rates.alpha, low + a, target)


@compiled_bare
def run_steps(
    grid: Any,
    slip: Any,
    table: Any,
    rows: Any,
    policy: Any,
    intra: Any,
    machine: Any,
    agents: Any,
    worst: Any,
    visits: Any,
    tries: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    q: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps; the world, ``actions``, ``starts`` and what is returned as in ``learning``.

    policy: the move of each top choice, for options whose way is given; ``intra`` (anything): every option learns
    from every step, not only the one that acts when it ends.
    machine (anything): the moves of an option are choices too, and each choice learns at the next one.
    agents: Agents; who acts is chosen anew at each step, by what the switch has learned or, when ``worst`` is
    given, by how much each minds not being obeyed.
    visits: Visits of each entry of q, or None for the constant rates.alpha.
    tries: (S * A,) how often each move was made in each state, updated; or None.
    """
    n_actions = len(actions)
    alpha, gamma = rates.alpha, rates.gamma
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, s, t, episode, total = resumed(progress)
    whole, real = progress.whole, progress.real
    running, pending = whole[RUNNING], whole[PENDING]
    gain, discount = real[GAIN], real[DISCOUNT]
    n_options = rows.position.size // (rows.option_start.size - 1)
    episodes = progress.steps.size
    done = 0
    a = int64(0)
    here = spot_of(rows, n_options, s)
    while done < n_steps and episode < episodes:
        if t == 0:
            at, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            s, total, running, pending = int64(at), 0.0, -1, -1
            here = spot_of(rows, n_options, s)
        place = int64(rows.position[here.base + running]) if running >= 0 else int64(-1)
        until, over = t + n_steps - done, False
        if until > rates.max_steps:
            until = rates.max_steps
        done -= t
        while not over and t < until:
            if running < 0:
                high = here.row + here.k + n_actions
                best, pick, ties = _look(q, visits, alpha, here.row, high, pending, gain, discount)
                u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                exploring = worst is None and (u >> uint64(32)) < explore
                if exploring or ties > 1:
                    pick = chosen(q, here.row, high, best, ties, exploring, u)
                gain, discount = 0.0, 1.0
                if worst is None:
                    pending = pick
                place = pick - here.row
                a = place - here.k
                if a < 0:
                    running = int64(rows.option[here.start + place])
            if running >= 0:
                if policy is not None:
                    a = int64(policy[uint64(here.row + place)])
                if policy is None:
                    low = here.row + here.k + n_actions + place * n_actions
                    waits = pending if machine is not None else int64(-1)
                    best, pick, ties = _look(q, visits, alpha, low, low + n_actions, waits, gain, discount)
                    u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                    exploring = (u >> uint64(32)) < explore
                    if exploring or ties > 1:
                        pick = chosen(q, low, low + n_actions, best, ties, exploring, u)
                    a = pick - low
                    if machine is not None:
                        pending, gain, discount = pick, 0.0, 1.0
                    if agents is not None and q[pick] < best:
                        pending = -1  # a move tried out, not the sub-agent's: the switch learns nothing from it
            if tries is not None:
                tries[uint64(s * n_actions + a)] += 1
            moved, _, over, reward, outcome, r0, r1, r2, r3 = happened(
                grid, slip, table, uint64(s), uint64(a), n_actions, r0, r1, r2, r3
            )
            there = _spot_after(grid, slip, rows, policy, n_options, here, place, uint64(s), moved, outcome, n_actions)
            s = int64(moved)
            gain += discount * reward
            discount *= gamma
            total += reward
            t += 1
            if intra is not None:
                pending = -1
                _learn_options(q, visits, rates, rows, policy, n_actions, here, there, a, over, reward)
            if agents is not None:
                running = -1
                _learn_agents(q, visits, rates, rows, agents, worst, n_actions, here, there, s, a, over, reward)
            if agents is None and running >= 0:
                if there.base != here.base:
                    place = int64(rows.position[uint64(there.base + running)])
                if place < 0 or q[uint64(there.row + place)] == -np.inf:
                    running = -1
            if over and pending >= 0:
                _learn(q, visits, alpha, pending, gain)
            here = there
        done += t
        if over or t >= rates.max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    whole[RUNNING], whole[PENDING], real[GAIN], real[DISCOUNT] = running, pending, gain, discount
    return done
