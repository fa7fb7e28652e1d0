"""A best move for every state at once."""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import leaving
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import ExactValues, crossings_to_goal


def best_policy(model: HybridMDP, exact: ExactValues) -> NDArray[np.int64]:
    """(S,) a best move; of equally good ones the first that crosses the fewest borders."""
    world, shift = model.grid, exact.shift
    good = leaving.best_moves(
        world.successor, world.move_reward + shift * (1 - world.gamma), world.goal, world.goal_reward + shift,
        world.gamma, world.slip, exact.shifted, crossings_to_goal(world, exact, model.region_of),
    )  # fmt: skip
    bits = np.unpackbits(good[:, None], axis=1, bitorder="little")
    first: NDArray[np.int64] = bits.argmax(axis=1).astype(np.int64)
    return first
