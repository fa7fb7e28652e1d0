"""By which doorway the best way leaves each region, for all states at once.

S states, A moves.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import leaving
from qualrl.kernels.leaving import ASTRAY, GOAL_HERE, NO_WAY
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import doors_of_moves
from qualrl.planning.legs import EXCURSION_STEPS
from qualrl.planning.planner import climb_values
from qualrl.solving.exact import ExactValues, crossings_to_goal, shifted_rewards
from qualrl.spatial.region_map import RegionMap

__all__ = ["ASTRAY", "GOAL_HERE", "NO_WAY", "ExitsAsGood", "best_moves", "exits"]


def exits(model: HybridMDP, regions: RegionMap, exact: ExactValues) -> NDArray[np.int32]:
    """(S,) index of the doorway by which the way that ``planner.exact_walk`` finds from a state leaves its region.

    GOAL_HERE where it ends in the region, NO_WAY where no way leads to the goal, ASTRAY where one does but values do
    not tell it, so that ``exact_walk`` raises NoPlanError.  As in plans, brief excursions over a border do not count.
    """
    world = model.grid
    dislike = crossings_to_goal(world, exact, model.region_of)
    moves = best_moves(model, exact, dislike)
    found = np.full(len(model), NO_WAY, np.int32)
    found[world.goal] = GOAL_HERE
    door_of = doors_of_moves(model, regions, np.arange(len(model))).ravel()

    def follow(moves: NDArray[np.uint8], value: NDArray[np.float64], starts: NDArray[np.int64]) -> None:
        leaving.leave_by(
            world.successor, moves, value, world.goal, model.region_of, door_of, starts, EXCURSION_STEPS - 1, found
        )

    follow(moves, exact.shifted, world.outward)
    astray = np.flatnonzero(found == ASTRAY)
    if world.slip > 0 and len(astray):
        ahead, unpaid = climb_values(world, exact), np.zeros(world.n_actions)
        follow(leaving.best_moves(world.successor, unpaid, -1, 0.0, 1.0, 0.0, ahead, dislike), ahead, astray)
    return found


class ExitsAsGood:
    """By which doorways a region may be left if no move slips, whichever of the moves that are as good are made."""

    def __init__(self, model: HybridMDP, regions: RegionMap, moves: NDArray[np.uint8]) -> None:
        """Moves (S,): a bit for each that is as good as any, see ``best_moves``."""
        self.model, self.moves = model, moves
        self.door_of = doors_of_moves(model, regions, np.arange(len(model))).ravel()

    def of(self, cells: NDArray[np.int64]) -> set[int]:
        """Doorways for a region's states (N,), all together; GOAL_HERE for the goal.  None of them may be astray."""
        successor, goal, region_of = self.model.grid.successor, self.model.grid.goal, self.model.region_of
        seen, found, home = np.zeros(len(self.model), np.bool_), set[int](), region_of[cells[0]]
        while len(cells):
            seen[cells] = True
            if seen[goal]:
                found.add(GOAL_HERE)
            cells = cells[cells != goal]
            rows, actions = np.nonzero((self.moves[cells][:, None] >> np.arange(successor.shape[1])) & 1)
            states, ends = cells[rows], successor[cells[rows], actions].astype(np.int64)
            out = region_of[ends] != home
            back = list[int]()
            for state, action in zip(states[out].tolist(), actions[out].tolist(), strict=True):
                again, _ = leaving.comes_back(
                    successor, self.moves, goal, region_of, state, action, EXCURSION_STEPS - 1
                )  # fmt: skip
                if again >= 0:
                    back.append(again)
                else:
                    found.add(int(self.door_of[state * successor.shape[1] + action]))
            ahead = np.unique(np.concatenate([ends[~out], np.array(back, np.int64)]))
            cells = ahead[~seen[ahead]]
        return found


def best_moves(model: HybridMDP, exact: ExactValues, dislike: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(S,) uint8: a bit for each move that is as good as any and leads to a state of least dislike (S,)."""
    world, shift = model.grid, exact.shift
    found: NDArray[np.uint8] = leaving.best_moves(
        world.successor, shifted_rewards(world.move_reward, shift, world.gamma), world.goal, world.goal_reward + shift,
        world.gamma, world.slip, exact.shifted, dislike,
    )  # fmt: skip
    return found
