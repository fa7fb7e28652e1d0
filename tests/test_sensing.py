"""What rays see, against the textbook's line in exact fractions; and what must hold of any sensor."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from qualrl.errors import SettingError
from qualrl.kernels import sensing as kernel
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.sensing import KnownMap
from tests.worlds import free_masks, grid_of


def seen_by_rays(free, place, radius):
    """The twin: lines in exact fractions, each followed to its first cell that is not free."""
    reach = math.ceil(radius)
    rim = [(a, b) for a in range(-reach, reach + 1) for b in range(-reach, reach + 1) if max(abs(a), abs(b)) == reach]
    seen = {place}
    for down, right in rim:
        line = [
            tuple(
                at + math.floor(Fraction(k * to, reach) + Fraction(1, 2))
                for at, to in zip(place, (down, right), strict=True)
            )
            for k in range(reach + 1)
        ]
        for (r0, c0), (r, c) in itertools.pairwise(line):
            if (r - place[0]) ** 2 + (c - place[1]) ** 2 > radius**2:
                break
            if not (0 <= r < free.shape[0] and 0 <= c < free.shape[1]):
                break
            if abs(r - r0) + abs(c - c0) == 2 and not free[r, c0] and not free[r0, c]:
                break
            seen.add((r, c))
            if not free[r, c]:
                break
    return seen


def look(free, places, radius):
    seen = np.zeros(free.shape, bool)
    reach = math.ceil(radius)
    edge, follow = np.empty(free.size, np.int64), np.zeros(4 * (2 * reach + 1), bool)
    count = kernel.look(free, np.array(places), reach, float(radius), seen, edge, 0, follow)
    assert not follow.any()
    assert len(set(edge[:count].tolist())) == count <= (free & seen).sum()
    return seen


def cells(mask):
    return {tuple(cell) for cell in np.argwhere(mask).tolist()}


@given(st.data(), free_masks(side=9, connected=False), st.floats(1, 12))
@hypothesis_settings(max_examples=150, deadline=None)
def test_rays_equal_the_lines_of_the_textbook(data, free, radius):
    places = data.draw(st.lists(st.sampled_from(sorted(cells(free))), min_size=1, max_size=3))
    assert cells(look(free, places, radius)) == set().union(*(seen_by_rays(free, at, radius) for at in places))


@given(st.integers(1, 12), st.integers(0, 9), st.floats(0, 0.99))
def test_on_an_empty_map_it_sees_the_disc_and_nothing_else(whole, row, part):
    radius = whole + part
    free = np.ones((14, 17), bool)
    disc = {(r, c) for r in range(14) for c in range(17) if (r - row) ** 2 + (c - 8) ** 2 <= radius**2}
    assert cells(look(free, [(row, 8)], radius)) == disc


@given(st.data(), free_masks(side=8, connected=False), st.floats(1, 9))
@hypothesis_settings(deadline=None)
def test_more_free_space_never_hides_a_cell(data, free, radius):
    place = data.draw(st.sampled_from(sorted(cells(free))))
    wall = data.draw(st.tuples(st.integers(0, free.shape[0] - 1), st.integers(0, free.shape[1] - 1)))
    wider = free.copy()
    wider[wall] = True
    assert (look(wider, [place], radius) >= look(free, [place], radius)).all()


def test_a_wall_hides_what_is_behind_it_and_a_door_shows_a_cone():
    grid = grid_of("#######\n#..#..#\n#.....#\n#..#..#\n#######")
    seen = look(grid.free, [(1, 1)], 10)
    assert seen[1, 3]
    assert not seen[1, 4]
    assert not seen[1, 5]
    assert look(grid.free, [(2, 1)], 10)[2].all()
    shut = grid_of("#######\n#..#..#\n#..#..#\n#..#..#\n#######")
    assert not look(shut.free, np.argwhere(shut.free)[np.argwhere(shut.free)[:, 1] < 3], 10)[:, 4:].any()


def test_nothing_is_seen_between_two_walls_that_touch_at_a_corner():
    free = grid_of("..#.\n..#.\n##..\n....").free.copy()
    assert not look(free, [(1, 1)], 5)[2:, 2:].any()
    free[1, 2] = True
    assert look(free, [(1, 1)], 5)[2, 2]


def test_what_is_known_grows_and_the_rest_is_unknown():
    truth = OccupancyGrid(
        np.array([[1, 1, 1, 0, 1], [1, 1, 1, 1, 1]], bool), np.array([[0, 0, 0, 1, 0], [0, 0, 0, 0, 0]], bool), 0.5,
        (1.0, 2.0, 0.5), "here.png",
    )  # fmt: skip
    known = KnownMap(truth, radius_m=1.0)
    at = np.zeros(truth.shape, bool)
    at[0, 0] = True
    known.look_from(at)
    grid = known.grid()
    assert cells(grid.free) == {(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)}
    assert not grid.occupied.any()
    assert cells(known.frontier) == {(0, 2), (1, 1)}
    assert (grid.resolution_m, grid.origin, grid.source) == (0.5, (1.0, 2.0, 0.5), "here.png")
    known.look_from(np.ones(truth.shape, bool) & truth.free)
    np.testing.assert_array_equal(known.grid().free, truth.free)
    np.testing.assert_array_equal(known.grid().occupied, truth.occupied)
    assert not known.frontier.any()


@given(st.data(), free_masks(side=12, connected=False), st.floats(1, 6))
@hypothesis_settings(deadline=None)
def test_rays_that_are_not_followed_would_have_shown_nothing_new(data, free, radius):
    known, everywhere = KnownMap(OccupancyGrid.from_free(free), radius), np.zeros(free.shape, bool)
    at = data.draw(st.lists(st.sampled_from(sorted(cells(free))), min_size=1, max_size=12))
    for cut in range(0, len(at), 3):
        places = np.zeros(free.shape, bool)
        places[tuple(np.transpose(at[cut : cut + 3]))] = True
        known.look_from(places)
        for place in at[cut : cut + 3]:
            everywhere |= look(free, [place], radius)
        np.testing.assert_array_equal(known.seen, everywhere)


@pytest.mark.parametrize("radius_m", [0.0, 0.4, -1.0, float("nan"), float("inf"), 1e9])
def test_a_radius_must_see_something(radius_m):
    with pytest.raises(SettingError, match=r"radius must be from 0\.5 m"):
        KnownMap(grid_of("...", 0.5), radius_m)
