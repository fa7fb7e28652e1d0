"""The training loop of MAXQ-Q, compiled (Dietterich 2000).

S states, A moves, T tasks (task 0 is the root), C kinds of states.  A task calls moves and other tasks; each such
call has an entry in the row of every state of a kind in which the task lives, with one or two numbers:

own      C(i, s, j), the completion that task i goes by; -inf where the call may not be made.  The best call is the
         one of largest V + C, where V(j, s), the value of what is called, is the expected reward of a move, or for a
         task that of its best call.  A task none of whose calls may be made in a state is over there.
outer    the completion without pseudo-rewards, which is what others see; None where it would be the same as ``own``.

V is worked out bottom up where a call is chosen or has ended: where a task calls moves only, that is next to nothing.

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

    first: NDArray[np.int64]
    """(S,) where the row of each state begins."""
    kind_of: NDArray[np.int32]
    """(S,)"""
    begin: NDArray[np.int32]
    """(C * T,) the entries of task i in a row of kind c are begin[c * T + i] .. end[c * T + i]."""
    end: NDArray[np.int32]
    child_start: NDArray[np.int64]
    """(C,) what entry x of kind c calls is child[child_start[c] + x]: a move below A, else A + a task."""
    slot: NDArray[np.int32]
    order_start: NDArray[np.int64]
    """(C + 1,) the tasks besides the root that live in kind c are order[order_start[c]] .. , after those they call."""
    order: NDArray[np.int32]
    reach: NDArray[np.uint8]
    """(T,) TASKS, MOVES or MOVES_IN_ORDER."""
    value_first: NDArray[np.int64]
    """(S,) where the values of each state begin: of the A moves, then of the tasks of its kind in their order."""
    place: NDArray[np.int32]
    """(C * T,) where among them that of a task stands."""
    caller_start: NDArray[np.int64]
    caller: NDArray[np.int32]


class Pseudo(NamedTuple):
    """What a task's own choices are paid for where it ends; nobody else counts it."""

    otherwise: Floats
    """(T,) for a task, in the states not listed."""
    start: NDArray[np.int64]
    """(T + 1,) the states listed for task i are state[start[i]] .. state[start[i + 1]], in order."""
    state: NDArray[np.int64]
    amount: Floats


class Calls(NamedTuple):
    """The calls that are open, the root's first; read and written by each call of the loop."""

    task: NDArray[np.int64]
    entry: NDArray[np.int64]
    state: NDArray[np.int64]
    """Where each was made."""
    when: NDArray[np.int64]
    """The step of the episode at which each was made."""


@compiled_part
def _pseudo(pseudo: Any, task: Any, s: Any) -> Any:
    low, high = pseudo.start[task], pseudo.start[task + 1]
    while low < high:  # by halves; np.searchsorted takes half a second to compile
        middle = (low + high) // 2
        if pseudo.state[middle] == s:
            return pseudo.amount[middle]
        if pseudo.state[middle] < s:
            low = middle + 1
        else:
            high = middle
    return pseudo.otherwise[task]


@compiled_inline
def _best(graph: Any, own: Any, value: Any, base: Any, at: Any, low: Any, high: Any) -> Any:
    """(largest V + C of the entries low..high, the first entry of that value, how many have it)."""
    best, where, ties = value[uint64(at + graph.slot[uint64(base + low)])] + own[uint64(low)], low, 1
    for e in range(low + 1, high):
        worth = value[uint64(at + graph.slot[uint64(base + e)])] + own[uint64(e)]
        if worth > best:
            best, where, ties = worth, e, 1
        elif worth == best:
            ties += 1
    return best, int64(where), ties


@compiled_inline
def _best_move(own: Any, value: Any, at: Any, low: Any, n_actions: Any) -> Any:
    """The same for a task that calls all moves in order, which needs to look up neither how many nor which.

    Its choices are as good as random at first, so it does without branches, which would be guessed wrong.
    """
    best = value[uint64(at)] + own[uint64(low)]
    for a in range(1, n_actions):
        best = max(best, value[uint64(at + a)] + own[uint64(low + a)])
    where, ties = 0, 0
    for a in range(n_actions - 1, -1, -1):
        found = value[uint64(at + a)] + own[uint64(low + a)] == best
        where = a if found else where
        ties += found
    return best, int64(low + where), ties


@compiled_part
def _settle(graph: Any, own: Any, outer: Any, value: Any, kind: Any, row: Any, at: Any, n_actions: Any) -> None:
    """Work out what is not known of the values of the tasks in a state, bottom up."""
    n_tasks = graph.reach.size
    begin = graph.order_start[kind]
    base = graph.child_start[kind] - row
    for x in range(begin, graph.order_start[kind + 1]):
        place = at + n_actions + x - begin
        if np.isnan(value[place]):
            task = kind * n_tasks + graph.order[x]
            best, where, _ = _best(graph, own, value, base, at, row + graph.begin[task], row + graph.end[task])
            if outer is not None:
                best = value[at + graph.slot[base + where]] + outer[where]
            value[place] = best


