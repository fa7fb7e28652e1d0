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
    return _joined(prune(thin(label, order), distance, LEAST_REACH))


def _joined(label: Ints) -> "nx.Graph[int]":
    """Cells of the same line that share a side."""
    width, shape = label.shape[1], label.ravel()
    graph: nx.Graph[int] = nx.Graph()
    cells = np.flatnonzero(shape >= 0)
    graph.add_nodes_from(cells.tolist())
    for step, rest in ((width, cells[cells < shape.size - width]), (1, cells[cells % width < width - 1])):
        follows = rest[shape[rest] == shape[rest + step]]
        graph.add_edges_from(zip(follows.tolist(), (follows + step).tolist(), strict=True))
    return graph
