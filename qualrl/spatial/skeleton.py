"""The skeleton of corridors: lines midway between the walls, without the spurs that corners and niches leave.

H, W: rows, columns.  Lengths are in cells.
"""

import math

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.thinning import thin

LEAST_REACH = 1.5
"""A branch reaches at least this many times its root's distance from the walls beyond the disc there."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


def pruned_skeleton(label: Ints, distance: Floats) -> "nx.Graph[int]":
    """Cells (flat indices) on the middle lines of each shape, joined where they follow each other.

    label (H, W), -1 outside every shape; distance (H, W) to the nearest cell that is not free.
    """
    order = np.flatnonzero(label >= 0).astype(np.int32)
    # Whole hundredths: distances that differ by rounding only must not decide.
    order = order[np.argsort(np.rint(distance.ravel()[order] * 100), kind="stable")]
    graph = _joined(np.where(thin(label, order), label, -1))
    deep = distance.ravel()
    while spurs := _spurs(graph, deep, label.shape[1]):
        # At each joint the shortest only: it goes, and what it met there may be one line with the longer one.
        for branch in spurs.values():
            graph.remove_nodes_from(branch)
    return graph


def _joined(label: Ints) -> "nx.Graph[int]":
    """Cells of the same line that share a side."""
    number = np.arange(label.size).reshape(label.shape)
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(number[label >= 0].tolist())
    for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        follows = (label[here] >= 0) & (label[here] == label[there])
        graph.add_edges_from(zip(number[here][follows].tolist(), number[there][follows].tolist(), strict=True))
    return graph


def _spurs(graph: "nx.Graph[int]", distance: Floats, width: int) -> dict[int, list[int]]:
    """By joint, the shortest line that leads off from it, ends, and is too short; cells from the tip on."""
    found = dict[int, tuple[float, list[int]]]()
    for tip in sorted(node for node, degree in graph.degree if degree == 1):
        line, before, here = [tip], tip, next(iter(graph[tip]))
        while graph.degree[here] == 2:
            line.append(here)
            before, here = here, next(node for node in graph[here] if node != before)
        away = math.dist(divmod(tip, width), divmod(here, width))
        reach = away + float(distance[tip]) - float(distance[here])
        is_short = graph.degree[here] > 2 and reach < LEAST_REACH * float(distance[here])
        if is_short and (here not in found or reach < found[here][0]):
            found[here] = reach, line
    return {joint: line for joint, (_, line) in found.items()}
