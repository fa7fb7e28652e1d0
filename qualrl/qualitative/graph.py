"""The qualitative graph: a node a named region, an edge a qualitative action (paper, section 3).

Graphs are frozen networkx MultiDiGraphs keyed by name; two doors between the same two regions are two
edges, told apart by the door's name as edge key.  Attributes are plain numbers and strings, so that
every file format of networkx can hold them.  Lengths are metres, areas square metres.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import labels
from qualrl.spatial.region_map import Doorway, RegionMap

if TYPE_CHECKING:
    import networkx as nx

Graph: TypeAlias = "nx.MultiDiGraph[str]"

SCHEMA = "qualrl-graph/1"


def graph_of_regions(regions: RegionMap) -> Graph:
    """The graph of a map: every doorway is an action in both directions.

    An edge's ``length_m`` is the walk from the centre of one region through the doorway to the other's.
    """
    import networkx as nx  # it takes a tenth of a second, and most learners need no graph

    graph: Graph = nx.MultiDiGraph(schema=SCHEMA, resolution_m=float(regions.grid.resolution_m))
    for region in regions.regions:
        x_m, y_m = regions.grid.to_world(*region.centre)
        graph.add_node(
            region.name, kind=region.kind, area_m2=float(region.area_m2), cells=int(region.cells),
            row=int(region.centre[0]), column=int(region.centre[1]), x_m=float(x_m), y_m=float(y_m),
        )  # fmt: skip
    steps = _steps_from_centres(regions)
    names = regions.region_names
    for door in regions.doorways:
        length_m = _length_through(regions, steps, door) * regions.grid.resolution_m
        for here, there in (door.pair, door.pair[::-1]):
            graph.add_edge(
                names[here], names[there], key=door.name, door=door.name,
                action=f"go through {door.name} to {names[there]}", relation="adjacent",
                width_m=float(door.width_m), length_m=float(length_m),
            )  # fmt: skip
    nx.freeze(graph)
    return graph


def _steps_from_centres(regions: RegionMap) -> NDArray[np.int32]:
    """(H, W) steps from the centre of its region to each cell, walking inside the region."""
    centres = np.array([region.centre for region in regions.regions], np.int32).reshape(-1, 2)
    found: NDArray[np.int32] = labels.steps_within(regions.label, centres)
    return found


def _length_through(regions: RegionMap, steps: NDArray[np.int32], door: Doorway) -> int:
    """Steps from centre to centre through a doorway: the shortest way over one of its crossings."""
    return min(int(steps[here]) + 1 + int(steps[there]) for here, there in crossings_of(regions, door))


def crossings_of(regions: RegionMap, door: Doorway) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The steps that lead through a doorway: pairs of cells, the first in the first region of its pair."""
    label = regions.label
    height, width = label.shape
    first, second = door.pair
    found = set()
    for row, column in door.cells.tolist():
        here = int(label[row, column])
        for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if 0 <= r < height and 0 <= c < width and {here, int(label[r, c])} == {first, second}:
                ends = ((row, column), (r, c))
                found.add(ends if here == first else ends[::-1])
    return sorted(found)


def graph_of_mapping(names: tuple[str, ...], crossings: Iterable[tuple[int, int]]) -> Graph:
    """The graph of a model without a map: an edge for each ordered pair of regions that some outcome crosses."""
    import networkx as nx  # as above

    graph: Graph = nx.MultiDiGraph(schema=SCHEMA)
    graph.add_nodes_from(names)
    for here, there in crossings:
        graph.add_edge(
            names[here], names[there], key=f"{names[here]} to {names[there]}",
            action=f"move from {names[here]} to {names[there]}", relation="adjacent",
        )  # fmt: skip
    nx.freeze(graph)
    return graph
