"""The training loop of MAXQ-Q, compiled (Dietterich 2000).

S states, A moves, T tasks (task 0 is the root), C kinds of states.  A task calls moves and other tasks; each such
call has an entry in the row of every state of a kind in which the task lives, with one or two numbers:

own      C(i, s, j), the completion that task i goes by; -inf where the call may not be made.  The best call is the
         one of largest V + C, where V(j, s), the value of what is called, is the expected reward of a move, or for a
         task that of its best call.  A task none of whose calls may be made in a state is over there.
outer    the completion without pseudo-rewards, which is what others see; None where it would be the same as ``own``.

V of each task is kept for each state.  A state is stale once something that V is made of has changed there; all its V
are then worked out anew, bottom up, where a task that calls tasks has to choose.  A state of a kind of K tasks takes
8 (K + A) + 1 bytes.

A call runs a number of steps and leaves everything it needs to go on in its arrays.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_bare, compiled_inline, compiled_part
from qualrl.kernels.stepping import (
    OWN_WHOLE,
    Floats,
    below,
    draw,
    ended,
    left_off,
    moved_on,
    next_rate,
    resumed,
    started,
)

DEPTH = OWN_WHOLE
"""Slot of Progress.whole: how many calls are open besides the root's."""


TASKS, MOVES, MOVES_IN_ORDER = range(3)
"""What a task calls."""


class Graph(NamedTuple):
    """Which task calls what, and where its entries stand."""

    spot: NDArray[np.int64]
    """(S * 3,) of each state its kind, where its row begins, and where its values do: of the A moves, then of the
    tasks of its kind in their order."""
    begin: NDArray[np.int32]
    """(C * T,) the entries of task i in a row of kind c are begin[c * T + i] .. end[c * T + i]; or begin is -1."""
    end: NDArray[np.int32]
    child_start: NDArray[np.int64]
    """(C,) the value of what entry x of kind c calls is in slot[child_start[c] + x] of the values of a state."""
    slot: NDArray[np.int32]
    """Below A the move of that number, else A + the place of a task in the kind's order."""
    order_start: NDArray[np.int64]
    """(C + 1,) the tasks besides the root that live in kind c are order[order_start[c]] .. , after those they call."""
    order: NDArray[np.int32]
    reach: NDArray[np.uint8]
    """(T,) TASKS, MOVES or MOVES_IN_ORDER."""


class Pseudo(NamedTuple):
    """What a task's own choices are paid for where it ends; nobody else counts it."""

    otherwise: Floats
    """(T,) for a task, in the states not listed."""
    start: NDArray[np.int64]
    """(T + 1,) the states listed for task i are state[start[i]] .. state[start[i + 1]], in order."""
    state: NDArray[np.int64]
    amount: Floats


class Kept(NamedTuple):
    """What is worked out from what was learned, and kept; read and written by each call of the loop."""

    value: Floats
    """See ``Graph.spot``: of a move, the reward expected of it; of a task, V, where its state is not stale."""
    stale: NDArray[np.bool_]
    """(S,)"""
    powers: Floats
    """gamma to the n-th, for the first few n."""


class Calls(NamedTuple):
    """The calls that are open, the root's first; read and written by each call of the loop."""

    task: NDArray[np.int64]
    entry: NDArray[np.int64]
    state: NDArray[np.int64]
    """Where each was made."""
    when: NDArray[np.int64]
    """The step of the episode at which each was made."""


@compiled_inline
def _pseudo(pseudo: Any, task: Any, s: Any) -> Any:
    low, high = pseudo.start[task], pseudo.start[task + uint64(1)]
    while low < high:  # by halves; np.searchsorted takes half a second to compile
        middle = (low + high) // 2
        if uint64(pseudo.state[middle]) == s:
            return pseudo.amount[middle]
        if uint64(pseudo.state[middle]) < s:
            low = middle + 1
        else:
            high = middle
    return pseudo.otherwise[task]


class Spot(NamedTuple):
    """Where everything about a state stands; unsigned like all indices here, which spares the check for negative ones.

    An unsigned number and a signed one make a float in numba, so what is added to these is unsigned too.
    """

    kind: int
    tasks: int
    """Where its kind begins in ``Graph.begin`` and ``end``."""
    row: int
    """Where its entries begin."""
    at: int
    """Where its values begin."""


@compiled_inline
def spot_of(graph: Any, s: Any) -> Any:
    """Where everything about a state stands."""
    at = uint64(s) * uint64(3)
    kind = uint64(graph.spot[at])
    tasks = kind * uint64(graph.reach.size)
    return Spot(kind, tasks, uint64(graph.spot[at + uint64(1)]), uint64(graph.spot[at + uint64(2)]))


