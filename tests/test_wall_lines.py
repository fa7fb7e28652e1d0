"""Lines across the gaps of walls: loops against their twins, and walls drawn by hand at known angles."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qualrl.kernels import wall_gaps
from qualrl.spatial.wall_lines import find_wall_lines, main_turn_deg, walls_of, without_specks
from tests import oracles_walls

SHAPES = st.tuples(st.integers(1, 9), st.integers(1, 30))
LABELS = arrays(np.int32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(-1, 3))
CELL_M = 0.05
THICK = 3


@st.composite
def walls(draw):
    """Walls with what is free beside them; often the long runs with few holes that chance alone does not draw."""
    shape = draw(SHAPES)
    wall = draw(arrays(np.bool_, shape))
    if draw(st.booleans()):
        wall |= draw(arrays(np.bool_, shape))
    return wall, draw(arrays(np.bool_, shape)) & ~wall


@settings(deadline=None, max_examples=300)
@given(walls(), st.integers(1, 5), st.integers(1, 6), st.integers(0, 9))
def test_gaps_are_the_textbook_ones(drawn, bridge, least, most):
    wall, free = drawn
    found = wall_gaps.gaps(wall, free, bridge, least, most)
    assert found.dtype == np.int32
    assert len(found) == len({*map(tuple, found.tolist())})
    assert {*map(tuple, found.tolist())} == oracles_walls.gaps(wall, free, bridge, least, most)


@settings(deadline=None, max_examples=200)
@given(walls(), st.integers(1, 3))
def test_gaps_know_how_far_off_the_middle_of_their_like_they_are(drawn, bridge):
    row, _ = drawn
    wall = np.concatenate([row[:2].repeat(3, axis=0), row])  # alike rows, as those through a door
    found = wall_gaps.gaps(wall, ~wall, bridge, 1, 9)
    assert wall_gaps.off_middle(found).tolist() == oracles_walls.off_middle(found.tolist())


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1, max_size=30), st.data())
def test_profiles_are_as_sharp_as_the_textbook_says(points, data):
    radians = np.radians(data.draw(st.lists(st.floats(-45, 45), min_size=1, max_size=4)))
    x, y = np.array(points, np.float64).T
    found = wall_gaps.sharpness(np.ascontiguousarray(x), np.ascontiguousarray(y), np.cos(radians), np.sin(radians))
    expected = [
        oracles_walls.sharpness(points, cosine, sine)
        for cosine, sine in zip(np.cos(radians).tolist(), np.sin(radians).tolist(), strict=True)
    ]
    assert found.tolist() == expected


def test_a_hole_is_bridged_or_a_gap_never_both():
    row = np.array([[cell == "#" for cell in "####.####..####"]])
    lengths = [wall_gaps.gaps(row, ~row, bridge, 2, 9)[:, 3:].tolist() for bridge in (1, 2, 3)]
    assert lengths == [[[4, 4], [4, 4]], [[9, 4]], []]


@settings(deadline=None, max_examples=300)
@given(st.data(), st.integers(0, 3), st.integers(0, 3))
def test_of_gaps_side_by_side_the_first_in_order_stays(data, rows, slack):
    height, width = data.draw(st.integers(1, 10)), data.draw(st.integers(1, 20))
    columns = st.tuples(*[st.integers(0, width - 1)] * 2).map(sorted)
    gap = st.tuples(st.integers(0, height - 1), columns).map(lambda drawn: (drawn[0], *drawn[1]))
    gaps = data.draw(st.lists(gap, max_size=12))
    order = data.draw(st.permutations(range(len(gaps))))
    found = np.array(gaps, np.int32).reshape(-1, 3)
    stays = wall_gaps.apart(found, np.array(order, np.int32), height, width, rows, slack)
    assert set(np.flatnonzero(stays).tolist()) == oracles_walls.apart(gaps, order, rows, slack)


@settings(deadline=None, max_examples=200)
@given(LABELS, st.integers(0, 5))
def test_walls_between_zones_are_the_textbook_ones(zone, most):
    pair, axis = wall_gaps.walls_between(zone, most)
    found = sorted((*ends, along) for ends, along in zip(pair.tolist(), axis.tolist(), strict=True))
    assert found == oracles_walls.walls_between(zone, most)


@settings(deadline=None, max_examples=200)
@given(st.tuples(st.integers(1, 7), st.integers(1, 7)), st.data())
def test_single_gaps_have_walls_beside_them_and_free_space_before_and_behind(shape, data):
    free = np.ones(shape, np.bool_)
    cell = st.tuples(*[st.integers(0, side - 1) for side in shape])
    for row, column in data.draw(st.lists(cell, max_size=8)):
        free[row, column] = False
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(free, 1), (3, 3)).tolist()
    expected = [[oracles_walls.is_single_gap(window) for window in row] for row in windows]
    assert wall_gaps.single_gaps(free).tolist() == expected


def test_a_wall_of_one_cell_with_a_gap_of_one_cell_has_a_single_gap():
    free = np.ones((5, 7), np.bool_)
    free[2, [0, 1, 2, 4, 5, 6]] = False
    assert np.argwhere(wall_gaps.single_gaps(free)).tolist() == [[2, 3]]
    assert np.argwhere(wall_gaps.single_gaps(free.T.copy())).tolist() == [[3, 2]]


def point(along, off, turn_deg, side):
    """(x, y) of the cell so far along and beside a direction through the middle of a square map."""
    cosine, sine = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    x, y = along * cosine - off * sine, along * sine + off * cosine
    return round(x + side / 2), round(y + side / 2)


def seen_from(turn_deg, side):
    """Of each cell of a square map how far it lies along and beside a direction through the middle."""
    y, x = np.mgrid[:side, :side] - side / 2
    cosine, sine = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return x * cosine + y * sine, y * cosine - x * sine


def rectangle(turn_deg, thick=1, half_length=200, half_width=150, side=600):
    """(wall, inside): a wall drawn around a rectangle, turned: from x towards y is positive."""
    along, off = seen_from(turn_deg, side)
    beyond = np.maximum(abs(along) - half_length, abs(off) - half_width)
    return abs(beyond) <= thick / 2, beyond < -thick / 2


@pytest.mark.parametrize("turn_deg", [0, 1, -1, 5, -5, 12.3, -12.3, 20, -20, 33.3, -33.3, 44, -44])
def test_the_walls_direction_is_that_of_a_drawn_rectangle(turn_deg):
    assert main_turn_deg(rectangle(turn_deg)[0]) == pytest.approx(turn_deg, abs=0.201)


@pytest.mark.parametrize("turn_deg", [44.4, 44.5, 44.6, 44.8, 45, 45.3, -44.6, -44.9, 60, 89, 90, 100, -70])
def test_the_nearer_direction_is_told(turn_deg):
    found = main_turn_deg(rectangle(turn_deg)[0])
    assert -45 <= found <= 45
    assert abs((found - turn_deg + 45) % 90 - 45) <= 0.201


def test_too_few_walls_have_no_direction():
    image = np.zeros((9, 40), np.bool_)
    image[np.arange(9), np.arange(9)] = True
    assert main_turn_deg(image) == 0


def divided(turn_deg, gap_m, short_m=2.5, side=500):
    """(wall, clear) of 16 m x 10 m, with a wall along the middle that ends short_m after a gap in its middle.

    What lies outside is unknown.
    """
    wall, inside = rectangle(turn_deg, THICK, 160, 100, side)
    along, off = seen_from(turn_deg, side)
    half, short = gap_m / CELL_M / 2, short_m / CELL_M
    wall |= inside & (abs(off) <= THICK / 2) & ((along < -half) | ((along > half) & (along < half + short)))
    return wall, inside & ~wall


def across(lines, gap_m, turn_deg, side=500):
    """Numbers of the lines within 0.2 m of the cells in the middle of the gap, -1 for a cell without."""
    near = cv2.dilate((lines.line + 1).astype(np.float32), np.ones((9, 9))) - 1
    half = gap_m / CELL_M / 2
    cells = [point(along, 0, turn_deg, side) for along in np.arange(-half + 2, half - 1)]
    return {int(near[y, x]) for x, y in cells}


@pytest.mark.parametrize("turn_deg", [0, 20, -20, 70])
@pytest.mark.parametrize("gap_m", [0.9, 2.0, 3.5])
def test_a_gap_in_a_wall_is_closed_and_measured(turn_deg, gap_m):
    lines = find_wall_lines(*divided(turn_deg, gap_m), CELL_M)
    (number,) = across(lines, gap_m, turn_deg)
    assert number >= 0
    assert lines.gap_m[number] == pytest.approx(gap_m, abs=0.11)
    assert lines.support_m[number] == pytest.approx(2.5, abs=0.16)


@pytest.mark.parametrize("turn_deg", [0, 20])
def test_a_gap_wider_than_four_metres_is_none(turn_deg):
    assert across(find_wall_lines(*divided(turn_deg, 4.5), CELL_M), 4.5, turn_deg) == {-1}
    assert lines_of_gap(3.7, turn_deg)


def lines_of_gap(gap_m, turn_deg):
    return across(find_wall_lines(*divided(turn_deg, gap_m), CELL_M), gap_m, turn_deg) - {-1}


@pytest.mark.parametrize("turn_deg", [0, 20])
def test_a_line_separates_what_the_gap_joins(turn_deg):
    wall, clear = divided(turn_deg, 0.9, short_m=8)
    lines = find_wall_lines(wall, clear, CELL_M)
    sides = [point(0, off, turn_deg, 500) for off in (-50, 50)]
    for free, is_joined in ((clear, True), (clear & (lines.line < 0), False)):
        _, piece = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
        one, other = (piece[y, x] for x, y in sides)
        assert one > 0
        assert other > 0
        assert (one == other) == is_joined


def test_a_wall_too_short_says_nothing():
    assert lines_of_gap(0.9, 0)
    wall, clear = divided(0, 0.9, short_m=0.2)
    assert across(find_wall_lines(wall, clear, CELL_M), 0.9, 0) == {-1}


def test_a_map_without_walls_has_no_lines():
    clear = np.zeros((60, 80), np.bool_)
    clear[5:50, 5:70] = True
    lines = find_wall_lines(np.zeros_like(clear), clear, CELL_M)
    assert (lines.line == -1).all()
    assert (lines.turn_deg, len(lines.support_m), len(lines.gap_m)) == (0, 0, 0)


@pytest.mark.parametrize("turn_deg", [0, 20])
def test_walls_drawn_grey_are_walls(turn_deg):
    """Without occupied cells the rim of the free space stands for them, and doors are found all the same."""
    wall, clear = divided(turn_deg, 0.9)
    grey = walls_of(np.zeros_like(wall), clear)
    assert not (grey & clear).any()
    assert (grey & wall).sum() > 0.9 * grey.sum()
    (number,) = across(find_wall_lines(grey, clear, CELL_M), 0.9, turn_deg)
    assert find_wall_lines(grey, clear, CELL_M).gap_m[number] == pytest.approx(0.9, abs=0.11)


def test_where_walls_are_drawn_other_rims_are_what_was_not_seen():
    wall, clear = divided(0, 0.9)
    np.testing.assert_array_equal(walls_of(wall, clear), wall)
    most, rest = wall.copy(), wall.copy()
    most[:, :150] = rest[:, 150:] = False
    np.testing.assert_array_equal(walls_of(most, clear), most)
    drawn = walls_of(rest, clear)
    assert drawn.sum() > rest.sum()
    assert drawn[rest].all()
    assert not (drawn & clear).any()


@settings(deadline=None, max_examples=200)
@given(arrays(np.bool_, st.tuples(st.integers(1, 8), st.integers(1, 8))))
def test_specks_are_cells_without_any_beside_them(occupied):
    wide = np.pad(occupied, 1)
    cells = np.argwhere(occupied).tolist()
    kept = [[row, column] for row, column in cells if wide[row : row + 3, column : column + 3].sum() > 1]
    assert np.argwhere(without_specks(occupied)).tolist() == kept


@pytest.mark.parametrize("thick", [1, 3, 5, 9])
def test_a_line_lies_in_the_middle_of_its_wall(thick):
    wall = np.zeros((101, 201), np.bool_)
    wall[50 - thick // 2 : 51 + thick // 2] = True
    wall[:, 90:110] = False
    wall[[0, -1]] = wall[:, [0, -1]] = True
    lines = find_wall_lines(wall, ~wall, CELL_M)
    assert {*np.nonzero(lines.line[:, 95:105] >= 0)[0].tolist()} == {50}
    assert (np.diff(lines.support_m) >= 0).all()
