"""Relations between the places of a map, against definitions worked out cell by cell."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import PlaceError, SettingError, UnknownNameError
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import Region, RegionMap
from qualrl.spatial.relations import TILES, Relations
from qualrl.spatial.topology import rcc8
from qualrl.spatial.zones import Zone, zone_of_cells, zone_within
from tests import oracles_relations as oracles
from tests.worlds import TWO_ROOMS, grid_of

YAWS = [0.0, math.pi / 2, math.pi, -math.pi / 2, 0.3, 2.0]
DIAGONAL = {"north-west", "north-east", "south-west", "south-east"}


def regions_of(label, origin=(0.0, 0.0, 0.0), resolution_m=0.5):
    """A map of regions 0 .. n, as the labels (H, W) say, without doorways; each region's centre is its first cell."""
    label = np.array(label, np.int32)
    grid = OccupancyGrid(label >= 0, label < 0, resolution_m, origin)
    found = []
    for number in range(int(label.max()) + 1):
        cells = np.argwhere(label == number)
        mean = tuple(cells.mean(axis=0).tolist())
        found.append(Region(f"region {number}", "room", len(cells), 1.0, mean, tuple(cells[0].tolist())))
    return RegionMap(grid, label, tuple(found), (), ())


@st.composite
def labelled(draw):
    """A small map of random regions and a zone or two that may overlap."""
    shape = draw(st.tuples(st.integers(1, 6), st.integers(2, 6)))
    cells = st.lists(st.integers(-1, 3), min_size=math.prod(shape), max_size=math.prod(shape))
    drawn = np.array(draw(cells.filter(lambda numbers: max(numbers) >= 0))).reshape(shape)
    kept = np.unique(drawn[drawn >= 0])
    label = np.where(drawn >= 0, np.searchsorted(kept, drawn), -1)
    origin = (draw(st.sampled_from([0.0, -3.7])), 1.25, draw(st.sampled_from(YAWS)))
    regions = regions_of(label, origin)
    free = np.argwhere(regions.grid.free)
    zones = []
    for number in range(draw(st.integers(0, 2))):
        mask = np.zeros(shape, np.bool_)
        chosen = draw(st.lists(st.integers(0, len(free) - 1), min_size=1))
        mask[tuple(free[chosen].T)] = True
        zones.append(Zone(f"zone {number}", mask))
    return regions, zones


def cells_of(relations, name):
    number = relations.number(name)
    count = len(relations.regions.regions)
    mask = relations.regions.label == number if number < count else relations.zones[number - count].cells
    return [tuple(cell) for cell in np.argwhere(mask).tolist()]


@settings(deadline=None, max_examples=150)
@given(labelled())
def test_directions_touching_and_distances_are_those_of_the_cells(drawn):
    regions, zones = drawn
    relations = Relations(regions, zones)
    grid = regions.grid
    for of in relations.names:
        for seen_from in relations.names:
            mine, others = cells_of(relations, of), cells_of(relations, seen_from)
            shares = oracles.tile_shares(grid, mine, others)
            assert relations.shares(of, seen_from) == pytest.approx(shares)
            said, beyond = relations.direction(of, seen_from), dict[str, float]()
            for tile in set(TILES) - {"middle"}:
                counted = [tile] if tile in DIAGONAL else [other for other in TILES if tile in other.split("-")]
                expected = sum(shares.get(other, 0.0) for other in counted)
                assert relations.share_towards(tile, of, seen_from) == pytest.approx(expected)
                beyond[tile] = expected
            whole = {tile for tile in DIAGONAL if beyond[tile] > 0.5 + 1e-9}
            sides = {tile: beyond[tile] for tile in beyond.keys() - DIAGONAL if beyond[tile] > 0.5 + 1e-9}
            if whole:
                assert {said} == whole
            elif sides:
                assert sides[said] == pytest.approx(max(sides.values()))
            else:
                assert said == ("middle" if shares.get("middle", 0) > 0.5 + 1e-9 else "around")
            assert relations.topology(of, seen_from) == oracles.rcc8(set(mine), set(others))
            steps = oracles.steps_between(grid.free, relations.centre(of), relations.centre(seen_from))
            assert relations.distance_m(of, seen_from) == steps * grid.resolution_m


@settings(deadline=None, max_examples=100)
@given(labelled())
def test_where_most_of_a_place_lies_beyond_another_its_middle_does_too(drawn):
    """So what is said of more than half of a place follows the calculus of points."""
    relations = Relations(*drawn)
    for of in relations.names:
        for other in relations.names:
            (east, north), (east_2, north_2) = relations.middle(of), relations.middle(other)
            beyond = {"north": north > north_2, "south": north < north_2, "east": east > east_2, "west": east < east_2}
            for tile in set(TILES) - {"middle"}:
                if relations.share_towards(tile, of, other) > 0.5:
                    assert all(beyond[way] for way in tile.split("-"))


@settings(deadline=None, max_examples=50)
@given(labelled())
def test_middles_are_medians_of_the_world_s_axes(drawn):
    regions, zones = drawn
    relations = Relations(regions, zones)
    at_corner = np.array(oracles.world_of(regions.grid, (0, 0)))
    for name in relations.names:
        there = np.array([oracles.world_of(regions.grid, cell) for cell in cells_of(relations, name)])
        assert relations.middle(name) == pytest.approx(tuple(np.median(there - at_corner, axis=0)), abs=1e-5)