@compiled_inline
def best_call(graph: Any, own: Any, value: Any, spot: Any, place: Any) -> Any:
    """(largest V + C of a task's entries, the first of that value, the slot of what that calls, how many have it)."""
    low, high = spot.row + uint64(graph.begin[place]), spot.row + uint64(graph.end[place])
    shift = uint64(graph.child_start[spot.kind]) - spot.row
    slot = uint64(graph.slot[low + shift])
    best, where, ties = value[spot.at + slot] + own[low], low, 1
    for e in range(low + uint64(1), high):
        called = uint64(graph.slot[e + shift])
        worth = value[spot.at + called] + own[e]
        if worth >= best:
            if worth > best:
                best, where, slot, ties = worth, e, called, 1
            else:
                ties += 1
    return best, where, slot, ties


@compiled_inline
def _best_move(own: Any, value: Any, low: Any, at: Any, n_actions: Any) -> Any:
    """The same for a task that calls all moves in order, which needs to look up neither how many nor which."""
    best, slot, ties = value[at] + own[low], uint64(0), 1
    for a in range(1, n_actions):
        worth = value[at + uint64(a)] + own[low + uint64(a)]
        if worth >= best:
            if worth > best:
                best, slot, ties = worth, uint64(a), 1
            else:
                ties += 1
    return best, low + slot, slot, ties


@compiled_part
def settle(graph: Any, own: Any, outer: Any, value: Any, spot: Any, n_actions: Any) -> None:
    """Work out the values of the tasks in a state, bottom up."""
    at = spot.at + uint64(n_actions)
    for x in range(uint64(graph.order_start[spot.kind]), uint64(graph.order_start[spot.kind + uint64(1)])):
        best, where, slot, _ = best_call(graph, own, value, spot, spot.tasks + uint64(graph.order[x]))
        if outer is not None:
            best = value[spot.at + slot] + outer[where]
        value[at] = best
        at += uint64(1)


@compiled_inline
def _look(graph: Any, own: Any, outer: Any, kept: Any, task: Any, s: Any, spot: Any, n_actions: Any) -> Any:
    """The best call of a task in a state: ``best_call``, once all that it may call there has a value."""
    if graph.reach[task] == TASKS and kept.stale[s]:
        settle(graph, own, outer, kept.value, spot, n_actions)
        kept.stale[s] = False
    return best_call(graph, own, kept.value, spot, spot.tasks + task)


@compiled_inline
def _learn(own: Any, outer: Any, visits: Any, alpha: Any, e: Any, target: Any, seen: Any) -> Any:
    """Move a completion towards what was seen of it; whether that changed anything."""
    if visits is not None:
        alpha = next_rate(visits, e)
    before = own[e]
    own[e] = before + alpha * (target - before)
    changed = own[e] != before
    if outer is not None:
        before = outer[e]
        outer[e] = before + alpha * (seen - before)
        changed |= outer[e] != before
    return changed


@compiled_inline
def _learn_reward(value: Any, visits: Any, alpha: Any, at: Any, row: Any, reward: Any) -> Any:
    """Move what is expected of a move towards its reward; whether that changed anything."""
    if visits is not None:
        alpha = next_rate(visits, row)
    before = value[at]
    value[at] = before + alpha * (reward - before)
    return value[at] != before


@compiled_part
def _pick(
    slot: Any, own: Any, value: Any, low: Any, high: Any, shift: Any, at: Any, best: Any, ties: Any, exploring: Any,
    u: Any,
) -> Any:  # fmt: skip
    """An entry of low..high, each as likely: any that is open when exploring, otherwise one worth ``best``."""
    count = ties
    if exploring:
        count = 0
        for e in range(low, high):
            count += own[e] > -np.inf
    skip = int64(below(u, uint64(count)))
    for e in range(low, high):
        if own[e] > -np.inf and (exploring or value[at + uint64(slot[e + shift])] + own[e] == best):
            if skip == 0:
                return e
            skip -= 1
    return low


@compiled_inline
def _caller(calls: Any, depth: Any, t: Any, gamma: Any, powers: Any) -> Any:
    """The call that was open below the one that is over: (task, entry, state, gamma to the power of its steps)."""
    passed = t - calls.when[depth]
    discount = powers[uint64(passed)] if passed < powers.size else gamma**passed
    return uint64(calls.task[depth]), uint64(calls.entry[depth]), uint64(calls.state[depth]), discount