@compiled_inline
def _look(
    graph: Any, own: Any, outer: Any, value: Any, task: Any, kind: Any, row: Any, at: Any, n_actions: Any
) -> Any:
    """The best call of a task in a state: ``_best``, once all that it may call there has a value."""
    place = kind * graph.reach.size + task
    low = row + graph.begin[place]
    if graph.reach[task] == MOVES_IN_ORDER:
        best, where, ties = _best_move(own, value, at, low, n_actions)
    else:
        if graph.reach[task] == TASKS:
            _settle(graph, own, outer, value, kind, row, at, n_actions)
        base = graph.child_start[kind] - row
        best, where, ties = _best(graph, own, value, base, at, low, row + graph.end[place])
    return best, where, ties


@compiled_part
def _pick(
    slot: Any, base: Any, value: Any, at: Any, own: Any, low: Any, high: Any, best: Any, ties: Any, exploring: Any, u: Any
) -> Any:
    """An entry of low..high, each as likely: any that is open when exploring, otherwise one worth ``best``."""
    count = ties
    if exploring:
        count = 0
        for e in range(low, high):
            count += own[e] > -np.inf
    skip = int64(below(u, count))
    for e in range(low, high):
        if own[e] > -np.inf and (exploring or value[at + slot[base + e]] + own[e] == best):
            if skip == 0:
                return e
            skip -= 1
    return low


@compiled_inline
def _spot(graph: Any, s: Any) -> Any:
    """(kind of a state, where its entries begin, where its values do)."""
    return int64(graph.kind_of[s]), graph.first[s], graph.value_first[s]


@compiled_inline
def _forget(graph: Any, value: Any, task: Any, s: Any) -> None:
    """What a task is worth in a state has to be worked out anew, and what those are that call it."""
    kind, _, at = _spot(graph, s)
    kind *= graph.reach.size
    value[at + graph.place[kind + task]] = np.nan
    for x in range(graph.caller_start[task], graph.caller_start[task + 1]):
        value[at + graph.place[kind + graph.caller[x]]] = np.nan


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
    value: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps; the world, ``actions``, ``starts`` and what is returned as in ``learning``.

    pseudo and outer are None where no task has a pseudo-reward.  move_value (S * A,): expected reward of each move.
    value (A + T,): scratch.
    visits: Visits of each entry of own (and outer), then of each row of move_value; or None for rates.alpha.
    """
    n_actions = len(actions)
    n_tasks = graph.reach.size
    alpha, gamma = rates.alpha, rates.gamma
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, s, t, episode, total = resumed(progress)
    depth = progress.whole[DEPTH]
    call_task, call_entry, call_state, call_when = calls
    task = call_task[max(depth, 0)]
    kind, row, at = _spot(graph, s)
    episodes = progress.steps.size
    done = 0
    known, best, entry, ties = False, 0.0, int64(0), 0  # the best call of the running task in s, once looked for
    while done < n_steps and episode < episodes:
        if t == 0:
            start, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            s, total, depth, task, known = int64(start), 0.0, int64(0), int64(0), False
            call_task[0] = 0
            kind, row, at = _spot(graph, s)
        move = int64(-1)
        while move < 0:  # down to a move
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            exploring = (u >> uint64(32)) < explore
            if not known and not exploring:
                best, entry, ties = _look(graph, own, outer, value, task, kind, row, at, n_actions)
            known = False
            base = graph.child_start[kind] - row
            if exploring or ties > 1:
                place = kind * n_tasks + task
                low, high = row + graph.begin[place], row + graph.end[place]
                entry = _pick(graph.slot, base, value, at, own, low, high, best, ties, exploring, u)
            called = int64(graph.slot[base + entry])
            if called < n_actions:
                move = called
            else:
                call_entry[depth], call_state[depth], call_when[depth] = entry, s, t
                depth += 1
                task = int64(graph.order[graph.order_start[kind] + called - n_actions])
                call_task[depth] = task
        moved, over, reward, r0, r1, r2, r3 = moved_on(
            grid, slip, table, uint64(s), uint64(move), n_actions, r0, r1, r2, r3
        )
        if visits is not None:
            alpha = next_rate(visits, own.size + s * n_actions + move)
        before = value[at + move]
        value[at + move] += alpha * (reward - before)
        if value[at + move] != before:
            for x in range(graph.order_start[kind + 1] - graph.order_start[kind]):
                value[at + n_actions + x] = np.nan
        e, origin, discount = entry, s, gamma
        s = int64(moved)
        kind, row, at = _spot(graph, s)
        total += reward
        t += 1
        done += 1
        while True:  # up from every task that is over
            target, seen = 0.0, 0.0
            place = kind * n_tasks + task
            if not over and graph.end[place] > graph.begin[place]:
                best, entry, ties = _look(graph, own, outer, value, task, kind, row, at, n_actions)
                known = best > -np.inf
            if known:
                target = discount * best
                if outer is not None:
                    seen = discount * (value[at + graph.slot[graph.child_start[kind] - row + entry]] + outer[entry])
            if pseudo is not None and not known:
                target = discount * _pseudo(pseudo, task, s)
            if visits is not None:
                alpha = next_rate(visits, e)
            own[e] += alpha * (target - own[e])
            if outer is not None:
                outer[e] += alpha * (seen - outer[e])
            if task != 0:
                _forget(graph, value, task, origin)
            if known:
                known = origin != s  # there, what was just learned may have changed it
                break
            depth -= 1
            if depth < 0:
                break
            task, e, origin = call_task[depth], call_entry[depth], call_state[depth]
            discount = gamma ** (t - call_when[depth])
        if over or t >= rates.max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    progress.whole[DEPTH] = depth
    return done
