"""The loop of the learners that plan with what they have seen: Dyna-Q, prioritized sweeping, and hql-replay.

S states, A actions, R regions, K outcomes.  Each is one of the parts passed as None or not (see ``stepping``):
``dyna`` replays outcomes drawn at random, ``heap`` sweeps states in the order of how much they may change,
``levels`` replays regions at qualitative transitions and steers exploration by them (see ``replay``).
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.experience import backed_up, refreshed, remember, row_of_outcome, share
from qualrl.kernels.jit import compiled_bare
from qualrl.kernels.replay import WAITING, replay, search, start_over, to_change, untried, wait, way_back
from qualrl.kernels.stepping import (
    EPISODE,
    OWN_REAL,
    OWN_WHOLE,
    RETURN,
    STATE,
    STEPS,
    Floats,
    below,
    draw,
    greedy,
    happened,
    largest,
    next_rate,
    rate_at,
    started,
    unit,
)

TRIED, HEAPED, PATH_LEFT, RETRY_AT, CLOCK, NEEDED, PATIENCE, CAME_FROM, CAME_BY = range(OWN_WHOLE, OWN_WHOLE + 9)
MOST_PATIENCE = 64
CREDIT, LET_GO = range(OWN_REAL, OWN_REAL + 2)
TOLERANCE = 1e-10
"""Relative change of a value that hql-replay does not pass on, as long as no move was seen to slip."""
SLIPPERY_TOLERANCE = 0.01
"""The same once moves slip, times 1 - gamma: the error left is a share of the value that falls as 1 / sqrt(steps),
as that of the frequencies does, only smaller."""


class Dyna(NamedTuple):
    """Rows in the order they were first tried; alpha and how many to replay a step."""

    order: NDArray[np.uint32]
    """(S * A,)"""
    steps: int


class Heap(NamedTuple):
    """States waiting to be backed up, the one that may change most on top."""

    states: NDArray[np.uint32]
    """(S,) a binary heap."""
    place: NDArray[np.int32]
    """(S,) where in the heap each state is, -1 for not in it."""
    priority: Floats
    """(S,)"""
    threshold: float
    """Changes up to this are let go."""
    steps: int
    """Most backups a step."""


@compiled_bare
def push(heap: Any, size: Any, s: Any, priority: Any) -> Any:
    """Put a state into the heap, or raise its priority.  Returns the new size."""
    at = int64(heap.place[s])
    if at < 0:
        at, size = size, size + 1
    elif priority <= heap.priority[s]:
        return size
    heap.priority[s] = priority
    while at > 0:
        above = (at - 1) // 2
        other = heap.states[above]
        if heap.priority[other] >= priority:
            break
        heap.states[at] = other
        heap.place[other] = at
        at = above
    heap.states[at] = s
    heap.place[s] = at
    return size


@compiled_bare
def pop(heap: Any, size: Any) -> Any:
    """Take the top off a heap that is not empty.  Returns (state, new size)."""
    top = uint64(heap.states[0])
    heap.place[top] = -1
    size -= 1
    if size > 0:
        s = heap.states[size]
        at = 0
        while 2 * at + 1 < size:
            child = 2 * at + 1
            if child + 1 < size and heap.priority[heap.states[child + 1]] > heap.priority[heap.states[child]]:
                child += 1
            other = heap.states[child]
            if heap.priority[other] <= heap.priority[s]:
                break
            heap.states[at] = other
            heap.place[other] = at
            at = child
        heap.states[at] = s
        heap.place[s] = at
    return top, size


@compiled_bare
def _sweep(
    grid: Any, slip: Any, table: Any, seen: Any, heap: Any, gamma: Any, q: Any, value: Any, size: Any, n_actions: Any
) -> Any:
    """Back up the states on top of the heap, and put in those that lead to them.  Returns the new size."""
    for _ in range(heap.steps):
        if size == 0:
            break
        s, size = pop(heap, size)
        change, _ = refreshed(grid, slip, table, seen, q, value, s, gamma, n_actions)
        if gamma * change > heap.threshold:
            for i in range(seen.before_start[s], seen.before_start[s + uint64(1)]):
                outcome = seen.before[i]
                row = row_of_outcome(grid, slip, table, seen, outcome, n_actions)
                priority = gamma * change * share(grid, slip, table, seen, outcome, row)
                if priority > heap.threshold:
                    size = push(heap, size, row // uint64(n_actions), priority)
    return size


@compiled_bare
def _imagine(
    grid: Any, slip: Any, table: Any, seen: Any, dyna: Any, visits: Any, rates: Any, q: Any, tried: Any, n_actions: Any,
    r0: Any, r1: Any, r2: Any, r3: Any,
) -> Any:  # fmt: skip
    """Q-learning on outcomes drawn from what was seen.  Returns the stream."""
    for _ in range(dyna.steps):
        u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        row = uint64(dyna.order[below(u, tried)])
        if grid is not None:
            moved = row % uint64(n_actions)
            if slip is not None:
                u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
                left = unit(u) * seen.tries[row]
                first = row * uint64(n_actions)
                moved = uint64(0)
                while moved < uint64(n_actions - 1) and left >= seen.counts[first + moved]:
                    left -= seen.counts[first + moved]
                    moved += uint64(1)
            s2 = uint64(seen.leads_to[row - row % uint64(n_actions) + moved])
            over = s2 == uint64(grid.goal)
            target = seen.goal_reward if over else seen.reward[moved]
        if table is not None:
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            left = unit(u) * seen.tries[row]
            outcome = table.row_start[row]
            last = table.row_start[row + uint64(1)] - 1
            while outcome < last and left >= seen.counts[outcome]:
                left -= seen.counts[outcome]
                outcome += 1
            s2 = uint64(table.target[outcome])
            over = table.terminal[s2]
            target = seen.reward[outcome]
        if not over:
            target += rates.gamma * largest(q, s2 * uint64(n_actions), n_actions)
        alpha = rates.alpha
        if visits is not None:
            alpha = rate_at(visits.rate, visits.counts[row])
        q[row] += alpha * (target - q[row])
    return r0, r1, r2, r3


@compiled_bare
def run_planning(
    grid: Any,
    slip: Any,
    table: Any,
    seen: Any,
    dyna: Any,
    heap: Any,
    levels: Any,
    visits: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    q: Any,
    value: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps of the planner that is not None; see ``learning.run_steps`` for the rest."""
    n_actions = len(actions)
    gamma, max_steps = rates.gamma, rates.max_steps
    explored = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3 = progress.stream[0], progress.stream[1], progress.stream[2], progress.stream[3]
    whole, real = progress.whole, progress.real
    s, t, episode = uint64(whole[STATE]), whole[STEPS], whole[EPISODE]
    tried, size = whole[TRIED], whole[HEAPED]
    path_left, retry_at, clock, needed = whole[PATH_LEFT], whole[RETRY_AT], whole[CLOCK], whole[NEEDED]
    patience, came_from, came_by = whole[PATIENCE], uint64(whole[CAME_FROM]), uint64(whole[CAME_BY])
    total, credit, tolerance = real[RETURN], real[CREDIT], real[LET_GO]
    episodes = progress.steps.size
    done = 0
    while done < n_steps and episode < episodes:
        if t == 0:
            s, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            total = 0.0
        row = s * uint64(n_actions)
        u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        by_chance = (u >> uint64(32)) < explored
        a = below(u, n_actions)
        wanted = -1
        if levels is not None:
            clock += 1
            if path_left > 0 and uint64(levels.path[path_left - 1]) // uint64(n_actions) != s:
                path_left = 0  # a slip led off the path
            if by_chance:
                path_left = 0
            elif path_left == 0:
                if levels.relevant[levels.region_of[s]] and levels.promise > value[s]:
                    wanted = untried(seen.tries, needed, s, u, n_actions)
                if wanted < 0 and clock >= retry_at:
                    path_left, looked = search(grid, slip, table, seen, levels, needed, gamma, value, s, n_actions)
                    if path_left == 0 and value[s] <= 0:
                        wanted = way_back(levels.undoes, seen.tries, needed, s, came_by, u, n_actions)
                    elif path_left == 0:
                        patience = min(2 * patience, MOST_PATIENCE)
                        retry_at = clock + patience * looked  # so that looking in vain costs next to nothing
            if path_left > 0:
                path_left -= 1
                wanted = int64(uint64(levels.path[path_left]) % uint64(n_actions))
        if not by_chance:
            a = uint64(wanted) if wanted >= 0 else greedy(q, row, n_actions, u)
        s2, over, reward, outcome, r0, r1, r2, r3 = happened(grid, slip, table, s, a, n_actions, r0, r1, r2, r3)
        differs, changed = remember(grid, slip, table, seen, row + a, outcome, s2, n_actions)
        if dyna is not None:
            if seen.tries[row + a] == 1:
                dyna.order[tried] = row + a
                tried += 1
            target = reward
            if not over:
                target += gamma * largest(q, s2 * uint64(n_actions), n_actions)
            alpha = rates.alpha
            if visits is not None:
                alpha = next_rate(visits, row + a)
            q[row + a] += alpha * (target - q[row + a])
            r0, r1, r2, r3 = _imagine(grid, slip, table, seen, dyna, visits, rates, q, tried, n_actions, r0, r1, r2, r3)
        if heap is not None:
            change = abs(backed_up(grid, slip, table, seen, value, row + a, a, gamma, n_actions) - q[row + a])
            if change > heap.threshold:
                size = push(heap, size, s, change)
            size = _sweep(grid, slip, table, seen, heap, gamma, q, value, size, n_actions)
        if levels is not None:
            if differs:
                needed = levels.tries
            if s2 == came_from and s2 != s:
                levels.undoes[came_by * uint64(n_actions) + a] += 1
            came_from, came_by = s, a
            if levels.since[s] == 0:
                levels.since[s] = clock
            if seen.tries[row + a] <= needed:  # there may be more to see from here
                patience = 1
            known = backed_up(grid, slip, table, seen, value, row + a, a, gamma, n_actions)
            if known != q[row + a]:
                q[row + a] = known
                if needed > 1:
                    tolerance = (1.0 - gamma) * SLIPPERY_TOLERANCE / np.sqrt(1.0 + clock / 1000.0)
                change = to_change(q, value, s, tolerance, n_actions)
                if change > 0:
                    wait(levels, s, change)
            if changed:
                retry_at, patience = 0, 1
                if slip is None:
                    start_over(grid, slip, table, seen, levels, gamma, q, value, n_actions)
            credit += levels.steps
            if levels.notes[WAITING] > 0:
                here = levels.landmark_of[s2]
                arrived = here >= 0 and here != levels.landmark_of[s]
                if over or arrived or levels.region_of[s] != levels.region_of[s2]:
                    credit = replay(grid, slip, table, seen, levels, tolerance, gamma, q, value, credit, n_actions)
        total += reward
        t += 1
        done += 1
        s = s2
        if over or t >= max_steps:
            progress.steps[episode] = t
            progress.returns[episode] = total
            episode += 1
            t = 0
    progress.stream[0], progress.stream[1], progress.stream[2], progress.stream[3] = r0, r1, r2, r3
    whole[STATE], whole[STEPS], whole[EPISODE] = s, t, episode
    whole[TRIED], whole[HEAPED] = tried, size
    whole[PATH_LEFT], whole[RETRY_AT], whole[CLOCK], whole[NEEDED] = path_left, retry_at, clock, needed
    whole[PATIENCE], whole[CAME_FROM], whole[CAME_BY] = patience, came_from, came_by
    real[RETURN], real[CREDIT], real[LET_GO] = total, credit, tolerance
    return done
