"""The loops that cut free space into zones, against slow twins."""

import os
import threading
import time
from itertools import pairwise
from unittest.mock import patch

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import njit
from scipy import ndimage

from qualrl.kernels import bands as banding
from qualrl.kernels import flooding, grid, labels, regions, scratch, zone_graph, zones
from qualrl.kernels.instructions import prefetch, trailing_zeros
from qualrl.spatial.distance import distance_within, thickness_over
from tests import oracles_regions


def _free_but(shape, cells):
    """All cells free but some, where they lie on the map."""
    free = np.ones(shape, np.bool_)
    for row, column in cells:
        free[row % shape[0], column % shape[1]] = False
    return free


SHAPES = st.shared(st.tuples(st.integers(1, 8), st.integers(1, 8)), key="shape")
LABELS = arrays(np.int32, SHAPES, elements=st.integers(-1, 3))
FLAGS = arrays(np.bool_, SHAPES)
MOSTLY_FREE = st.builds(
    _free_but,
    st.tuples(st.integers(1, 30), st.integers(1, 30)),
    st.lists(st.tuples(st.integers(0, 29), st.integers(0, 29)), max_size=5),
)
WIDTHS = arrays(np.float32, SHAPES, elements=st.sampled_from([0, 0.5, 1, 1.125, 2, 2.5, 3]))


@settings(deadline=None, max_examples=300)
@given(WIDTHS, WIDTHS, st.sampled_from([0.5, 0.85, 1.0]), st.sampled_from([0.5, 0.8]))
def test_flat_zones_are_the_textbook_ones(width, other, pinch, step):
    distance, thickness = np.pad(np.minimum(width, other), 1), np.pad(np.maximum(width, other), 1)
    zone, count = zones.flat_zones(thickness, distance, pinch, step)
    cells = oracles_regions.thick_first(thickness, distance)
    found = {frozenset(map(tuple, np.argwhere(zone == number).tolist())) for number in range(count)}
    assert found == oracles_regions.flat_zones(thickness, distance, cells, pinch, step)
    assert ((zone >= 0) == (distance > 0)).all()
    firsts = [np.flatnonzero(zone.ravel() == number)[0] for number in range(count)]
    assert firsts == sorted(firsts), "numbered in the order of their first cell"


@settings(deadline=None, max_examples=300)
@given(LABELS, FLAGS, WIDTHS)
def test_labels_flood_the_deepest_first(label, mask, depth):
    slow = oracles_regions.flooded(label, mask, depth)
    grown = flooding.flood(label, mask, depth)
    assert grown is label
    np.testing.assert_array_equal(grown, slow)


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 5), st.integers(1, 300), st.integers(0, 2**32 - 1), st.sampled_from([0.5, 0.97, 1.0]))
def test_labels_flood_rows_of_any_length_alike(height, width, seed, share):
    random = np.random.default_rng(seed)
    mask = random.random((height, width)) < 0.9
    label = np.where(random.random(mask.shape) < share, random.integers(0, 3, mask.shape), -1).astype(np.int32)
    depth = np.full(1, 0.3, np.float32)
    slow = oracles_regions.flooded(label, mask, np.broadcast_to(depth, mask.shape))
    np.testing.assert_array_equal(flooding.flood(label, mask, depth), slow)


@settings(deadline=None)
@given(LABELS, WIDTHS)
def test_what_zones_hold_is_counted(zone, thickness):
    cells = [(zone == number).sum() for number in range(4)]
    assert labels.sizes(zone, 4).tolist() == cells
    wide = [[float(width) for width in thickness[zone == number]] for number in range(4)]
    found = zone_graph.amounts(zone, thickness, 4)
    assert found[:, 0].tolist() == cells
    assert found[:, 1].tolist() == [sum(max(width, 0.5) for width in widths) for widths in wide]
    assert found[:, 2].tolist() == [max(widths, default=0) for widths in wide]


@settings(deadline=None)
@given(LABELS)
def test_used_labels_are_numbered_without_gaps_in_their_order(label):
    used = sorted(set(label[label >= 0].tolist()))
    expected = np.array([[used.index(here) if here >= 0 else -1 for here in row] for row in label.tolist()])
    assert labels.consecutive(label) == len(used)
    np.testing.assert_array_equal(label, expected)


@settings(deadline=None)
@given(LABELS, arrays(np.int32, 4, elements=st.integers(-1, 9)))
def test_labels_get_new_numbers_in_place(label, number):
    expected = [[int(number[here]) if here >= 0 else -1 for here in row] for row in label.tolist()]
    assert labels.renumber(label, number) is label
    assert label.tolist() == expected


