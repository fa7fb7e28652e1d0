"""Boosted decision trees, asked one row of features at a time.

T: trees.  N: rows.  F: features.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled, compiled_part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Trees(NamedTuple):
    """Boosted trees: the sum of their leaves is the logarithm of the odds.  Nodes of all trees in one row."""

    root: Ints
    """(T,) first node of each tree."""
    feature: Ints
    """(nodes,) -1 in leaves."""
    threshold: NDArray[np.float32]
    """(nodes,) a value up to it goes on to the node's left, else right."""
    left: Ints
    right: Ints
    leaf: NDArray[np.float32]
    """(nodes,) what a leaf adds."""
    start: float
    """What the sum starts from."""


@compiled
def odds_of(trees: Trees, features: Floats) -> Floats:
    """(N,) logarithm of the odds that the trees give to rows (N, F) of features."""
    found = np.empty(len(features))
    for row in range(len(features)):
        found[row] = odds(trees, features[row])
    return found


@compiled_part
def odds(trees: Trees, features: Floats) -> float:
    """The logarithm of the odds that the trees give to features (F,)."""
    total = trees.start
    for tree in range(len(trees.root)):
        node = trees.root[tree]
        while trees.feature[node] >= 0:
            goes_left = features[trees.feature[node]] <= trees.threshold[node]
            node = trees.left[node] if goes_left else trees.right[node]
        total += trees.leaf[node]
    return total
