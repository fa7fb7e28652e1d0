"""Replay by regions: which stretch of what was seen to go through again, in which order, and when to stop.

S states, A actions, R regions.  Values are shifted so that the lowest possible one is 0: an action never tried
keeps 0, so what is known grows outward from the goal, and a change is passed on to those states only that it
changes.  Where to look for something new is decided apart from the values: the nearest action that was tried too
seldom, in a region that a way to the goal may pass, as long as the best it could bring beats what is known.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.experience import backed_up, likeliest, row_of_outcome
from qualrl.kernels.jit import compiled_bare
from qualrl.kernels.stepping import Floats, below, largest

# Slots of Levels.notes
STAMP, WAITING, NOTES = range(3)
NEVER = 2**60


class Levels(NamedTuple):
    """The qualitative level, and what the planner keeps by region; all but the first two are updated."""

    region_of: NDArray[np.int32]
    """(S,)"""
    landmark_of: NDArray[np.int32]
    """(S,) landmark of each state, -1 for none."""
    relevant: NDArray[np.bool_]
    """(R,) whether a way to the goal may pass the region."""
    ring: NDArray[np.uint32]
    """(S,) states waiting in each region: a ring from ring_start[r] to ring_start[r + 1]."""
    ring_start: NDArray[np.int64]
    head: NDArray[np.int64]
    """(R,) offset of the first state that waits."""
    length: NDArray[np.int64]
    """(R,) how many wait."""
    waits: NDArray[np.bool_]
    """(S,)"""
    due: Floats
    """(R,) largest change that waits in each region."""
    since: NDArray[np.int64]
    """(S,) step at which a state was first left, 0 for never."""
    mark: NDArray[np.int64]
    """(S,) number of the last search that came by."""
    queue: NDArray[np.uint32]
    """(S,)"""
    parent: NDArray[np.uint32]
    """(S,) row by which the last search came."""
    path: NDArray[np.uint32]
    """(S,) rows still to walk, the next one last."""
    undoes: NDArray[np.int64]
    """(A * A,) how often action b led back right after action a: at a * A + b."""
    notes: NDArray[np.int64]
    promise: float
    """The most that an action can be worth, shifted."""
    best_step: float
    """The largest reward of a step on the way, shifted."""
    tries: int
    """How often an action must be tried before it counts as known, once moves have been seen to slip."""
    steps: int
    """Backups a step, on average."""


@compiled_bare
def wait(levels: Any, s: Any, change: Any) -> Any:
    """Let a state whose value is to change by so much wait for the replay of its region."""
    region = levels.region_of[s]
    if change > levels.due[region]:
        levels.due[region] = change
    if levels.waits[s]:
        return
    levels.waits[s] = True
    first = levels.ring_start[region]
    room = levels.ring_start[region + 1] - first
    levels.ring[first + (levels.head[region] + levels.length[region]) % room] = s
    levels.length[region] += 1
    levels.notes[WAITING] += 1


@compiled_bare
def to_change(q: Any, value: Any, s: Any, tolerance: Any, n_actions: Any) -> Any:
    """By how much the value of a state is to change to be the largest of its q; 0 if by next to nothing."""
    best = largest(q, s * uint64(n_actions), n_actions)
    change = abs(best - value[s])
    return change if change > tolerance * max(abs(best), abs(value[s])) else 0.0


@compiled_bare
def replay(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, tolerance: Any, gamma: Any, q: Any, value: Any,
    credit: Any, n_actions: Any,
) -> Any:  # fmt: skip
    """Replay the regions in which something waits, the largest change first.  Returns the backups left over."""
    while credit > 0 and levels.notes[WAITING] > 0:
        region = np.argmax(levels.due)
        levels.due[region] = 0.0
        credit = _replay_region(grid, slip, table, seen, levels, tolerance, gamma, q, value, region, credit, n_actions)
    return credit


@compiled_bare
def _replay_region(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, tolerance: Any, gamma: Any, q: Any, value: Any,
    region: Any, credit: Any, n_actions: Any,
) -> Any:  # fmt: skip
    """Settle the states that wait in a region, first come first served, and whatever they change in it."""
    first = levels.ring_start[region]
    room = levels.ring_start[region + 1] - first
    while levels.length[region] > 0:
        if credit <= 0:
            levels.due[region] = np.inf  # to be gone on with
            break
        credit -= 1
        s = uint64(levels.ring[first + levels.head[region]])
        levels.head[region] = (levels.head[region] + 1) % room
        levels.length[region] -= 1
        levels.notes[WAITING] -= 1
        levels.waits[s] = False
        value[s] = largest(q, s * uint64(n_actions), n_actions)
        for i in range(seen.before_start[s], seen.before_start[s + uint64(1)]):
            row = row_of_outcome(grid, slip, table, seen, seen.before[i], n_actions)
            if seen.tries[row] > 0:
                a = row % uint64(n_actions)
                before = row // uint64(n_actions)
                q[row] = backed_up(grid, slip, table, seen, value, row, a, gamma, n_actions)
                change = to_change(q, value, before, tolerance, n_actions)
                if change > 0:
                    wait(levels, before, change)
    return credit


@compiled_bare
def start_over(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, q: Any, value: Any, n_actions: Any
) -> Any:
    """After the world has changed, forget all values, not what was seen, and let them grow from the goal again.

    Values that rest on each other in a circle would fall by no more than gamma a backup.
    """
    for s in range(value.size):
        if grid is None or uint64(s) != uint64(grid.goal):
            value[s] = 0.0
    for s in range(value.size):
        for a in range(n_actions):
            row = uint64(s) * uint64(n_actions) + uint64(a)
            if seen.tries[row] > 0:
                q[row] = backed_up(grid, slip, table, seen, value, row, uint64(a), gamma, n_actions)
        change = to_change(q, value, uint64(s), 0.0, n_actions)
        if change > 0 and (grid is None or uint64(s) != uint64(grid.goal)):
            wait(levels, uint64(s), change)


@compiled_bare
def untried(tries: Any, needed: Any, s: Any, u: Any, n_actions: Any) -> Any:
    """An action of a state that was tried too seldom, each as likely; -1 if there is none."""
    row = s * uint64(n_actions)
    n = 0
    for a in range(n_actions):
        if tries[row + uint64(a)] < needed:
            n += 1
    if n == 0:
        return -1
    skip = int64(below(u, n))
    for a in range(n_actions):
        if tries[row + uint64(a)] < needed:
            if skip == 0:
                return a
            skip -= 1
    return -1


@compiled_bare
def way_back(undoes: Any, tries: Any, needed: Any, s: Any, came_by: Any, u: Any, n_actions: Any) -> Any:
    """The action that most often undid the one by which the robot came, if it was tried too seldom here; else any."""
    first = came_by * uint64(n_actions)
    back = uint64(0)
    for b in range(1, n_actions):
        if undoes[first + uint64(b)] > undoes[first + back]:
            back = uint64(b)
    if undoes[first + back] > 0 and tries[s * uint64(n_actions) + back] < needed:
        return int64(back)
    return untried(tries, needed, s, u, n_actions)


@compiled_bare
def search(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, needed: Any, gamma: Any, value: Any, s: Any,
    n_actions: Any,
) -> Any:  # fmt: skip
    """Look, breadth first over moves that were seen, for the nearest state with something worth trying.

    Writes the way there into ``levels.path``; returns (its length, how many states were looked at).  The length
    is 0 where nothing found could beat what is known.  Where nothing is known, anything untried will do: in the same
    region what was passed by first, for a robot that strayed there finds out again where it came in.
    """
    notes = levels.notes
    notes[STAMP] += 1
    levels.mark[s] = notes[STAMP]
    levels.queue[0] = s
    head, n, layer_end = 0, 1, 1
    gained, discount = 0.0, 1.0
    anything, first_seen = s, NEVER + NEVER
    while head < n:
        if head == layer_end:
            gained += discount * levels.best_step
            discount *= gamma
            layer_end = n
            if gained + discount * levels.promise <= value[s]:
                return 0, n
        x = uint64(levels.queue[head])
        head += 1
        if untried(seen.tries, needed, x, uint64(0), n_actions) >= 0:
            if levels.relevant[levels.region_of[x]]:
                return _lay_path(levels, s, x, n_actions), n
            since = levels.since[x] if levels.since[x] > 0 else NEVER
            if levels.region_of[x] != levels.region_of[s]:
                since = NEVER + NEVER - 1
            if since < first_seen:
                anything, first_seen = x, since
        for a in range(n_actions):
            row = x * uint64(n_actions) + uint64(a)
            if seen.tries[row] > 0:
                y = likeliest(grid, slip, table, seen, row, uint64(a), n_actions)
                if levels.mark[y] != notes[STAMP]:
                    levels.mark[y] = notes[STAMP]
                    levels.parent[y] = row
                    levels.queue[n] = y
                    n += 1
    return (_lay_path(levels, s, anything, n_actions) if value[s] <= 0 else 0), n


@compiled_bare
def _lay_path(levels: Any, s: Any, found: Any, n_actions: Any) -> Any:
    """Write down the rows that lead to a state found, the first one last; returns how many."""
    n = 0
    while found != s:
        row = uint64(levels.parent[found])
        levels.path[n] = row
        n += 1
        found = row // uint64(n_actions)
    return n
