"""Replay by regions: which stretch of what was seen to go through again, in which order, and when to stop.

S states, A actions, R regions.  Values are shifted so that the lowest possible one is 0: an action never tried
keeps 0, so what is known grows outward from the goal, and a change is passed on to those states only that it
changes.  Where to look for something new is decided apart from the values: see ``exploring``.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.experience import backed_up, row_of_outcome
from qualrl.kernels.jit import compiled_inline, compiled_part
from qualrl.kernels.stepping import Floats, largest

# Slots of Levels.notes and of Levels.budget
STAMP, WAITING, PATH_LEFT, RETRY_AT, CLOCK, REPLAYED_AT, NEEDED, PATIENCE, CAME_FROM, CAME_BY, NOTES = range(11)
CREDIT, LET_GO, BUDGET = range(3)
TOLERANCE = 1e-10
"""Relative change of a value that is not passed on, as long as no move was seen to slip."""
SLIPPERY_TOLERANCE = 0.002
"""The same once moves slip, times 1 - gamma: the error left is a share of the value that falls as 1 / sqrt(steps),
as that of the frequencies does, only smaller."""


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
    """(NOTES,) numbers of the search and of the step, see above."""
    budget: Floats
    """(BUDGET,) backups saved up, and the relative change that is let go."""
    promise: float
    """The most that an action can be worth, shifted."""
    best_step: float
    """The largest reward of a step on the way, shifted."""
    tries: int
    """How often an action must be tried before it counts as known, once moves have been seen to slip."""
    steps: int
    """Backups a step, on average."""


@compiled_part
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


@compiled_part
def to_change(q: Any, value: Any, s: Any, tolerance: Any, n_actions: Any) -> Any:
    """By how much the value of a state is to change to be the largest of its q; 0 if by next to nothing."""
    best = largest(q, s * uint64(n_actions), n_actions)
    change, size = abs(best - value[s]), abs(best)
    if abs(value[s]) > size:
        size = abs(value[s])
    return change if change > tolerance * size else 0.0


@compiled_inline
def take_in(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, q: Any, value: Any, s: Any, a: Any, s2: Any,
    last: Any, differs: Any, changed: Any, n_actions: Any,
) -> Any:  # fmt: skip
    """Back up what was just seen, and at a qualitative transition replay what it changes.

    The end of an episode is one too, and at the latest after S steps something is replayed: where the robot goes
    about in one region for long, what it saw must not wait for ever.
    last: whether the episode is over, or cut off.  differs, changed: see ``experience.remember``.
    """
    notes, budget = levels.notes, levels.budget
    row = s * uint64(n_actions) + a
    if differs:
        notes[NEEDED] = levels.tries
    if levels.since[s] == 0:
        levels.since[s] = notes[CLOCK]
    if seen.tries[row] <= notes[NEEDED]:  # there may be more to see from here
        notes[PATIENCE] = 1
    known = backed_up(grid, slip, table, seen, value, row, a, gamma, n_actions)
    if known != q[row]:
        q[row] = known
        if notes[NEEDED] > 1:
            budget[LET_GO] = (1.0 - gamma) * SLIPPERY_TOLERANCE / np.sqrt(1.0 + notes[CLOCK] / 1000.0)
        change = to_change(q, value, s, budget[LET_GO], n_actions)
        if change > 0:
            wait(levels, s, change)
    if changed:
        notes[RETRY_AT], notes[PATIENCE] = 0, 1
        if slip is None:
            start_over(grid, slip, table, seen, levels, gamma, q, value, n_actions)
    budget[CREDIT] += levels.steps
    if notes[WAITING] > 0:
        here = levels.landmark_of[s2]
        arrived = here >= 0 and here != levels.landmark_of[s]
        late = notes[CLOCK] - notes[REPLAYED_AT] >= value.size
        if last or late or arrived or levels.region_of[s] != levels.region_of[s2]:
            notes[REPLAYED_AT] = notes[CLOCK]
            replay(grid, slip, table, seen, levels, gamma, q, value, n_actions)


@compiled_part
def replay(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, q: Any, value: Any, n_actions: Any
) -> Any:
    """Replay the regions in which something waits, the largest change first, as far as the budget goes."""
    while levels.budget[CREDIT] > 0 and levels.notes[WAITING] > 0:
        region: Any = int64(0)
        for other in range(1, levels.due.size):
            if levels.due[other] > levels.due[region]:
                region = other
        levels.due[region] = 0.0
        _replay_region(grid, slip, table, seen, levels, gamma, q, value, region, n_actions)


@compiled_part
def _replay_region(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, q: Any, value: Any, region: Any,
    n_actions: Any,
) -> Any:  # fmt: skip
    """Settle the states that wait in a region, first come first served, and whatever they change in it."""
    first = levels.ring_start[region]
    room = levels.ring_start[region + 1] - first
    tolerance = levels.budget[LET_GO]
    while levels.length[region] > 0:
        if levels.budget[CREDIT] <= 0:
            levels.due[region] = np.inf  # to be gone on with
            break
        levels.budget[CREDIT] -= 1
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


@compiled_part
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
