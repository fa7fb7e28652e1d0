"""Worlds as arrays, for peers' scripts: mazes, and options between their landmarks."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import qualrl
from qualrl.models.landmark_ways import NONE, LandmarkWays


def maze_data(model: qualrl.HybridMDP, alpha: float, epsilon: float) -> dict[str, Any]:
    """A world whose moves do not slip, and how to learn it."""
    grid = model.grid
    return {
        "successor": grid.successor, "start": model.start, "goal": grid.goal, "step_reward": grid.step_reward,
        "goal_reward": grid.goal_reward, "gamma": grid.gamma, "alpha": alpha, "epsilon": epsilon,
    }  # fmt: skip


def option_moves(ways: LandmarkWays, n_states: int) -> NDArray[np.uint8]:
    """(O, S) the move that each option makes in each state; NONE where it may not be taken and ends."""
    moves = np.full((len(ways), n_states), NONE, np.uint8)
    for kind, (begin, end) in enumerate(zip(ways.option_start, ways.option_start[1:], strict=False)):
        moves[ways.option[begin:end, None], ways.states_of_kind(kind)] = ways.table(ways.move, kind).T
    return moves
