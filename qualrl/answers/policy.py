"""A best move for every state at once."""

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.exits import best_moves
from qualrl.solving.exact import ExactValues, crossings_to_goal


def best_policy(model: HybridMDP, exact: ExactValues) -> NDArray[np.int64]:
    """(S,) a best move; of equally good ones the first that crosses the fewest borders."""
    good = best_moves(model, exact, crossings_to_goal(model.grid, exact, model.region_of))
    bits = np.unpackbits(good[:, None], axis=1, bitorder="little")
    first: NDArray[np.int64] = bits.argmax(axis=1).astype(np.int64)
    return first
