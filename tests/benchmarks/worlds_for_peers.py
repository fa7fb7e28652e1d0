"""Worlds as arrays, for peers' scripts: mazes, options between their landmarks, and sparse tables."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

import qualrl
from qualrl.models.grid_world import GridWorld
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


def sparse_table(grid: GridWorld) -> tuple[csr_array, NDArray[np.float64]]:
    """((S A, S) probabilities, (S A,) expected rewards) of a world whose goal is kept for ever, at no reward."""
    table = grid.table()
    target, reward = table.target.astype(np.int32), table.reward.copy()
    at_goal = slice(*table.row_start[[grid.goal * grid.n_actions, (grid.goal + 1) * grid.n_actions]])
    target[at_goal], reward[at_goal] = grid.goal, 0.0
    rows = len(table.row_start) - 1
    matrix = csr_array((table.probability.copy(), target, table.row_start.astype(np.int32)), (rows, len(grid)))
    matrix.sum_duplicates()
    return matrix, np.add.reduceat(table.probability * reward, table.row_start[:-1])
