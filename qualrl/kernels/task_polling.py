"""Action values polled from what MAXQ-Q knows, compiled; see ``task_graph``, and ``polling`` for the other learners."""

from typing import Any

import numpy as np
from numba import uint64

from qualrl.kernels.jit import compiled_bare
from qualrl.kernels.task_graph import best_call, settle, spot_of


@compiled_bare
def poll_tasks(graph: Any, own: Any, outer: Any, kept: Any, actions: Any, begins: Any, polled: Any) -> None:
    """Work out V of every task in every state, and what each move is worth: the best greedy way that begins with it.

    polled (S, A) is written: -inf where no way begins so, 0 where nothing may be called.
    begins: room for the move that each task begins with in a state, as long as the longest row of values.
    """
    n_actions = len(actions)
    for a in range(n_actions):
        begins[a] = a
    for s in range(len(polled)):
        spot = spot_of(graph, s)
        settle(graph, own, outer, kept.value, spot, n_actions)
        kept.stale[s] = False
        tasks = uint64(graph.order_start[spot.kind])
        for x in range(uint64(graph.order_start[spot.kind + uint64(1)]) - tasks):
            _, _, slot, _ = best_call(graph, own, kept.value, spot, spot.tasks + uint64(graph.order[tasks + uint64(x)]))
            begins[uint64(n_actions) + uint64(x)] = begins[slot]
        polled[s] = -np.inf
        found = -np.inf
        seen = own
        if outer is not None:
            seen = outer
        for e in range(uint64(graph.begin[spot.tasks]), uint64(graph.end[spot.tasks])):
            slot = uint64(graph.slot[uint64(graph.child_start[spot.kind]) + e])
            worth = kept.value[spot.at + slot] + seen[spot.row + e]
            if worth > polled[s, begins[slot]]:
                polled[s, begins[slot]] = worth
            if worth > found:
                found = worth
        if found == -np.inf:
            polled[s] = 0.0
