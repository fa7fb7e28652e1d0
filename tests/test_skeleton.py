"""The skeleton: as connected as its shape, thin, on the middle line, and without spurs."""

import math

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import binary_fill_holes, distance_transform_edt, label

from qualrl.kernels.thinning import degrees, prune, thin
from qualrl.spatial.skeleton import LEAST_REACH, pruned_skeleton

SHAPES = arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12)))
CORNERS_TOO = np.ones((3, 3))


def counts(shape: np.ndarray) -> tuple[int, int]:
    """Pieces of a shape (by sides), and of what surrounds it (by corners)."""
    return label(shape)[1], label(~np.pad(shape, 1), CORNERS_TOO)[1]


def order_of(shape: np.ndarray) -> np.ndarray:
    """Cells from the edge inwards."""
    depth = distance_transform_edt(np.pad(shape, 1))[1:-1, 1:-1]
    cells = np.flatnonzero(shape)
    return cells[np.argsort(depth.ravel()[cells], kind="stable")].astype(np.int32)


@settings(deadline=None, max_examples=150)
@given(SHAPES)
def test_thinning_keeps_pieces_and_holes_and_takes_all_it_may(shape: np.ndarray) -> None:
    found, cells = thin(np.where(shape, 0, -1).astype(np.int32), order_of(shape))
    line = found >= 0
    assert cells.tolist() == np.flatnonzero(line).tolist()
    assert not (line & ~shape).any()
    assert counts(line) == counts(shape)
    for row, column in np.argwhere(line):
        without = line.copy()
        without[row, column] = False
        wide = np.pad(line, 1)
        beside = wide[row, column + 1], wide[row + 2, column + 1], wide[row + 1, column], wide[row + 1, column + 2]
        # What is left is an end, or holds the line (or a hole) together.
        assert sum(beside) <= 1 or counts(without) != counts(line)


def test_shapes_beside_each_other_are_thinned_each_by_itself() -> None:
    shapes = np.zeros((9, 20), np.int32)
    shapes[:, 10:] = 1
    order = np.concatenate([order_of(shapes == 0), order_of(shapes == 1)])
    line = thin(shapes, order)[0] >= 0
    assert line[:, :10].any()
    assert line[:, 10:].any()


def test_a_cross_of_ragged_corridors_has_one_joint_and_four_ends() -> None:
    generator = np.random.default_rng(5)
    free = np.zeros((200, 200), np.bool_)
    for at in range(200):
        free[90 - generator.integers(0, 4) : 111 + generator.integers(0, 4), at] = True
        free[at, 90 - generator.integers(0, 4) : 111 + generator.integers(0, 4)] = True
    free[[0, -1]] = free[:, [0, -1]] = False
    free = binary_fill_holes(free)
    distance = distance_transform_edt(free).astype(np.float32)
    line, cells = pruned_skeleton(np.where(free, 0, -1).astype(np.int32), distance)
    lines = nx.grid_2d_graph(*free.shape).subgraph([tuple(cell) for cell in np.argwhere(line >= 0).tolist()])
    assert nx.is_connected(lines)
    assert cells.tolist() == np.flatnonzero(line >= 0).tolist()
    assert degrees(line, cells).tolist() == [lines.degree[divmod(cell, 200)] for cell in cells.tolist()]
    joints = [node for node, degree in lines.degree if degree > 2]
    assert joints
    assert all(abs(row - 100) < 12 and abs(column - 100) < 12 for row, column in joints)
    assert sum(degree == 1 for _, degree in lines.degree) == 4


def textbook_pruned(graph: nx.Graph, distance: np.ndarray, least: float) -> nx.Graph:
    """Cells (row, column) as nodes; at each joint the shortest spur goes until none is left."""
    graph = graph.copy()
    while True:
        shortest = {}
        for tip in sorted(cell for cell, degree in graph.degree if degree == 1):
            line, before, here = [tip], tip, next(iter(graph[tip]))
            while graph.degree[here] == 2:
                line.append(here)
                before, here = here, next(cell for cell in graph[here] if cell != before)
            reach = math.dist(tip, here) + float(distance[tip]) - float(distance[here])
            is_spur = graph.degree[here] > 2 and reach < least * float(distance[here])
            if is_spur and reach < shortest.get(here, (math.inf,))[0]:
                shortest[here] = reach, line
        if not shortest:
            return graph
        for _, line in shortest.values():
            graph.remove_nodes_from(line)


@settings(deadline=None, max_examples=150)
@given(SHAPES, st.sampled_from([0.5, LEAST_REACH, 4.0]), st.integers(0, 2**32 - 1))
def test_spurs_go_as_in_the_textbook(shape: np.ndarray, least: float, seed: int) -> None:
    line = thin(np.where(shape, 0, -1).astype(np.int32), order_of(shape))[0] >= 0
    distance = np.random.default_rng(seed).integers(1, 4, shape.shape).astype(np.float32)
    graph = nx.grid_2d_graph(*shape.shape).subgraph([tuple(cell) for cell in np.argwhere(line).tolist()])
    left = np.where(line, 0, -1).astype(np.int32)
    prune(left, np.flatnonzero(line).astype(np.int32), distance, least)
    assert {tuple(cell) for cell in np.argwhere(left >= 0).tolist()} == set(textbook_pruned(graph, distance, least))
