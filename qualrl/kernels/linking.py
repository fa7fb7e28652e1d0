"""Pieces of a graph that is given as pairs of nodes.

N nodes, E links.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bonds import find
from qualrl.kernels.jit import compiled_bare

Ints = NDArray[np.int32]


def pieces(start: NDArray[np.int64], end: NDArray[np.int64], nodes: int) -> Ints:
    """(N,) number of the piece that each node is in, counted in the order of their first nodes.

    start, end (E,): the two nodes of each link.
    """
    piece = np.empty(nodes, np.int32)
    _number_pieces(start, end, np.arange(nodes, dtype=np.int32), piece)
    return piece


@compiled_bare
def _number_pieces(start: NDArray[np.int64], end: NDArray[np.int64], parent: Ints, piece: Ints) -> None:
    """The forest of pieces, parent (N,), is of single nodes at first."""
    for link in range(len(start)):
        one, other = find(parent, start[link]), find(parent, end[link])
        parent[max(one, other)] = min(one, other)
    count = 0
    for node in range(piece.size):
        root = find(parent, node)
        if root == node:
            piece[node] = count
            count += 1
        else:
            piece[node] = piece[root]
