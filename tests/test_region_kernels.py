"""The loops that cut free space into zones, against slow twins."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from qualrl.kernels import labels, regions, zone_graph
from tests import oracles_regions

SHAPES = st.shared(st.tuples(st.integers(1, 8), st.integers(1, 8)), key="shape")
LABELS = arrays(np.int32, SHAPES, elements=st.integers(-1, 3))
FLAGS = arrays(np.bool_, SHAPES)
WIDTHS = arrays(np.float32, SHAPES, elements=st.sampled_from([0, 0.5, 1, 1.125, 2, 2.5, 3]))


@settings(deadline=None, max_examples=300)
@given(WIDTHS, WIDTHS, st.sampled_from([0.5, 0.85, 1.0]), st.sampled_from([0.5, 0.8]))
def test_flat_zones_are_the_textbook_ones(width, other, pinch, step):
    distance, thickness = np.minimum(width, other), np.maximum(width, other)
    order = regions.thick_first(thickness, distance)
    zone, count = regions.flat_zones(thickness, distance, order, pinch, step)
    cells = [divmod(cell, zone.shape[1]) for cell in order.tolist()]
    found = {frozenset(map(tuple, np.argwhere(zone == number).tolist())) for number in range(count)}
    assert found == oracles_regions.flat_zones(thickness, distance, cells, pinch, step)
    assert ((zone >= 0) == (distance > 0)).all()
    firsts = [np.flatnonzero(zone.ravel() == number)[0] for number in range(count)]
    assert firsts == sorted(firsts), "numbered in the order of their first cell"


@settings(deadline=None, max_examples=300)
@given(LABELS, FLAGS, WIDTHS)
def test_labels_flood_the_deepest_first(label, mask, depth):
    slow = oracles_regions.flooded(label, mask, depth)
    grown = regions.flood(label, mask, depth)
    assert grown is label
    np.testing.assert_array_equal(grown, slow)


@given(LABELS, WIDTHS)
def test_what_zones_hold_is_counted(zone, thickness):
    cells = [(zone == number).sum() for number in range(4)]
    assert labels.sizes(zone, 4).tolist() == cells
    wide = [[float(width) for width in thickness[zone == number]] for number in range(4)]
    found = zone_graph.amounts(zone, thickness, 4)
    assert found[:, 0].tolist() == cells
    assert found[:, 1].tolist() == [sum(max(width, 0.5) for width in widths) for widths in wide]
    assert found[:, 2].tolist() == [max(widths, default=0) for widths in wide]


@given(LABELS)
def test_used_labels_are_numbered_without_gaps_in_their_order(label):
    used = sorted(set(label[label >= 0].tolist()))
    expected = np.array([[used.index(here) if here >= 0 else -1 for here in row] for row in label.tolist()])
    assert labels.consecutive(label) == len(used)
    np.testing.assert_array_equal(label, expected)


@given(LABELS, arrays(np.int32, 4, elements=st.integers(-1, 9)))
def test_labels_get_new_numbers_in_place(label, number):
    expected = [[int(number[here]) if here >= 0 else -1 for here in row] for row in label.tolist()]
    assert labels.renumber(label, number) is label
    assert label.tolist() == expected


@given(LABELS)
def test_each_piece_has_the_label_of_its_cells(label):
    piece, count = regions.pieces(label)
    found = labels.labels_at(piece, count, label)
    assert all({int(found[here])} == set(label[piece == here].tolist()) for here in range(count))
    assert ((piece >= 0) == (label >= 0)).all()


@given(LABELS, FLAGS)
def test_what_has_no_label_is_numbered_piece_by_piece(label, mask):
    piece, _ = ndimage.label(mask & (label < 0))  # 4-connected; scipy numbers pieces in the order of their first cell
    expected = np.where(piece > 0, piece + label.max(), label)
    assert regions.number_rest(label, mask) is label
    np.testing.assert_array_equal(label, expected)


@given(LABELS, WIDTHS, WIDTHS, st.sampled_from([0.5, 1.0, np.inf]))
def test_labels_lose_what_is_near_their_border_unless_nothing_is_left(label, away, thickness, most):
    is_core = away > np.minimum(thickness / 2, np.float32(most))
    expected = label.copy()
    for number in range(4):
        if is_core[label == number].any():
            expected[(label == number) & ~is_core] = -1
    regions.keep_cores(label, away, thickness, np.float32(most))
    np.testing.assert_array_equal(label, expected)
