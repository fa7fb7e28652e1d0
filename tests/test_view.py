"""The view that the segmentation has of a grid: the same however the map lies, and taken back cell by cell."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import qualrl
from qualrl.spatial.floor_plans import random_floor_plan
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.posture import Posture, posture
from qualrl.spatial.view import look, shrunk
from tests.oracles_regions import adjusted_rand_index

FLAGS = arrays(np.bool_, st.tuples(st.integers(1, 7), st.integers(1, 7)))
POSTURES = [Posture(*shown) for shown in product((False, True), repeat=3)]
CHANGES = [lambda image, turns=turns, flip=flip: np.rot90(image.T if flip else image, turns)
           for turns in range(4) for flip in (False, True)]  # fmt: skip


@settings(deadline=None, max_examples=300)
@given(FLAGS)
def test_all_turns_of_a_map_are_shown_alike(free):
    shown = [posture(turned := change(free)).of(turned) for change in CHANGES]
    for each in shown[1:]:
        np.testing.assert_array_equal(each, shown[0])
    height, width = shown[0].shape
    assert width >= height
    columns = shown[0].sum(axis=0)
    assert (columns * np.arange(width)).sum() * 2 <= columns.sum() * (width - 1)


@given(FLAGS, st.sampled_from(POSTURES))
def test_what_is_shown_goes_back_to_where_it_was(flags, shown):
    np.testing.assert_array_equal(shown.back(shown.of(flags)), flags)


@settings(deadline=None, max_examples=100)
@given(FLAGS.filter(np.any), st.sampled_from([0.05, 0.1, 1.0]))
def test_the_grid_gets_back_what_the_view_had_of_it(free, cell_m):
    view = look(free, cell_m, 0.0)
    number = np.arange(free.size, dtype=np.int32).reshape(free.shape)
    back = view.to_grid(view.of_grid(number, -1), -1)
    np.testing.assert_array_equal(back[free], number[free])
    assert {*back[back != number].tolist()} <= {-1}
    assert view.cell_m * view.zoom == pytest.approx(cell_m)


@pytest.mark.parametrize("cell_m", [0.05, 0.1])
def test_the_margin_shows_what_lies_around_the_free_cells(cell_m):
    free = np.zeros((6, 7), np.bool_)
    free[2:4, 1:7] = True
    view = look(free, cell_m, 0.0)
    seen = view.of_grid(np.arange(42, dtype=np.int32).reshape(6, 7), -1)
    rows, columns = (np.repeat([0, *[1, 2], 3], [1, view.zoom, view.zoom, 1]), np.arange(1, 7).repeat(view.zoom))
    columns = np.concatenate([[0], columns, [7]])
    around = np.pad(np.arange(42).reshape(6, 7), ((0, 0), (0, 1)), constant_values=-1)[1:5]
    np.testing.assert_array_equal(seen, view.posture.of(around[rows][:, columns]))


@given(FLAGS, st.integers(1, 4), st.booleans())
def test_larger_cells_hold_all_or_any_of_theirs(flags, times, cell):
    found = shrunk(flags, times, cell)
    assert found.shape == tuple(-(-side // times) for side in flags.shape)
    for row, column in np.ndindex(found.shape):
        block = flags[row * times : (row + 1) * times, column * times : (column + 1) * times]
        assert found[row, column] == (block.any() if cell else block.all())


def agreeing(one, other):
    """Whether two label images draw the same regions."""
    pairs = {*zip(one.ravel().tolist(), other.ravel().tolist(), strict=True)}
    return len(pairs) == len(np.unique(one)) == len(np.unique(other))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("change", CHANGES[1:])
def test_the_regions_of_a_turned_map_are_turned(seed, change):
    grid = random_floor_plan(seed).grid
    turned = OccupancyGrid(*(np.ascontiguousarray(change(image)) for image in (grid.free, grid.occupied)), 0.05)
    one, other = qualrl.segment(grid), qualrl.segment(turned)
    assert agreeing(change(one.label), other.label)
    assert sorted(region.kind for region in one.regions) == sorted(region.kind for region in other.regions)


@pytest.mark.parametrize("seed", range(4))
def test_the_regions_of_a_map_drawn_finer_differ_in_stray_cells_at_most(seed):
    grid = random_floor_plan(seed).grid
    finer = OccupancyGrid(*(image.repeat(2, 0).repeat(2, 1) for image in (grid.free, grid.occupied)), 0.025)
    one, other = qualrl.segment(grid).label[grid.free], qualrl.segment(finer).label[::2, ::2][grid.free]
    assert adjusted_rand_index(one, other) > 0.999
