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
    left_off,
    moved_on,
    next_rate,
    resumed,
    started,
)

# Slots of Progress.whole and Progress.real that are this loop's own
RUNNING, PENDING = range(OWN_WHOLE, OWN_WHOLE + 2)
GAIN, DISCOUNT = range(OWN_REAL, OWN_REAL + 2)
NONE = 255
"""No move."""


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


class Spot(NamedTuple):
    """Where a state's numbers stand."""

    row: int
    kind: int
    k: int
    """How many options it has."""
    start: int
    """Where they stand in ``Rows.option``."""
    base: int
    """Where its kind begins in ``Rows.position``."""


class Agents(NamedTuple):
    """Sub-agents: one an option, each learning a Q of its own from every step."""

    landmark: NDArray[np.int32]
    """(O,) where each wants to be."""
    landmark_of: NDArray[np.int32]
    """(S,)"""


def find_ways(
    likely: Any, sources: Any, source_start: Any, landmark: Any, terminal: Any, slot_start: Any, kind_of: Any,
    position: Any,
) -> Any:  # fmt: skip
    """(steps, move): for every state and option of it, how far its landmark is within the region, and the first move.

    likely (S, A): where each move leads most often.
    sources[source_start[l]..]: the states at landmark l.  slot_start (S + 1,): where the options of a state begin.
    steps int32 is 0 at the landmark and -1 where no way leads there; move uint8 is NONE for both.
    """
    steps = np.full(slot_start[-1], -1, np.int32)
    move = np.full(slot_start[-1], NONE, np.uint8)
    back_start, back = _backwards(likely)
    queue = np.empty(len(likely), np.int64)
    _write_ways(
        likely, back_start, back, sources, source_start, landmark, terminal, slot_start, kind_of, position, queue,
        steps, move,
    )  # fmt: skip
    return steps, move


@compiled_bare
def _write_ways(
    likely: Any,
    back_start: Any,
    back: Any,
    sources: Any,
    source_start: Any,
    landmark: Any,
    terminal: Any,
    slot_start: Any,
    kind_of: Any,
    position: Any,
    queue: Any,
    steps: Any,
    move: Any,
) -> None:
    """back[back_start[s]..]: the states with a move to s; queue (S,) is room to work in; the rest: ``find_ways``."""
    n_options = landmark.size
    for o in range(n_options):
        end = 0
        for i in range(source_start[landmark[o]], source_start[landmark[o] + 1]):
            s = sources[i]
            steps[slot_start[s] + position[kind_of[s] * n_options + o]] = 0
            queue[end] = s
            end += 1
        head = 0
        while head < end:
            t = queue[head]
            head += 1
            further = steps[slot_start[t] + position[kind_of[t] * n_options + o]] + 1
            for i in range(back_start[t], back_start[t + 1]):
                s = back[i]
                place = position[kind_of[s] * n_options + o]
                if place < 0 or terminal[s] or steps[slot_start[s] + place] >= 0:
                    continue
                steps[slot_start[s] + place] = further
                queue[end] = s
                end += 1
                a = 0
                while not _is_step_nearer(likely[s, a], further, steps, slot_start, kind_of, position, o, n_options):
                    a += 1
                move[slot_start[s] + place] = a


@compiled_part
def _is_step_nearer(
    t: Any, further: Any, steps: Any, slot_start: Any, kind_of: Any, position: Any, o: Any, n_options: Any
) -> Any:
    """Whether state t is one step nearer to the landmark of option o than ``further``."""
    place = position[kind_of[t] * n_options + o]
    return place >= 0 and steps[slot_start[t] + place] == further - 1


def _backwards(likely: Any) -> Any:
    """(back_start (S + 1,), back): for each state, those with a move that leads there most often."""
    start = np.zeros(len(likely) + 1, np.int64)
    np.cumsum(np.bincount(likely.ravel(), minlength=len(likely)), out=start[1:])
    back = np.empty(likely.size, np.int64)
    _write_back(likely, start[:-1].copy(), back)
    return start, back


@compiled_bare
def _write_back(likely: Any, filled: Any, back: Any) -> None:
    """Filled (S,): where the list of each state begins, and afterwards ends."""
    for s in range(likely.shape[0]):
        for a in range(likely.shape[1]):
            t = likely[s, a]
            back[filled[t]] = s
            filled[t] += 1


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
    kind = int64(rows.kind_of[s])
    start = rows.option_start[kind]
    return Spot(rows.first[s], kind, rows.option_start[kind + 1] - start, start, kind * n_options)


@compiled_inline
def _spot_after(rows: Any, n_options: Any, here: Any, s: Any) -> Any:
    """The same, after a step from another: mostly of its kind, and then nothing waits for what is looked up by that."""
    kind, k, start, base = here.kind, here.k, here.start, here.base
    if rows.kind_of[uint64(s)] != kind:
        _, kind, k, start, base = spot_of(rows, n_options, s)
    return Spot(rows.first[uint64(s)], kind, k, start, base)


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
                a = pick - here.row - here.k
                if a < 0:
                    place = pick - here.row
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
            moved, over, reward, r0, r1, r2, r3 = moved_on(
                grid, slip, table, uint64(s), uint64(a), n_actions, r0, r1, r2, r3
            )
            s = int64(moved)
            there = _spot_after(rows, n_options, here, s)
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
                if there.kind != here.kind:
                    place = int64(rows.position[there.base + running])
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
