"""Following a policy: the walk that results when every move succeeds."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from qualrl.models.grid_world import GridWorld
from qualrl.solving.exact import World

ActionValues = Callable[[int], NDArray[np.float64]]
"""From a state to the (A,) values of its actions."""


def likeliest_next(world: World, state: int, action: int) -> int:
    """Where an action leads most often: the intended cell on a grid."""
    if isinstance(world, GridWorld):
        return int(world.successor[state, action])
    row = state * world.n_actions + action
    entries = slice(world.row_start[row], world.row_start[row + 1])
    return int(world.target[entries][np.argmax(world.probability[entries])])


def is_goal(world: World, state: int) -> bool:
    """Whether an episode ends in this state."""
    return state == world.goal if isinstance(world, GridWorld) else bool(world.terminal[state])


def greedy_walk(
    world: World, action_values: ActionValues, start: int, dislike: NDArray[np.int32] | None = None
) -> tuple[list[int], bool]:
    """(states, whether the goal was reached) of the walk that always takes the best action.

    Among equally good actions (to a relative 1e-12) it takes one that leads to a state of least ``dislike``
    (S,), and among those keeps on as before, so that paths are straight.
    The walk ends at the goal, or where it comes back to a state: from there it would go round for ever.
    """
    walk, seen, last = [start], {start}, -1
    while not is_goal(world, walk[-1]):
        values = action_values(walk[-1])
        best = values.max()
        good = np.flatnonzero(values >= best - 1e-12 * abs(best))
        following = [likeliest_next(world, walk[-1], int(action)) for action in good]
        if dislike is not None:
            least = dislike[following].min()
            good = good[dislike[following] == least]
        last = last if last in good else int(good[0])
        state = likeliest_next(world, walk[-1], last)
        walk.append(state)
        if state in seen:
            return walk, False
        seen.add(state)
    return walk, True
