"""The way with the least in the way: against Dijkstra's algorithm on a graph of cells, by networkx."""

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.kernels.obstacles import DOWN, NEVER, RIGHT, least_way


@st.composite
def grids(draw):
    """Weights, hard cells, closed doors, what those weigh, and two cells."""
    height, width = draw(st.integers(1, 7)), draw(st.integers(1, 7))
    cells = height * width
    weight = draw(st.lists(st.sampled_from([0, 0, 1, 1, NEVER]), min_size=cells, max_size=cells))
    closed = draw(st.lists(st.sampled_from([0, 0, 0, RIGHT, DOWN, RIGHT | DOWN]), min_size=cells, max_size=cells))
    cell = st.integers(0, cells - 1)
    shape = (height, width)
    hard = draw(st.lists(st.integers(0, 1), min_size=cells, max_size=cells))
    arrays = (np.array(numbers, np.uint8).reshape(shape) for numbers in (weight, hard, closed))
    return *arrays, draw(st.sampled_from([0, 1, NEVER])), draw(cell), draw(cell)


def graph_of(weight, hard, closed, closing):
    """Cells and steps: what one weighs counts more than all hard cells can, and these more than all steps."""
    height, width = weight.shape
    graph = nx.DiGraph()
    graph.add_nodes_from(np.ndindex(weight.shape))
    for row, column in np.ndindex(weight.shape):
        for to, bit in (((row, column + 1), RIGHT), ((row + 1, column), DOWN)):
            if to[0] < height and to[1] < width:
                shut = closing if closed[row, column] & bit else 0
                for a, b in (((row, column), to), (to, (row, column))):
                    cost = max(int(weight[b]), shut)
                    if cost < NEVER:
                        graph.add_edge(a, b, weight=cost * 10**6 + int(hard[b]) * 1000 + 1)
    return graph


@settings(deadline=None, max_examples=300)
@given(grids())
def test_no_way_weighs_less_or_is_better_for_the_same_weight(grid):
    weight, hard, closed, closing, source, target = grid
    ends = [tuple(int(at) for at in np.unravel_index(cell, weight.shape)) for cell in (source, target)]
    graph = graph_of(weight, hard, closed, closing)
    way = [tuple(cell) for cell in least_way(weight, hard, closed, closing, source, target).tolist()]
    if not nx.has_path(graph, *ends):
        assert way == []
        return
    assert [way[0], way[-1]] == ends
    assert nx.is_path(graph, way)
    assert nx.path_weight(graph, way, "weight") == nx.shortest_path_length(graph, *ends, weight="weight")
