"""A flat table of action values from what a hierarchical learner knows, by polling.

S states, A moves, W entries, K options of a state.  q[s, a] is the best value among the choices at the top in s
whose greedy way begins with move a, and -inf where there is none; rows of terminal states are 0.
A learner that keeps to a choice until it has ended is asked for its way from the start too: where a choice is under
way there is nothing to choose, and what it once thought of other choices there it may not have looked at for long.
"""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.polling import keep
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.landmark_ways import LandmarkWays, likely_targets, terminal_states

Floats = NDArray[np.float64]
Running = TypeVar("Running")


def of_winners(ways: LandmarkWays, first: NDArray[np.int64], values: Floats) -> Floats:
    """When the option whose top value is largest acts: its best move, and what it hopes for.

    Where there is no option the moves are all alike: 0.
    """
    polled, n_actions = _nothing(ways), ways.n_actions
    polled[ways.helpless] = 0.0
    for kind, k in enumerate(np.diff(ways.option_start).tolist()):
        states = _open_states(ways, kind)
        states = states[~ways.helpless[states]]
        if len(states):
            top, block = _rows(first, values, states, k, n_actions)
            won = block[np.arange(len(states)), top[:, :k].argmax(axis=1)]
            polled[states, won.argmax(axis=1)] = won.max(axis=1)
    return polled


def keep_to_choices(
    polled: Floats, model: HybridMDP, step: Callable[[int, Running | None], tuple[Running | None, int, bool]]
) -> Floats:
    """The same table, but along the learner's greedy way from the model's start only the move of what is under way.

    step(state, what runs) -> (what runs now, the move, whether that was chosen at the top just now).
    Such a move keeps its polled value, or has that of the choice it belongs to.  Where something was chosen, moves
    that are as good count for a little less, so that the way is the learner's own.  Writes to ``polled``.
    """
    if model.start is None:
        return polled
    likely, terminal = likely_targets(model), terminal_states(model)
    state, running, value, passed = model.start, None, 0.0, set[int]()
    while not terminal[state] and state not in passed:
        passed.add(state)
        running, move, fresh = step(state, running)
        value = keep(polled, state, move, fresh, value)
        state = int(likely[state, move])
    return polled


def _nothing(ways: LandmarkWays) -> Floats:
    """(S, A) -inf, and 0 in terminal states."""
    polled = np.full((len(ways.terminal), ways.n_actions), -np.inf)
    polled[ways.terminal] = 0.0
    return polled


def _open_states(ways: LandmarkWays, kind: int) -> NDArray[np.int64]:
    states = ways.states_of_kind(kind)
    return states[~ways.terminal[states]]


def _rows(
    first: NDArray[np.int64], values: Floats, states: NDArray[np.int64], k: int, n_actions: int
) -> tuple[Floats, Floats]:
    """((states, K + A) top values, (states, K, A) blocks)."""
    row = first[states][:, None]
    top = values[row + np.arange(k + n_actions)]
    block = values[row + k + n_actions + np.arange(k * n_actions)]
    return top, block.reshape(len(states), k, n_actions)
