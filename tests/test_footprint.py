"""The robot's footprint: which cells it fits on, and what is left of regions and doors."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.colors import to_rgb
from scipy import ndimage

import qualrl
from qualrl.errors import MapError, PlaceError, ScenarioError, SettingError, UnknownNameError
from qualrl.io.model_file import fingerprint, read_model, write_model
from qualrl.learning.online import Online
from qualrl.report.overlay import draw_overlay
from qualrl.report.region_colours import NOT_FREE, TIGHT, WALL, colour_index
from qualrl.spatial.footprint import clearance
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import PlaceCell, PlaceName, resolve_cell
from qualrl.spatial.region_map import Shape
from tests import command_here
from tests.room_grids import room_grid
from tests.test_segmentation import check, two_rooms

ROOT = Path(__file__).parent.parent
FREE = arrays(np.bool_, st.tuples(st.integers(1, 14), st.integers(1, 14))).filter(lambda free: bool(free.any()))


def textbook_clearance(free: np.ndarray) -> np.ndarray:
    """By looking at every square that is not free, a frame round the map included."""
    blocked = np.argwhere(np.pad(~free, 1, constant_values=True)) - 1
    found = np.zeros(free.shape)
    for cell in np.argwhere(free):
        beyond = np.maximum(np.abs(blocked - cell) - 0.5, 0)
        found[tuple(cell)] = np.sqrt((beyond**2).sum(axis=1)).min()
    return found


def flat(shape: Shape | None) -> list[float]:
    """The numbers of a shape."""
    assert shape is not None
    return [*shape.sides_m, *(number for number in dataclasses.astuple(shape) if not isinstance(number, tuple))]


@settings(deadline=None, max_examples=100)
@given(FREE)
def test_clearance_is_the_distance_to_the_nearest_square(free: np.ndarray) -> None:
    np.testing.assert_allclose(clearance(free), textbook_clearance(free), atol=1e-5)


@settings(deadline=None, max_examples=60)
@given(FREE, st.integers(1, 4), st.floats(0.01, 3.0))
def test_what_is_left_is_a_region_map_of_the_cells_it_fits_on(free: np.ndarray, block: int, radius_m: float) -> None:
    grid = OccupancyGrid.from_free(free.repeat(block, 0).repeat(block, 1), 0.5)
    room_m = textbook_clearance(grid.free) * 0.5
    fits = grid.free & (room_m >= radius_m)
    if (np.abs(room_m - radius_m) < 1e-4).any():
        return  # a tie, which rounding decides
    if not fits.any():
        with pytest.raises(MapError, match="fits nowhere"):
            qualrl.segment(grid, radius_m=radius_m)
        return
    seen = qualrl.segment(grid, radius_m=radius_m)
    np.testing.assert_array_equal(seen.grid.free, fits)
    check(seen)
    # Doors join the regions as walking does.
    piece, count = ndimage.label(fits)
    island = [{int(value) for value in piece[seen.label == at]} for at in range(len(seen.regions))]
    assert all(len(pieces) == 1 for pieces in island)
    joined = {frozenset(door.pair) for door in seen.doorways}
    assert all(len({next(iter(island[at])) for at in pair}) == 1 for pair in joined)
    assert len(seen.regions) - count <= len(joined)


@settings(deadline=None, max_examples=30)
@given(FREE)
def test_a_point_changes_nothing(free: np.ndarray) -> None:
    grid = OccupancyGrid.from_free(free)
    whole, point = qualrl.segment(grid), qualrl.segment(grid, radius_m=0)
    np.testing.assert_array_equal(whole.label, point.label)
    assert whole.regions == point.regions
    assert whole.all_names == point.all_names


@settings(deadline=None, max_examples=100)
@given(FREE, st.integers(1, 4), st.sampled_from([0.05, 0.3, 1.0]))
def test_a_robot_within_a_cell_changes_nothing_but_says_so(free: np.ndarray, block: int, resolution_m: float) -> None:
    grid = OccupancyGrid.from_free(free.repeat(block, 0).repeat(block, 1), resolution_m)
    whole, seen = (qualrl.segment(grid, radius_m=radius) for radius in (0, resolution_m / 2))
    assert seen.grid.radius_m == resolution_m / 2
    assert seen.lost == ()
    np.testing.assert_array_equal(seen.label, whole.label)
    for one, other in zip(seen.regions, whole.regions, strict=True):
        assert dataclasses.replace(one, shape=None) == dataclasses.replace(other, shape=None)
        assert flat(one.shape) == pytest.approx(flat(other.shape))
    for kind in ("doorways", "landmarks"):
        for one, other in zip(getattr(seen, kind), getattr(whole, kind), strict=True):
            np.testing.assert_array_equal(one.cells, other.cells)
            assert one.__dict__ | {"cells": None} == other.__dict__ | {"cells": None}


@settings(deadline=None, max_examples=60)
@given(FREE, st.floats(0, 3), st.floats(0, 3))
def test_a_larger_robot_fits_on_no_further_cell(free: np.ndarray, one: float, other: float) -> None:
    small, large = sorted((one, other))
    room = clearance(free)
    assert not ((room >= large) & ~(room >= small)).any()
    assert not (~free & (room > 0)).any()


@pytest.mark.parametrize("radius_m", [0.05, 0.2, 0.4, 0.425])
def test_a_door_stays_while_the_robot_fits_through(radius_m: float) -> None:
    whole, seen = (qualrl.segment(two_rooms(), radius_m=radius) for radius in (0, radius_m))
    assert seen.region_names == whole.region_names == ("room A", "room B")
    assert [(door.name, door.width_m) for door in seen.doorways] == [("door 1", whole.doorways[0].width_m)]


@pytest.mark.parametrize("radius_m", [0.46, 0.5, 1.0])
def test_a_door_narrower_than_the_robot_is_no_door(radius_m: float) -> None:
    seen = qualrl.segment(two_rooms(), radius_m=radius_m)
    check(seen)
    assert seen.region_names[:2] == ("room A", "room B")
    assert seen.doorways == ()


def test_no_gap_of_a_cell_lets_a_larger_robot_through() -> None:
    free, gaps = room_grid(3, 4, 12)
    assert len(qualrl.segment(OccupancyGrid.from_free(free), radius_m=0.5).doorways) == len(gaps)
    seen = qualrl.segment(OccupancyGrid.from_free(free), radius_m=0.51)
    assert seen.doorways == ()
    assert len(seen.regions) == 16


def test_unknown_cells_are_no_room_for_a_robot() -> None:
    grid = two_rooms()
    unknown = OccupancyGrid(grid.free, np.zeros_like(grid.free), grid.resolution_m)
    np.testing.assert_array_equal(qualrl.segment(grid, radius_m=0.3).label, qualrl.segment(unknown, radius_m=0.3).label)


def test_a_part_that_is_cut_off_gets_a_name_of_its_own() -> None:
    free = np.zeros((42, 82), np.bool_)
    free[1:41, 1:51] = free[15:25, 50:60] = free[20, 60:70] = free[15:25, 70:81] = True
    whole = qualrl.segment(OccupancyGrid.from_free(free, 0.1))
    seen = qualrl.segment(OccupancyGrid.from_free(free, 0.1), radius_m=0.2)
    check(seen)
    assert ndimage.label(seen.grid.free)[1] == 2
    assert seen.regions[0].name == whole.regions[0].name
    assert not any(set(door.pair) == {0, len(seen.regions) - 1} for door in seen.doorways)


@pytest.mark.parametrize("radius_m", [-0.1, float("nan"), float("inf")])
def test_what_is_no_radius_is_refused(radius_m: float) -> None:
    with pytest.raises(SettingError, match="radius_m must be at least 0"):
        qualrl.segment(two_rooms(), radius_m=radius_m)


def test_a_place_in_the_band_is_told_with_the_nearest_cell() -> None:
    seen = qualrl.segment(two_rooms(), radius_m=0.3)
    with pytest.raises(PlaceError) as caught:
        resolve_cell(PlaceCell(1, 40), seen)
    assert str(caught.value) == (
        "cell 1,40 lies too near to a wall or unknown cells for a robot with radius_m 0.3; "
        "the nearest free cell is 7,40"
    )


def test_the_robot_walks_where_it_fits(tmp_path: Path) -> None:
    seen = qualrl.segment(two_rooms(), radius_m=0.3)
    model = qualrl.build(seen, "room B", start="room A", gamma=0.999)
    assert len(model) == seen.grid.free.sum()
    assert all(seen.grid.free[cell] for cell in qualrl.plan(model, exact=True).path)
    write_model(model, tmp_path / "model.npz")
    again = read_model(tmp_path / "model.npz")
    assert fingerprint(again) == fingerprint(model)
    assert again.regions is not None
    assert again.regions.grid.radius_m == 0.3
    with pytest.raises(PlaceError, match="too near to a wall"):
        resolve_cell(PlaceCell(1, 40), again.regions)


def test_a_scenario_says_the_radius(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(json.dumps({"map": str(ROOT / "maps" / "office.yaml"), "goal": "room C"}))
    scenario = qualrl.load_scenario(tmp_path / "s.yaml")
    whole, seen = scenario.regions(), scenario.with_settings(["radius_m=0.3"]).regions()
    assert seen.region_names == whole.region_names
    assert [door.name for door in seen.doorways] == [door.name for door in whole.doorways]
    assert seen.grid.free.sum() < whole.grid.free.sum()
    with pytest.raises(PlaceError, match=r"start: cell 1,1 lies .*"):
        scenario.with_settings(["radius_m=0.3", "start=[1, 1]"]).build()


def test_shapes_are_those_of_what_is_left() -> None:
    whole, seen, apart = (qualrl.segment(two_rooms(), radius_m=radius) for radius in (0, 0.3, 0.5))
    shapes = [regions.regions[0].shape for regions in (whole, seen, apart)]
    assert [shape.degree for shape in shapes if shape] == [1, 1, 0]
    assert [shape.unknown_share for shape in shapes if shape] == [0, 0, 0]
    half_m = [shape.half_width_m for shape in shapes if shape]
    assert half_m[0] - half_m[1] == pytest.approx(0.3, abs=0.06)
    assert half_m[0] - half_m[2] == pytest.approx(0.5, abs=0.06)
    sides_m = [shape.sides_m for shape in shapes if shape]
    assert sides_m[2] == pytest.approx((5.0, 3.25))  # it can lean into the door by 5 cells


def test_unknown_space_stays_unknown_behind_the_band() -> None:
    grid = two_rooms()
    occupied = ~grid.free
    occupied[:, :20] = False  # no walls west of the middle of the first room
    seen, whole = (
        qualrl.segment(OccupancyGrid(grid.free, occupied, grid.resolution_m), radius_m=radius) for radius in (0.3, 0)
    )
    for one, other in zip(seen.regions, whole.regions, strict=True):
        assert one.shape is not None
        assert other.shape is not None
        assert one.shape.unknown_share == pytest.approx(other.shape.unknown_share, abs=0.08)
    assert max(flat(region.shape)[-1] for region in seen.regions) > 0.3


def test_ways_on_both_sides_of_a_pillar_are_one_doorway() -> None:
    free = two_rooms(gap=slice(30, 90)).free.copy()
    free[57:62, 81:85] = False
    whole, seen = (qualrl.segment(OccupancyGrid.from_free(free, 0.05), radius_m=radius) for radius in (0, 0.4))
    check(seen)
    (before,), (door,) = whole.doorways, seen.doorways
    assert (door.name, door.width_m, door.is_open) == (before.name, before.width_m, before.is_open)
    rows = door.cells[:, 0]
    assert rows.min() < 57 - 8
    assert rows.max() > 62 + 8
    assert not ((rows > 49) & (rows < 69)).any()


def test_what_is_gone_is_told_as_too_small(tmp_path: Path) -> None:
    seen = qualrl.segment(two_rooms(), radius_m=0.5)
    assert seen.lost == ("door 1",)
    with pytest.raises(UnknownNameError, match=r"^a robot with radius_m 0\.5 is too large for 'door 1'$"):
        resolve_cell(PlaceName("door 1"), seen)
    with pytest.raises(UnknownNameError, match="too large for 'gate'"):
        resolve_cell(PlaceName("gate"), seen.renamed({"door 1": "gate"}))
    with pytest.raises(UnknownNameError, match="no place is called 'door 2'"):
        resolve_cell(PlaceName("door 2"), seen)
    with pytest.raises(ScenarioError, match="'room A' would name 2 places"):
        seen.renamed({"door 1": "room A"})
    model = qualrl.build(seen, "room B", start=(30, 120), gamma=0.9)
    with pytest.raises(UnknownNameError, match="too large for 'door 1'"):
        model.with_closed(["door 1"])
    write_model(model, tmp_path / "model.npz")
    again = read_model(tmp_path / "model.npz").regions
    assert again is not None
    assert again.lost == ("door 1",)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("-0.1", "s.yaml:3:11: radius_m: must be at least 0, got -0.1"),
        (".nan", "s.yaml:3:11: radius_m: must be finite, got nan"),
        (".inf", "s.yaml:3:11: radius_m: must be finite, got inf"),
        ("wide", "s.yaml:3:11: radius_m: must be a number, got 'wide'"),
        ("9", r"s.yaml:3:11: radius_m: a robot with radius_m 9 fits nowhere .* at most that"),
    ],
)
def test_a_radius_that_cannot_be_is_one_line_with_its_place(tmp_path: Path, value: str, message: str) -> None:
    office = json.dumps(str(ROOT / "maps" / "office.yaml"))
    (tmp_path / "s.yaml").write_text(f"map: {office}\ngoal: room C\nradius_m: {value}\n")
    _, err = command_here.qualrl("show", "s.yaml", cwd=tmp_path, expect=2)
    assert re.fullmatch(f"qualrl: {message}\n", err)


@pytest.mark.parametrize("source", ["office", "map"])
def test_show_takes_the_radius(tmp_path: Path, source: str) -> None:
    name = "office" if source == "office" else str(ROOT / "maps" / "office.yaml")
    shown = json.loads(command_here.qualrl("show", name, "--robot-radius", "0.45", "--json", cwd=tmp_path)[0])
    assert shown["map"]["radius_m"] == 0.45
    assert shown["map"]["lost"] == [f"door {number}" for number in range(1, 11)]
    assert shown["doorways"] == []
    _, err = command_here.qualrl("show", name, "--robot-radius", "-1", cwd=tmp_path, expect=2)
    assert err.startswith("qualrl: --robot-radius: ")
    assert err.count("\n") == 1


def test_the_widest_place_that_a_message_names_is_wide_enough() -> None:
    for side in range(1, 12):
        grid = OccupancyGrid.from_free(np.ones((side, side), np.bool_), 0.7 / side)
        with pytest.raises(MapError) as caught:
            qualrl.segment(grid, radius_m=5)
        widest_m = float(str(caught.value).split("leaves ")[1].split()[0])
        assert qualrl.segment(grid, radius_m=widest_m).grid.free.any()


def test_the_picture_leaves_the_band_white(tmp_path: Path) -> None:
    seen = qualrl.segment(two_rooms(), radius_m=0.3)
    draw_overlay(seen, tmp_path / "overlay.png", path=[(60, 20), (60, 30)])
    assert (tmp_path / "overlay.png").stat().st_size
    assert seen.grid.tight is not None
    table = [to_rgb(colour) for colour in NOT_FREE]
    colour = np.array(table)[colour_index(seen)[seen.label < 0]]
    expected = np.where(seen.grid.tight[seen.label < 0][:, None], to_rgb(TIGHT), to_rgb(WALL))
    np.testing.assert_array_equal(colour, expected)


def test_a_robot_that_finds_its_map_sees_where_it_does_not_fit() -> None:
    seen = qualrl.segment(two_rooms(), radius_m=0.3)
    model = qualrl.build(seen, "room B", start="room A", gamma=0.999)
    growth = qualrl.train(model, "hql-replay", episodes=20, seed=0, epsilon=0.02, online=Online(radius_m=3.0)).growth
    assert growth is not None
    known = growth.regions
    check(known)
    assert known.grid.radius_m == 0.3
    assert not (known.grid.free & ~seen.grid.free).any()
    assert known.grid.tight is not None
    assert (known.grid.tight & seen.grid.tight).sum() == known.grid.tight.sum() > 0
    assert len(known.doorways) == 1
    assert len(known.regions) == 2