@settings(deadline=None, max_examples=200)
@given(st.data(), st.tuples(st.integers(1, 5), st.integers(1, 5)))
def test_rcc8_of_masks_is_that_of_sets_of_cells(data, shape):
    masks = []
    for _ in range(2):
        bits = st.lists(st.booleans(), min_size=math.prod(shape), max_size=math.prod(shape)).filter(any)
        masks.append(np.array(data.draw(bits)).reshape(shape))
    first, second = ({tuple(cell) for cell in np.argwhere(mask).tolist()} for mask in masks)
    assert rcc8(*masks) == oracles.rcc8(first, second)


COORDINATES = st.sampled_from([-2.0, -0.3, 0.2, 0.75, 1.3, 2.45, 3.1, 9.0])


def distance_to_side(points, begin, end):
    """(N,) of points (N, 2) from a side of a polygon."""
    begin, along = np.array(begin), np.subtract(end, begin)
    share = np.clip((points - begin) @ along / max(along @ along, 1e-12), 0, 1)
    return np.hypot(*(points - begin - share[:, None] * along).T)


@settings(deadline=None, max_examples=150)
@given(st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=6), st.sampled_from(YAWS))
def test_zones_are_the_cells_whose_centres_lie_inside_a_polygon(corners, yaw):
    free = np.ones((6, 7), np.bool_)
    free[2, 3] = free[5, 0] = False
    regions = regions_of(free.astype(np.int32) - 1, (0.03, -0.02, yaw), 0.51)
    grid = regions.grid
    centres = np.array([grid.to_world(*cell) for cell in np.argwhere(free).tolist()])
    assume(all(distance_to_side(centres, *side).min() > 1e-9 for side in pairwise([*corners, corners[0]])))
    expected = [tuple(cell) for cell in np.argwhere(free).tolist() if oracles.is_inside(corners, *grid.to_world(*cell))]
    if not expected:
        with pytest.raises(PlaceError, match="covers no cell where a robot could be"):
            zone_within("zone", corners, regions)
        return
    assert [tuple(cell) for cell in np.argwhere(zone_within("zone", corners, regions).cells).tolist()] == expected


@given(st.floats(-50, 50), st.floats(-50, 50), st.sampled_from(YAWS))
def test_positions_undo_the_way_to_the_world(row, column, yaw):
    grid = OccupancyGrid(np.ones((4, 9), np.bool_), np.zeros((4, 9), np.bool_), 0.05, (-3.0, 2.0, yaw))
    assert grid.to_position(*grid.to_world(row, column)) == pytest.approx((row, column), abs=1e-9)
    (east_down, north_down), (east_right, north_right) = grid.compass
    x, y = grid.to_world(row, column)
    down, right = grid.to_world(row + 1, column), grid.to_world(row, column + 1)
    assert (down[0] - x, down[1] - y) == pytest.approx((0.05 * east_down, 0.05 * north_down))
    assert (right[0] - x, right[1] - y) == pytest.approx((0.05 * east_right, 0.05 * north_right))


def test_north_is_the_frame_s_and_not_the_image_s():
    label = [[0, 0, -1, 1, 1]]
    upright, turned = (Relations(regions_of(label, (0.0, 0.0, yaw))) for yaw in (0.0, math.pi / 2))
    assert upright.direction("region 1", "region 0") == "east"
    assert turned.direction("region 1", "region 0") == "north"
    assert turned.shares("region 1", "region 0") == {"north": 1.0}


def test_regions_have_relations():
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    relations = regions.relations
    assert relations is regions.relations
    west, east = sorted(regions.region_names, key=lambda name: relations.middle(name))
    assert relations.doorways(west, east) == relations.doorways(east, west) == (regions.doorways[0].name,)
    assert relations.doorways(west, west) == ()
    assert relations.topology(west, east) == "EC"
    assert relations.direction(east, west) == "east"
    assert relations.is_region(west)
    with pytest.raises(UnknownNameError, match="no region or zone is called 'rom A'; did you mean 'room A'"):
        relations.direction("rom A", west)


def test_distances_have_three_classes_with_cuts_that_can_be_set():
    cuts = DistanceCuts(2.0, 3.5)
    assert [cuts.name(metres) for metres in (0, 2, 2.1, 3.5, 3.6, math.inf)] == (
        ["near", "near", "medium", "medium", "far", "far"]
    )
    for near_m, far_m in ((0.0, 1.0), (3.0, 3.0), (4.0, 3.0), (1.0, math.inf), (math.nan, 2.0)):
        with pytest.raises(SettingError, match="near_m must be above 0 and below far_m"):
            DistanceCuts(near_m, far_m)


def test_zones_of_an_image_are_cut_to_the_free_cells():
    regions = regions_of([[-1, 0, 0, -1]] * 2)
    zone = zone_of_cells("left", np.array([[1, 1, 0, 0], [1, 1, 0, 0]], np.bool_), regions)
    assert np.argwhere(zone.cells).tolist() == [[0, 1], [1, 1]]
    assert zone.centre == (0, 1)
    with pytest.raises(PlaceError, match="is 2 x 1 pixels large, but the map is 4 x 2; draw it on the map"):
        zone_of_cells("small", np.ones((1, 2), np.bool_), regions)
    with pytest.raises(PlaceError, match="covers no cell where a robot could be"):
        zone_of_cells("wall", ~regions.grid.free, regions)
    with pytest.raises(PlaceError, match="a place of the map is called so; choose another name"):
        zone_of_cells("region 0", regions.grid.free, regions)
