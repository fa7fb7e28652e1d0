"""Best moves for every state at once."""

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.exits import best_moves
from qualrl.solving.exact import ExactValues, all_action_values, crossings_to_goal, off_of


def best_policy(model: HybridMDP, exact: ExactValues) -> NDArray[np.int64]:
    """(S,) a best move; of equally good ones the first that crosses the fewest borders."""
    good = best_moves(model, exact, crossings_to_goal(model.grid, exact, model.region_of))
    bits = np.unpackbits(good[:, None], axis=1, bitorder="little")
    first: NDArray[np.int64] = bits.argmax(axis=1).astype(np.int64)
    return first


def moves_as_good(model: HybridMDP, exact: ExactValues) -> NDArray[np.bool_]:
    """(S, A) moves that may be as good as any, as far as settled values tell, and lead to as few borders ahead."""
    worth = all_action_values(model.grid, exact.shifted, exact.shift)
    best = worth.max(axis=1, keepdims=True)
    good = worth >= best - 2 * off_of(model.grid, best, exact.shift)
    borders = crossings_to_goal(model.grid, exact, model.region_of)[model.grid.successor]
    fewest = np.where(good, borders, np.iinfo(borders.dtype).max).min(axis=1, keepdims=True)
    found: NDArray[np.bool_] = good & (borders == fewest)
    return found