@settings(deadline=None)
@given(LABELS)
def test_each_piece_has_the_label_of_its_cells(label):
    piece, count = regions.pieces(label)
    found = labels.labels_at(piece, count, label)
    assert all({int(found[here])} == set(label[piece == here].tolist()) for here in range(count))
    assert ((piece >= 0) == (label >= 0)).all()


@settings(deadline=None)
@given(LABELS, FLAGS)
def test_what_has_no_label_is_numbered_piece_by_piece(label, mask):
    piece, _ = ndimage.label(mask & (label < 0))  # 4-connected; scipy numbers pieces in the order of their first cell
    expected = np.where(piece > 0, piece + label.max(), label)
    assert flooding.number_rest(label, mask) is label
    np.testing.assert_array_equal(label, expected)


@settings(deadline=None)
@given(LABELS, WIDTHS, WIDTHS, st.sampled_from([0.5, 1.0, np.inf]))
def test_labels_lose_what_is_near_their_border_unless_nothing_is_left(label, away, thickness, most):
    is_core = away > np.minimum(thickness / 2, np.float32(most))
    expected = label.copy()
    for number in range(4):
        if is_core[label == number].any():
            expected[(label == number) & ~is_core] = -1
    regions.keep_cores(label, away, thickness, np.float32(most))
    np.testing.assert_array_equal(label, expected)


@settings(deadline=None)
@given(LABELS, st.data(), st.sampled_from([0.5, 1.0, 2.0, 6.0]))
def test_distances_near_some_cells_are_those_of_all_the_map(label, data, most):
    cells = data.draw(st.lists(st.integers(0, label.size - 1), min_size=2, max_size=6))
    away = ndimage.distance_transform_edt(~np.isin(np.arange(label.size), cells).reshape(label.shape))
    near = regions.distance_near(np.array(cells, np.int32)[:, None], most, np.empty(label.shape, np.float32))
    np.testing.assert_array_equal(near[away <= most], away[away <= most].astype(np.float32))
    assert (near[away > most] > most).all()


@settings(deadline=None)
@given(LABELS)
def test_each_row_of_a_label_has_a_first_and_a_last_cell(label):
    box = labels.boxes(label, 4)
    box[(label.ravel() == np.arange(4)[:, None]).sum(axis=1) == 0] = 0
    start, ends = labels.row_ends(label, box)
    for number in range(4):
        for row in range(box[number, 0], box[number, 1]):
            columns = np.flatnonzero(label[row] == number)
            expected = [columns[0], columns[-1]] if columns.size else [label.shape[1], -1]
            assert ends[start[number] + row - box[number, 0]].tolist() == expected


HOLED = arrays(np.int32, st.tuples(st.integers(3, 9), st.integers(3, 9)), elements=st.sampled_from([0, 0, 0, 0, 1, -1]))


@settings(deadline=None, max_examples=300)
@given(HOLED, arrays(np.float32, 2, elements=st.sampled_from([1, 1.5, 2, 3.5, 9])))
def test_what_stands_in_one_label_alone_is_filled(label, width):
    expected = oracles_regions.holes_filled(label, width)
    _, hole, stats, _ = cv2.connectedComponentsWithStats((label < 0).astype(np.uint8), connectivity=8)
    labels.fill_holes(label, hole, stats, width)
    np.testing.assert_array_equal(label, expected)


@given(st.integers(1, 2))
def test_two_tasks_each_give_their_own(processors):
    with patch.object(banding, "processors", lambda: processors):
        assert banding.both(lambda: "first", lambda: 2) == ("first", 2)


@settings(deadline=None)
@given(LABELS)
def test_boxes_are_those_that_scipy_finds(label):
    rows_and_columns = ndimage.find_objects(label + 1, 4)
    for found, expected in zip(labels.boxes(label, 4).tolist(), rows_and_columns, strict=True):
        if expected is not None:
            rows, columns = expected
            assert found == [rows.start, rows.stop, columns.start, columns.stop]


@settings(deadline=None)
@given(LABELS, arrays(np.bool_, 4), WIDTHS)
def test_only_the_labels_asked_for_are_left(label, kept, depth):
    expected = np.where((label >= 0) & kept[label] & (depth > 0), label, -1)
    np.testing.assert_array_equal(labels.only(label, kept, depth), expected)


@settings(deadline=None)
@given(LABELS, arrays(np.bool_, 4))
def test_cells_are_told_by_their_labels(label, wanted):
    found = labels.cells_with(label, wanted)
    assert found.tolist() == np.flatnonzero((label >= 0) & wanted[label]).tolist()


