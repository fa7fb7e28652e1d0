"""The qualitative graph against the map it was made from."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings

import qualrl
from qualrl.qualitative.graph import crossings_of, graph_of_regions
from tests import oracles
from tests.worlds import TWO_ROOMS, free_masks, grid_of


@given(free_masks(side=12, connected=False))
@settings(max_examples=80, deadline=None)
def test_the_graph_is_connected_exactly_when_the_free_space_is(free):
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    cells = oracles.GridTwin(free, None).graph().to_undirected()
    graph = graph_of_regions(regions).to_undirected()
    assert nx.number_connected_components(graph) == nx.number_connected_components(cells)


@given(free_masks(side=10))
@settings(max_examples=60, deadline=None)
def test_every_step_between_regions_passes_exactly_one_doorway(free):
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    cells = oracles.GridTwin(free, None).graph()
    steps = {frozenset(edge) for edge in cells.edges if regions.label[edge[0]] != regions.label[edge[1]]}
    through = [frozenset(pair) for door in regions.doorways for pair in crossings_of(regions, door)]
    assert set(through) == steps
    assert len(through) == len(steps)


@given(free_masks(side=8))
@settings(max_examples=40, deadline=None)
def test_edge_lengths_are_walks_between_centres_inside_the_two_regions(free):
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.5))
    cells = oracles.GridTwin(free, None).graph()
    graph = graph_of_regions(regions)
    for door in regions.doorways:
        a, b = (regions.regions[index] for index in door.pair)
        best = np.inf
        for here, there in crossings_of(regions, door):
            inside_a = cells.subgraph([c for c in cells if regions.label[c] == door.pair[0]])
            inside_b = cells.subgraph([c for c in cells if regions.label[c] == door.pair[1]])
            steps = nx.shortest_path_length(inside_a, a.centre, here) + 1
            best = min(best, steps + nx.shortest_path_length(inside_b, there, b.centre))
        for edge in ((a.name, b.name, door.name), (b.name, a.name, door.name)):
            assert graph.edges[edge]["length_m"] == pytest.approx(best * 0.5)


def test_graphs_are_frozen_and_say_what_an_edge_does():
    graph = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B").graph
    assert nx.is_frozen(graph)
    edge = graph.edges["room A", "room B", "door 1"]
    assert edge["action"] == "go through door 1 to room B"
    assert edge["width_m"] == 1.0
