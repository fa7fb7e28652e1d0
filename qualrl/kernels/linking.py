"""Pieces of a graph that is given as pairs of nodes.

N nodes, E links.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bonds import find
from qualrl.kernels.jit import compiled

Ints = NDArray[np.int32]


@compiled
def pieces(start: NDArray[np.int64], end: NDArray[np.int64], nodes: int) -> Ints:
    """(N,) number of the piece that each node is in, counted in the order of their first nodes.

    start, end (E,): the two nodes of each link.
    """
    parent = np.arange(nodes).astype(np.int32)
    for link in range(len(start)):
        one, other = find(parent, start[link]), find(parent, end[link])
        parent[max(one, other)] = min(one, other)
    piece, count = np.empty(nodes, np.int32), 0
    for node in range(nodes):
        root = find(parent, node)
        if root == node:
            piece[node] = count
            count += 1
        else:
            piece[node] = piece[root]
    return piece