@compiled_bare
def run_steps(
    grid: Any,
    slip: Any,
    table: Any,
    graph: Any,
    pseudo: Any,
    calls: Any,
    visits: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    own: Any,
    outer: Any,
    kept: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps; the world, ``actions``, ``starts`` and what is returned as in ``learning``.

    pseudo and outer are None where no task has a pseudo-reward.
    visits: Visits of each entry of own (and outer), then of each of the S * A moves; or None for rates.alpha.
    """
    n_actions = len(actions)
    alpha, gamma = rates.alpha, rates.gamma
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, at, t, episode, total = resumed(progress)
    depth = progress.whole[DEPTH]
    s, task = uint64(at), uint64(calls.task[depth if depth > 0 else 0])
    here = spot_of(graph, s)
    value, stale, powers = kept.value, kept.stale, kept.powers
    for n in range(powers.size):
        powers[n] = gamma**n
    episodes = progress.steps.size
    done = 0
    # The best call of the running task in s, once looked for: its worth, entry and slot, and how many are as good
    known, best, entry, slot, ties = False, 0.0, uint64(0), uint64(0), 0
    while done < n_steps and episode < episodes:
        if t == 0:
            s, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            total, depth, task, known = 0.0, int64(0), uint64(0), False
            calls.task[0] = 0
            here = spot_of(graph, s)
        until, over = t + n_steps - done, False
        if until > rates.max_steps:
            until = rates.max_steps
        done -= t
        while not over and t < until:
            while graph.reach[task] != MOVES_IN_ORDER:  # down to a move, or to a task that calls nothing else
                u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                exploring = (u >> uint64(32)) < explore
                if not known and not exploring:
                    best, entry, slot, ties = _look(graph, own, outer, kept, task, s, here, n_actions)
                known = False
                if exploring or ties > 1:
                    place = here.tasks + task
                    low, high = here.row + uint64(graph.begin[place]), here.row + uint64(graph.end[place])
                    shift = uint64(graph.child_start[here.kind]) - here.row
                    entry = _pick(graph.slot, own, value, low, high, shift, here.at, best, ties, exploring, u)
                    slot = uint64(graph.slot[entry + shift])
                if slot < uint64(n_actions):
                    break
                calls.entry[depth], calls.state[depth], calls.when[depth] = entry, s, t
                depth += 1
                task = uint64(graph.order[uint64(graph.order_start[here.kind]) + slot - uint64(n_actions)])
                calls.task[depth] = task
            goes_on = False
            if graph.reach[task] != MOVES_IN_ORDER:
                e, origin = entry, s
                s, over, reward, r0, r1, r2, r3 = moved_on(grid, slip, table, s, slot, n_actions, r0, r1, r2, r3)
                row = uint64(own.size) + origin * uint64(n_actions) + slot
                stale[origin] |= _learn_reward(value, visits, alpha, here.at + slot, row, reward)
                here, changed = spot_of(graph, s), False
                total += reward
                t += 1
            else:
                low = here.row + uint64(graph.begin[here.tasks + task])
                while not goes_on:
                    if not known:
                        best, entry, slot, ties = _best_move(own, value, low, here.at, n_actions)
                    u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                    exploring = (u >> uint64(32)) < explore
                    if exploring or ties > 1:
                        shift = uint64(graph.child_start[here.kind]) - here.row
                        high = low + uint64(n_actions)
                        entry = _pick(graph.slot, own, value, low, high, shift, here.at, best, ties, exploring, u)
                        slot = entry - low
                    e, origin, move_at = entry, s, here.at + slot
                    s, over, reward, r0, r1, r2, r3 = moved_on(grid, slip, table, s, slot, n_actions, r0, r1, r2, r3)
                    row = uint64(own.size) + origin * uint64(n_actions) + slot
                    changed = _learn_reward(value, visits, alpha, move_at, row, reward)
                    here = spot_of(graph, s)
                    total += reward
                    t += 1
                    begin = graph.begin[here.tasks + task]
                    if over or begin < 0:
                        break
                    low = here.row + uint64(begin)
                    best, entry, slot, ties = _best_move(own, value, low, here.at, n_actions)
                    if best == -np.inf:
                        break
                    seen = 0.0
                    if outer is not None:
                        seen = gamma * (value[here.at + slot] + outer[entry])
                    stale[origin] |= _learn(own, outer, visits, alpha, e, gamma * best, seen) | changed
                    known = origin != s  # there, what was just learned may have changed it
                    goes_on = t >= until
            # What left the loop of its own is over, without another look
            discount, ended_here = gamma, over or graph.reach[task] == MOVES_IN_ORDER
            while not goes_on and depth >= 0:  # up from every task that is over
                target, seen = 0.0, 0.0
                if not ended_here and graph.begin[here.tasks + task] >= 0:
                    best, entry, slot, ties = _look(graph, own, outer, kept, task, s, here, n_actions)
                    goes_on = best > -np.inf
                if goes_on:
                    target = discount * best
                    if outer is not None:
                        seen = discount * (value[here.at + slot] + outer[entry])
                if pseudo is not None and not goes_on:
                    target = discount * _pseudo(pseudo, task, s)
                changed |= _learn(own, outer, visits, alpha, e, target, seen) and task != uint64(0)
                stale[origin] |= changed
                known = goes_on and origin != s  # there, what was just learned may have changed it
                if not goes_on:
                    depth -= 1
                    if depth >= 0:
                        task, e, origin, discount = _caller(calls, depth, t, gamma, powers)
                        changed, ended_here = False, over
        done += t
        if over or t >= rates.max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    progress.whole[DEPTH] = depth
    return done
