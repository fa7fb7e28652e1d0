"""Action values polled from what a hierarchical learner knows; compiled.

S states, A moves.  ``polled`` (S, A): the best value among the choices at the top in s whose greedy way begins with a
move, -inf where there is none, and 0 in terminal states.  See ``learning.polling``.
"""

from typing import Any

import numpy as np
from numba import int64

from qualrl.kernels.jit import compiled_bare, compiled_inline
from qualrl.kernels.tasks import scan, spot_of

TIE = 1e-9
"""By this share of its value a move as good as the learner's own counts for less."""


@compiled_inline
def _move_of(q: Any, policy: Any, here: Any, place: Any, n_actions: Any) -> Any:
    """The move with which a choice at the top begins: as the policy says, or the best of the option's block."""
    move = place - here.k
    if policy is not None:
        move = int64(policy[here.row + place])
    if policy is None and place < here.k:
        low = here.row + here.k + n_actions + place * n_actions
        move = scan(q, low, low + n_actions)[1] - low
    return move


def keep(polled: Any, s: Any, move: Any, fresh: Any, value: Any) -> Any:
    """Keep to a move of the learner's way in a state; what it is worth, ``value`` where nothing was polled for it.

    fresh: whether something was chosen at the top there.
    """
    if polled[s, move] > -np.inf:
        value = polled[s, move]
    less = value - TIE * abs(value)
    for a in range(polled.shape[1]):
        if a != move and (not fresh or polled[s, a] >= less):
            polled[s, a] = less if fresh else -np.inf
    if not fresh:
        polled[s, move] = value
    return value


_keep = compiled_inline(keep)


@compiled_bare
def poll(
    rows: Any, policy: Any, terminal: Any, likely: Any, actions: Any, start: Any, q: Any, passed: Any, polled: Any
) -> Any:
    """Poll the choices of every state, then keep to the greedy way from ``start``, unless it is negative.

    rows, policy, actions: as in ``tasks.run_steps``.  terminal (S,).  likely (S, A): where each move leads most often.
    passed (S,) bool: False at first, the states of the way at the end.
    """
    n_actions = len(actions)
    n_options = rows.position.size // (rows.option_start.size - 1)
    for s in range(terminal.size):
        for a in range(n_actions):
            polled[s, a] = 0.0 if terminal[s] else -np.inf
        if not terminal[s]:
            here = spot_of(rows, n_options, s)
            for place in range(here.k + n_actions):
                worth = q[here.row + place]
                if worth > -np.inf:
                    move = _move_of(q, policy, here, place, n_actions)
                    if worth > polled[s, move]:
                        polled[s, move] = worth
    at, running, value = int64(start), int64(-1), 0.0
    while at >= 0 and not terminal[at] and not passed[at]:
        passed[at] = True
        here = spot_of(rows, n_options, at)
        pick = int64(rows.position[here.base + running]) if running >= 0 else int64(-1)
        fresh = pick < 0 or q[here.row + pick] == -np.inf
        if fresh:
            pick = scan(q, here.row, here.row + here.k + n_actions)[1] - here.row
        running = int64(rows.option[here.start + pick]) if pick < here.k else int64(-1)
        move = _move_of(q, policy, here, pick, n_actions)
        value = _keep(polled, at, move, fresh, value)
        at = int64(likely[at, move])
