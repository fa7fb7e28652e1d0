"""Which regions a way from the start to the goal may pass."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.once import once

Pair = tuple[int, int]


@once
def relevant_regions(model: HybridMDP) -> NDArray[np.bool_]:
    """(R,) regions that a way from the start to the goal may pass without going through any doorway twice.

    A region may be passed more than once: a way may leave it by one doorway and come back by another.
    All of them when episodes start at random, or when the model came without a map: other rewards than the
    goal's could then lie off the way.
    """
    regions = len(model.region_names)
    if model.start is None or not isinstance(model.world, GridWorld):
        return np.ones(regions, np.bool_)
    first, last = int(model.region_of[model.start]), int(model.region_of[model.world.goal])
    # What lies on such a way is on a closed one with the step from last to first, which passes no doorway twice.
    return on_closed_ways([*_doorways(model), (first, last)], first, regions)


def _doorways(model: HybridMDP) -> list[Pair]:
    """The regions on either side of each doorway."""
    if model.own_graph is None:  # made for this alone, a graph would load networkx
        assert model.regions is not None
        return [door.pair for door in model.regions.doorways]
    number = {name: index for index, name in enumerate(model.region_names)}
    return [(number[here], number[there]) for here, there, _ in model.own_graph.to_undirected().edges(keys=True)]


def on_closed_ways(edges: Sequence[Pair], first: int, nodes: int) -> NDArray[np.bool_]:
    """(N,) nodes on closed ways from ``first`` that use no edge twice: what no single edge, taken away, cuts off.

    Edges lie between nodes 0 .. N - 1; several may join the same two.
    """
    beside: list[list[Pair]] = [[] for _ in range(nodes)]
    for edge, (here, there) in enumerate(edges):
        beside[here].append((there, edge))
        beside[there].append((here, edge))
    order, parent, depth, tree = [first], {first: first}, {first: 0}, set[int]()
    ahead = [(first, iter(beside[first]))]
    while ahead:
        here, rest = ahead[-1]
        for there, edge in rest:
            if there not in parent:
                parent[there], depth[there] = here, depth[here] + 1
                tree.add(edge)
                order.append(there)
                ahead.append((there, iter(beside[there])))
                break
        else:
            ahead.pop()
    # An edge off the tree joins a node to one above it, depth first: it goes round every edge of the tree between.
    around = [0] * nodes
    for edge, (here, there) in enumerate(edges):
        if edge not in tree and here in parent:
            upper, lower = sorted((here, there), key=depth.__getitem__)
            around[lower] += 1
            around[upper] -= 1
    for node in reversed(order[1:]):
        around[parent[node]] += around[node]
    found = np.zeros(nodes, np.bool_)
    found[first] = True
    for node in order[1:]:
        found[node] = found[parent[node]] and around[node] > 0
    return found
