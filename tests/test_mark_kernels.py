"""The loops that move landmarks to where they belong, against slow twins."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qualrl.kernels import marks
from tests import oracles_marks as oracles

SHAPES = st.shared(st.tuples(st.integers(1, 9), st.integers(1, 9)), key="shape")
LABELS = arrays(np.int32, SHAPES, elements=st.integers(-1, 1))
WIDTHS = arrays(np.float32, SHAPES, elements=st.sampled_from([0, 0.5, 1, 2, 3]))


def drawn_cells(data, label):
    """Some cells that have a label: flat indices, and rows and columns."""
    inside = np.flatnonzero(label >= 0).tolist()
    flat = np.array(data.draw(st.lists(st.sampled_from(inside), max_size=5)) if inside else [], np.int64)
    return flat, [divmod(cell, label.shape[1]) for cell in flat.tolist()]


def as_cells(flat, label):
    return [divmod(cell, label.shape[1]) for cell in flat.tolist()]


@settings(deadline=None, max_examples=200)
@given(LABELS, st.data(), st.integers(0, 5))
def test_corners_are_gone_into_step_by_step(label, data, most):
    flat, cells = drawn_cells(data, label)
    shares = st.sampled_from([-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0])
    outward = data.draw(arrays(np.float64, (len(flat), 2), elements=shares))
    expected = [oracles.into_corner(label, cell, way, most) for cell, way in zip(cells, outward.tolist(), strict=True)]
    assert as_cells(marks.into_corners(label, flat, outward, most), label) == expected


@settings(deadline=None, max_examples=200)
@given(LABELS, st.data())
def test_the_nearest_cell_of_a_region_is_found(label, data):
    flat, cells = drawn_cells(data, label)
    used = np.unique(label).tolist()
    region = np.array(data.draw(st.lists(st.sampled_from(used), min_size=len(flat), max_size=len(flat))), np.int32)
    expected = [oracles.nearest_of_region(label, cell, of) for cell, of in zip(cells, region.tolist(), strict=True)]
    assert as_cells(marks.nearest_of_region(label, flat, region), label) == expected


@settings(deadline=None, max_examples=200)
@given(LABELS, st.data(), arrays(np.float32, 2, elements=st.sampled_from([1, 1.5, 2, 4])))
def test_doorways_within_reach_are_those_of_the_region(label, data, reach):
    flat, cells = drawn_cells(data, label)
    places = st.tuples(st.integers(0, 8), st.integers(0, 8))
    of_region = [data.draw(st.lists(places, max_size=3)) for _ in range(2)]
    region = np.array(data.draw(st.lists(st.integers(0, 1), min_size=len(flat), max_size=len(flat))), np.int32)
    others = np.array([*of_region[0], *of_region[1]], np.int32).reshape(-1, 2)
    start = np.array([0, len(of_region[0]), len(others)])
    expected = [
        oracles.within_reach(cell, of_region[of], reach[of]) for cell, of in zip(cells, region.tolist(), strict=True)
    ]
    assert marks.within_reach(flat, label.shape[1], others, start, region, reach).tolist() == expected


@settings(deadline=None, max_examples=200)
@given(LABELS, WIDTHS, st.data())
def test_lines_are_followed_until_they_are_clear_of_walls(line, distance, data):
    flat, cells = drawn_cells(data, line)
    clear = data.draw(arrays(np.float32, len(flat), elements=st.sampled_from([0.5, 1, 3, 9])))
    most = data.draw(arrays(np.int32, len(flat), elements=st.integers(0, 12)))
    expected = [
        oracles.clear_of_walls(line, cell, distance, *limits)
        for cell, *limits in zip(cells, clear.tolist(), most.tolist(), strict=True)
    ]
    assert as_cells(marks.clear_of_walls(line, flat, distance, clear, most), line) == expected
