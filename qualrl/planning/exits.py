"""By which doorway the best way leaves each region, for all states at once.

S states, A moves.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import leaving
from qualrl.kernels.leaving import ASTRAY, GOAL_HERE, NO_WAY
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import doors_passed
from qualrl.planning.legs import EXCURSION_STEPS
from qualrl.planning.planner import climb_values
from qualrl.solving.exact import ExactValues, crossings_to_goal
from qualrl.spatial.region_map import RegionMap

__all__ = ["ASTRAY", "GOAL_HERE", "NO_WAY", "exits"]


def exits(model: HybridMDP, regions: RegionMap, exact: ExactValues) -> NDArray[np.int32]:
    """(S,) index of the doorway by which the way that ``planner.exact_walk`` finds from a state leaves its region.

    GOAL_HERE where it ends in the region, NO_WAY where no way leads to the goal, ASTRAY where one does but values do
    not tell it, so that ``exact_walk`` raises NoPlanError.  As in plans, brief excursions over a border do not count.
    """
    world, shift = model.grid, exact.shift
    dislike = crossings_to_goal(world, exact, model.region_of)
    reward = world.move_reward + shift * (1 - world.gamma)
    moves = leaving.best_moves(
        world.successor, reward, world.goal, world.goal_reward + shift, world.gamma, world.slip, exact.shifted, dislike
    )
    found = np.full(len(model), NO_WAY, np.int32)
    found[world.goal] = GOAL_HERE
    door_of = _door_of_steps(model, regions)

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


def _door_of_steps(model: HybridMDP, regions: RegionMap) -> NDArray[np.int32]:
    """(S * A,) the doorway that each move into another region passes; -1 for the others."""
    successor, n_actions = model.grid.successor, model.grid.n_actions
    steps = np.flatnonzero((model.region_of[successor] != model.region_of[:, None]).ravel())
    door_of = np.full(successor.size, -1, np.int32)
    door_of[steps] = doors_passed(model, regions, steps // n_actions, successor.ravel()[steps])
    return door_of
