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
    child: NDArray[np.int32]
    order_start: NDArray[np.int64]
    """(C + 1,) the tasks besides the root that live in kind c are order[order_start[c]] .. , after those they call."""
    order: NDArray[np.int32]
    simple: NDArray[np.bool_]
    """(T,) whether a task calls moves only."""


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
def _best(child: Any, base: Any, value: Any, own: Any, low: Any, high: Any) -> Any:
    """(largest V + C of the entries low..high, the first entry of that value, how many have it).

    Entry e calls child[base + e]; value (A + T,): V of each.
    """
    best, where, ties = value[child[base + low]] + own[low], low, 1
    for e in range(low + 1, high):
        worth = value[child[base + e]] + own[e]
        if worth > best:
            best, where, ties = worth, e, 1
        elif worth == best:
            ties += 1
    return best, int64(where), ties


@compiled_inline
def _look(graph: Any, own: Any, outer: Any, move_value: Any, value: Any, task: Any, s: Any, n_actions: Any) -> Any:
    """The best call of a task in state s: ``_best``.  Writes to ``value`` what each of its calls is worth there."""
    n_tasks = graph.simple.size
    kind, row = int64(graph.kind_of[s]), graph.first[s]
    base = graph.child_start[kind] - row
    for a in range(n_actions):
        value[a] = move_value[s * n_actions + a]
    if not graph.simple[task]:
        for i in range(graph.order_start[kind], graph.order_start[kind + 1]):
            below = int64(graph.order[i])
            low, high = row + graph.begin[kind * n_tasks + below], row + graph.end[kind * n_tasks + below]
            best, where, _ = _best(graph.child, base, value, own, low, high)
            if outer is not None:
                best = value[graph.child[base + where]] + outer[where]
            value[n_actions + below] = best
    low, high = row + graph.begin[kind * n_tasks + task], row + graph.end[kind * n_tasks + task]
    return _best(graph.child, base, value, own, low, high)


@compiled_part
def _pick(
    child: Any, base: Any, value: Any, own: Any, low: Any, high: Any, best: Any, ties: Any, exploring: Any, u: Any
) -> Any:
    """An entry of low..high, each as likely: any that is open when exploring, otherwise one worth ``best``."""
    count = ties
    if exploring:
        count = 0
        for e in range(low, high):
            count += own[e] > -np.inf
    skip = int64(below(u, count))
    for e in range(low, high):
        if own[e] > -np.inf and (exploring or value[child[base + e]] + own[e] == best):
            if skip == 0:
                return e
            skip -= 1
    return low


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
    move_value: Any,
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
    n_tasks = graph.simple.size
    alpha, gamma = rates.alpha, rates.gamma
    explore = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, s, t, episode, total = resumed(progress)
    depth = progress.whole[DEPTH]
    call_task, call_entry, call_state, call_when = calls
    episodes = progress.steps.size
    done = 0
    known, best, entry, ties = False, 0.0, int64(0), 0  # the best call of the running task in s, once looked for
    while done < n_steps and episode < episodes:
        if t == 0:
            first, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            s, total, depth, known = int64(first), 0.0, int64(0), False
            call_task[0] = 0
        kind, row = int64(graph.kind_of[s]), graph.first[s]
        base = graph.child_start[kind] - row
        move = int64(-1)
        while move < 0:  # down to a move
            place = kind * n_tasks + call_task[depth]
            low, high = row + graph.begin[place], row + graph.end[place]
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            exploring = (u >> uint64(32)) < explore
            if not known and not exploring:
                best, entry, ties = _look(graph, own, outer, move_value, value, call_task[depth], s, n_actions)
            known = False
            if exploring or ties > 1:
                entry = _pick(graph.child, base, value, own, low, high, best, ties, exploring, u)
            call_entry[depth], call_state[depth], call_when[depth] = entry, s, t
            child = int64(graph.child[base + entry])
            if child < n_actions:
                move = child
            else:
                depth += 1
                call_task[depth] = child - n_actions
        moved, over, reward, r0, r1, r2, r3 = moved_on(
            grid, slip, table, uint64(s), uint64(move), n_actions, r0, r1, r2, r3
        )
        by = s * n_actions + move
        if visits is not None:
            alpha = next_rate(visits, own.size + by)
        move_value[by] += alpha * (reward - move_value[by])
        s = int64(moved)
        total += reward
        t += 1
        done += 1
        place = int64(graph.kind_of[s]) * n_tasks
        while not known and depth >= 0:  # up from every task that is over
            i, at = call_task[depth], call_state[depth]
            n = t - call_when[depth]
            discount = gamma if n == 1 else gamma**n
            target, seen = 0.0, 0.0
            if not over and graph.end[place + i] > graph.begin[place + i]:
                best, entry, ties = _look(graph, own, outer, move_value, value, i, s, n_actions)
                known = best > -np.inf
            if known:
                target = discount * best
                if outer is not None:
                    called = graph.child[graph.child_start[graph.kind_of[s]] + entry - graph.first[s]]
                    seen = discount * (value[called] + outer[entry])
            if pseudo is not None and not known:
                target = discount * _pseudo(pseudo, i, s)
            e = call_entry[depth]
            if visits is not None:
                alpha = next_rate(visits, e)
            own[e] += alpha * (target - own[e])
            if outer is not None:
                outer[e] += alpha * (seen - outer[e])
            if not known:
                depth -= 1
            elif at == s:
                known = False  # what was just learned may have changed it
                break
        if over or t >= rates.max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    progress.whole[DEPTH] = depth
    return done