@settings(deadline=None, max_examples=100)
@given(LABELS, WIDTHS, WIDTHS, st.integers(2, 4))
def test_what_is_found_is_the_same_in_any_number_of_bands(label, distance, thickness, bands):
    def found():
        zone, count = zones.flat_zones(np.pad(thickness, 1), np.pad(distance, 1), 0.85, 0.8)
        piece, pieces = regions.pieces(label)
        numbered, cores = label.copy(), label.copy()
        counts = pieces, count, labels.consecutive(numbered)
        regions.keep_cores(cores, distance, thickness, np.float32(1))
        of_labels = labels.sizes(label, 4), labels.cells_with(label, np.array([True, False, False, True]))
        at = labels.labels_at(piece, pieces, label)
        return piece, zone, numbered, cores, at, *of_labels, regions.crossings(label), np.array(counts)

    alone = found()
    fewest = patch.object(banding, "LEAST_CELLS", 1), patch.object(zones, "LEAST_CELLS", 1)
    with fewest[0], fewest[1], patch.object(banding, "processors", lambda: bands):
        for ours, expected in zip(found(), alone, strict=True):
            np.testing.assert_array_equal(ours, expected)


@settings(deadline=None, max_examples=100)
@given(arrays(np.float32, SHAPES, elements=st.floats(0, 5000, width=32)), st.sampled_from([1.0, 0.02]))
def test_cells_of_any_width_are_taken_from_thick_to_thin(width, share):
    distance = np.pad(np.minimum(np.rot90(width, 2).reshape(width.shape), 3), 1)
    thickness = np.pad(width * np.float32(share), 1)
    zone, count = zones.flat_zones(thickness, distance, 0.85, 0.8)
    found = {frozenset(map(tuple, np.argwhere(zone == number).tolist())) for number in range(count)}
    cells = oracles_regions.thick_first(thickness, distance)
    assert found == oracles_regions.flat_zones(thickness, distance, cells, 0.85, 0.8)


@settings(deadline=None, max_examples=100)
@given(FLAGS)
def test_cells_are_listed_piece_by_piece(free):
    label = labels.as_label(np.pad(free, 1))
    order, start = zones.by_piece(regions.forest_of(label), np.count_nonzero(free))
    piece, count = regions.pieces(label)
    expected = [np.flatnonzero(piece.ravel() == number).tolist() for number in range(count)]
    assert [order[first:end].tolist() for first, end in pairwise(start)] == expected


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 4), st.integers(60, 200), st.integers(0, 2**32 - 1), st.sampled_from([0.01, 0.3]),
       st.sampled_from([1, 2**14]))  # fmt: skip
def test_crossings_of_long_rows_are_all_steps_between_labels(height, width, seed, share, at_a_time):
    random = np.random.default_rng(seed)
    label = np.where(random.random((height, width)) < share, random.integers(-1, 3, (height, width)), 0)
    flat, cells = label.ravel(), np.arange(label.size).reshape(label.shape)
    steps = {*zip(cells[:, :-1].ravel(), cells[:, 1:].ravel(), strict=True)}
    steps |= {*zip(cells[:-1].ravel(), cells[1:].ravel(), strict=True)}
    expected = sorted((a, b) for a, b in steps if flat[a] != flat[b] and min(flat[a], flat[b]) >= 0)
    with patch.object(regions, "MANY", at_a_time):
        found = regions.crossings(label.astype(np.int32)).tolist()
    assert [(a, b) for a, b in found] == expected


@settings(deadline=None, max_examples=200)
@given(FLAGS, st.integers(1, 4))
def test_thickness_is_the_largest_of_the_discs_in_any_number_of_bands(free, bands):
    distance = distance_within(np.pad(free, 1))
    with patch.object(banding, "LEAST_CELLS", 1), patch.object(banding, "processors", lambda: bands):
        found = thickness_over(distance)
    np.testing.assert_array_equal(found, oracles_regions.local_thickness(distance))


def test_rows_longer_than_a_word_are_painted_whole():
    free = np.zeros((9, 300), np.bool_)
    free[1:8, 1:-1] = True
    free[4, [63, 64, 128, 200]] = False
    distance = distance_within(free)
    np.testing.assert_array_equal(thickness_over(distance), oracles_regions.local_thickness(distance))


@settings(deadline=None)
@given(st.integers(1, 40), st.integers(1, 5))
def test_bands_meet_every_row_once_and_in_order(height, processors):
    with patch.object(banding, "LEAST_CELLS", 1), patch.object(banding, "processors", lambda: processors):
        bands = banding.in_bands(lambda top, bottom: list(range(top, bottom)), (height, 3))
    assert len(bands) <= processors
    assert [row for band in bands for row in band] == list(range(height))


