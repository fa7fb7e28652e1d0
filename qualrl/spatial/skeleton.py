"""The skeleton of corridors: lines midway between the walls, without the spurs that corners and niches leave.

H, W: rows, columns.  Lengths are in cells.
"""

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.thinning import prune, thin

LEAST_REACH = 1.5
"""A branch reaches at least this many times its joint's distance from the walls beyond the disc there."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


def pruned_skeleton(label: Ints, distance: Floats) -> "nx.Graph[int]":
    """Cells (flat indices) on the middle lines of each shape, joined where they follow each other.

    label (H, W), -1 outside every shape; distance (H, W) to the nearest cell that is not free.
    """
    order = np.flatnonzero(label >= 0).astype(np.int32)
    # Whole hundredths: distances that differ by rounding only must not decide.
    order = order[np.argsort(np.rint(distance.ravel()[order] * 100), kind="stable")]
    line = np.where(thin(label, order), label, -1).astype(np.int32)
    return _joined(prune(line, distance, LEAST_REACH))


def _joined(label: Ints) -> "nx.Graph[int]":
    """Cells of the same line that share a side."""
    number = np.arange(label.size).reshape(label.shape)
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(number[label >= 0].tolist())
    for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        follows = (label[here] >= 0) & (label[here] == label[there])
        graph.add_edges_from(zip(number[here][follows].tolist(), number[there][follows].tolist(), strict=True))
    return graph
