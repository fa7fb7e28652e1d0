"""Prioritized sweeping (Moore and Atkeson 1993): states backed up in the order of how much they may change.

S states, A actions; see ``experience`` for the rest.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.experience import backed_up, refreshed, row_of_outcome, share
from qualrl.kernels.jit import compiled_inline, compiled_part
from qualrl.kernels.stepping import Floats


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


@compiled_part
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


@compiled_part
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


@compiled_inline
def learn_by_sweeping(
    grid: Any, slip: Any, table: Any, seen: Any, heap: Any, gamma: Any, q: Any, value: Any, size: Any, s: Any, row: Any,
    a: Any, n_actions: Any,
) -> Any:  # fmt: skip
    """Take in what was just seen of row = s * A + a, and sweep.  Returns the new size of the heap."""
    change = abs(backed_up(grid, slip, table, seen, value, row, a, gamma, n_actions) - q[row])
    if change > heap.threshold:
        size = push(heap, size, s, change)
    return _sweep(grid, slip, table, seen, heap, gamma, q, value, size, n_actions)


@compiled_part
def _sweep(
    grid: Any, slip: Any, table: Any, seen: Any, heap: Any, gamma: Any, q: Any, value: Any, size: Any, n_actions: Any
) -> Any:
    """Back up the states on top of the heap, and put in those that lead to them.  Returns the new size."""
    for _ in range(heap.steps):
        if size == 0:
            break
        s, size = pop(heap, size)
        change = refreshed(grid, slip, table, seen, q, value, s, gamma, n_actions)
        if gamma * change > heap.threshold:
            for i in range(seen.before_start[s], seen.before_start[s + uint64(1)]):
                outcome = seen.before[i]
                row = row_of_outcome(grid, slip, table, seen, outcome, n_actions)
                priority = gamma * change * share(grid, slip, table, seen, outcome, row)
                if priority > heap.threshold:
                    size = push(heap, size, row // uint64(n_actions), priority)
    return size