def test_what_helpers_do_is_done_in_time_however_it_is_nested_and_also_after_an_error():
    done = []

    def fail():
        raise ValueError("on purpose")

    def late():
        time.sleep(0.05)
        done.append(banding.both(lambda: 1, lambda: banding.both(lambda: 2, lambda: 3)))

    with patch.object(banding, "processors", lambda: 2):
        assert banding.both(lambda: 1, lambda: banding.both(lambda: 2, lambda: 3)) == (1, (2, 3))
        with pytest.raises(ValueError, match="on purpose"):
            banding.both(fail, late)
        assert done == [(1, (2, 3))], "it was waited for"
        with pytest.raises(ValueError, match="on purpose"):
            banding.both(late, fail)
        assert banding.both(lambda: 1, threading.get_ident)[1] == banding.both(lambda: 1, threading.get_ident)[1]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
def test_a_copied_process_has_a_helper_of_its_own():
    with patch.object(banding, "processors", lambda: 2):
        banding.both(int, int)
        child = os.fork()
        if not child:
            os._exit(banding.both(lambda: 1, lambda: 2) != (1, 2))
        assert os.waitpid(child, 0)[1] == 0


def test_a_word_has_zeros_and_memory_may_be_asked_for_where_there_is_none():
    @njit
    def zeros(word, array):
        prefetch(array, len(array) + 10**6)
        return trailing_zeros(word)

    assert [zeros(np.uint64(1) << np.uint64(bit), np.zeros(3)) for bit in range(64)] == list(range(64))


@settings(deadline=None)
@given(LABELS, st.data())
def test_runs_are_as_long_as_their_cells_in_a_row(label, data):
    inside = np.flatnonzero(label >= 0)
    cells = data.draw(st.lists(st.sampled_from(inside.tolist()), max_size=5)) if inside.size else []
    down = data.draw(st.lists(st.booleans(), min_size=len(cells), max_size=len(cells)))
    found = regions.run_lengths(label, np.array(cells, np.int32), np.array(down, np.bool_))
    for cell, is_down, length in zip(cells, down, found.tolist(), strict=True):
        row, column = divmod(cell, label.shape[1])
        line, at = (label[:, column], row) if is_down else (label[row], column)
        number, _ = ndimage.label(line >= 0)
        assert length == (number == number[at]).sum()


@settings(deadline=None)
@given(FLAGS, st.integers(1, 3))
def test_free_cells_are_numbered_row_by_row(free, bands):
    with patch.object(banding, "LEAST_CELLS", 1), patch.object(banding, "processors", lambda: bands):
        cells, state_of = grid.cells_and_states(free)
    assert cells.dtype == state_of.dtype == np.int32
    np.testing.assert_array_equal(cells, np.argwhere(free))
    np.testing.assert_array_equal(state_of, np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1))


def test_memory_is_used_again_when_nothing_looks_at_it_and_someone_wants_it():
    with scratch.kept_for_reuse():
        first, other = scratch.borrowed((10, 10), np.int32), scratch.borrowed(100, np.int32)
        assert not np.shares_memory(first, other)
        place, view = first.ctypes.data, first.view(np.uint16)[2:, ::-1]
        del first
        watched = scratch.borrowed(100, np.int32)
        assert watched.ctypes.data != place, "a view still looks at it"
        del view
        larger, small = scratch.borrowed((5, 13), np.float64), scratch.borrowed(120, np.bool_)
        assert (larger.shape, larger.dtype) == ((5, 13), np.float64)
        assert larger.ctypes.data != place, "it is too small"
        assert small.ctypes.data != place, "it is far too large"
        again = scratch.borrowed(300, np.uint8)
        assert again.ctypes.data == place
        del again
        again = scratch.borrowed(402, np.uint8)
        assert again.ctypes.data == place, "there is some more room"
        del again
    assert not scratch._KEPT.free
    del larger
    assert not scratch._KEPT.free


@settings(deadline=None, max_examples=300)
@given(arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))) | MOSTLY_FREE, st.integers(1, 3))
def test_distances_are_those_to_the_nearest_cell_in_any_number_of_bands(free, bands):
    with patch.object(banding, "LEAST_CELLS", 1), patch.object(banding, "processors", lambda: bands):
        found = distance_within(free)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, oracles_regions.distances(free))


def test_distances_along_a_side_of_more_cells_than_16_bits_count_are_exact():
    free = np.ones((1, 70_000), np.bool_)
    free[0, 3] = False
    expected = abs(np.arange(70_000) - 3).astype(np.float32)
    np.testing.assert_array_equal(distance_within(free)[0], expected)
    np.testing.assert_array_equal(distance_within(free.T)[:, 0], expected)
