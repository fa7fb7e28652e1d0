"""Kinds and names of regions: what a person would call a place, and the same name however the map is turned."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.io.model_file import read_model, write_model
from qualrl.io.read_map import read_map
from qualrl.kernels.labels import borders
from qualrl.models.hybrid_mdp import hybrid_mdp
from qualrl.spatial.description import decided, listed, measure
from qualrl.spatial.doorways import renumbered
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import PlaceName
from qualrl.spatial.region_map import Doorway, Region, RegionMap
from qualrl.spatial.segmentation import segment

MAPS = Path(__file__).parent.parent / "maps"
TURNS: tuple[Callable[[np.ndarray], np.ndarray], ...] = (
    np.rot90,
    lambda image: np.rot90(image, 2),
    lambda image: np.rot90(image, 3),
    np.flipud,
    np.fliplr,
    np.transpose,
)


def plan(*rooms: tuple[int, int, int, int], shape: tuple[int, int] = (170, 260)) -> np.ndarray:
    """Free cells: boxes of top, left, height, width."""
    free = np.zeros(shape, np.bool_)
    for top, left, height, width in rooms:
        free[top : top + height, left : left + width] = True
    return free


def region_at(seen: RegionMap, cell: tuple[int, int]) -> Region:
    return seen.regions[seen.label[cell]]


def block_of_rooms(middle: tuple[int, int]) -> np.ndarray:
    """A row of six rooms of 4 m x 5 m at 0.1 m a cell, a corridor of 2 m below them, and one more room below that."""
    free = plan((56, 2, 20, 252))
    for number in range(6):
        left = 2 + 42 * number
        free[4:54, left : left + 40] = free[54:56, left + 15 : left + 24] = True
    height, width = middle
    free[78 : 78 + height, 100 : 100 + width] = free[76:78, 105:114] = True
    return free


@pytest.mark.parametrize(
    ("middle", "kind"),
    [((20, 20), "closet"), ((40, 50), "room"), ((80, 130), "hall")],
)
def test_size_beside_the_other_rooms_tells_closet_room_and_hall(middle: tuple[int, int], kind: str) -> None:
    seen = segment(OccupancyGrid.from_free(block_of_rooms(middle), 0.1))
    assert region_at(seen, (85, 109)).kind == kind
    assert region_at(seen, (66, 120)).kind == "corridor"
    assert {region_at(seen, (20, 20 + 42 * number)).kind for number in range(6)} == {"room"}


def test_a_roomy_place_with_five_doors_is_a_hall_and_with_two_a_room() -> None:
    def hub(doors: int) -> Region:
        free = plan((60, 80, 55, 90))
        sides = [(58, 20, 80), (58, 20, 112), (58, 20, 144), (115, 117, 80), (115, 117, 144)]
        for _, top, left in sides:
            free[top : top + 38, left : left + 26] = True
        for gap, _, left in sides[:doors]:
            free[gap : gap + 2, left + 8 : left + 17] = True
        return region_at(segment(OccupancyGrid.from_free(free, 0.1)), (85, 125))

    assert (hub(5).kind, hub(2).kind) == ("hall", "room")
    shape = hub(5).shape
    assert shape is not None
    assert (shape.doors, shape.openings, shape.degree) == (5, 0, 5)
    assert shape.sides_m == pytest.approx((9.0, 5.6), abs=0.2)


def test_a_place_without_walls_is_open() -> None:
    free = plan((4, 4, 160, 76), (78, 80, 9, 4))
    row, column = np.mgrid[:170, :260]
    free |= (row - 82) ** 2 + (column - 130) ** 2 < 48**2
    free[:, 80:84] &= plan((78, 80, 9, 4))[:, 80:84]
    occupied = np.zeros_like(free)
    occupied[:168, :84] = ~free[:168, :84]
    known = segment(OccupancyGrid(free, occupied, 0.1))
    walled = segment(OccupancyGrid.from_free(free, 0.1))
    assert region_at(known, (82, 130)).name == "open area 1"
    assert region_at(known, (82, 40)).kind == "hall"
    assert region_at(walled, (82, 130)).kind != "open area"


def test_a_map_that_shows_no_walls_has_no_open_areas_for_that() -> None:
    free = block_of_rooms((80, 130))
    generator = np.random.default_rng(2)
    specks = ~free & (generator.random(free.shape) < 0.02)
    seen = segment(OccupancyGrid(free, specks, 0.1))
    assert {region.kind for region in seen.regions} == {"room", "corridor", "hall"}


def test_maps_without_units_have_no_halls_for_their_size() -> None:
    free = np.ones((49, 49), np.bool_)
    free[::16] = free[:, ::16] = False
    free[16:48:16, 8::16] = free[8::16, 16:48:16] = True
    seen = segment(OccupancyGrid.from_free(free))
    assert [region.kind for region in seen.regions] == ["room"] * 9


@pytest.mark.parametrize(("resolution_m", "kind"), [(0.05, "room"), (0.1, "hall"), (1.0, "room")])
def test_a_single_large_room_is_a_hall_where_cells_have_a_size(resolution_m: float, kind: str) -> None:
    free = plan((10, 10, 90, 80))
    assert [region.kind for region in segment(OccupancyGrid.from_free(free, resolution_m)).regions] == [kind]


def test_numbers_that_decide_are_those_one_measures() -> None:
    free = plan((10, 10, 40, 80))
    (region,) = segment(OccupancyGrid.from_free(free, 0.1)).regions
    shape = region.shape
    assert shape is not None
    assert shape.fill == pytest.approx(1.0)
    assert shape.sides_m == pytest.approx((8.0, 4.0))
    assert (shape.degree, shape.open_share, shape.unknown_share) == (0, 0.0, 0.0)
    assert 1.5 < shape.half_width_m <= 2.1


def test_a_models_file_keeps_the_numbers(tmp_path: Path) -> None:
    regions = segment(read_map(MAPS / "puzzle.yaml"))
    write_model(hybrid_mdp(regions, PlaceName("room A")), tmp_path / "model.npz")
    again = read_model(tmp_path / "model.npz").regions
    assert again is not None
    assert again.regions == regions.regions


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_borders_are_counted_side_by_side(seed: int) -> None:
    generator = np.random.default_rng(seed)
    kind = generator.integers(0, 4, (7, 9))
    label, occupied = np.where(kind < 2, kind, -1).astype(np.int32), kind == 2
    expected = np.zeros((2, 2), int)
    for (row, column), here in np.ndenumerate(label):
        for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            inside = 0 <= r < 7 and 0 <= c < 9
            if here < 0 or (inside and label[r, c] >= 0):
                continue
            near = [
                occupied[y, x] for y in range(max(r - 1, 0), min(r + 2, 7)) for x in range(max(c - 1, 0), min(c + 2, 9))
            ]
            expected[here, 0 if not inside or any(near) else 1] += 1
    np.testing.assert_array_equal(borders(label, occupied, 2), expected)


def names_of(seen: RegionMap, turn: Callable[[np.ndarray], np.ndarray] = np.array) -> list[str]:
    """Name by region, as the description gives them when the map is turned."""
    is_pocket = np.array([region.kind == "pocket" for region in seen.regions])
    label, occupied = (np.ascontiguousarray(turn(image)) for image in (seen.label, seen.grid.occupied))
    parts = measure(label, is_pocket, np.ones(len(seen.regions), np.float32))
    shapes, kinds = decided(parts, turned(seen, turn), occupied, seen.grid.resolution_m)
    regions, order = listed(parts, shapes, kinds, seen.grid.resolution_m)
    return [region.name for _, region in sorted(zip(order, regions, strict=True), key=lambda pair: pair[0])]


def turned(seen: RegionMap, turn: Callable[[np.ndarray], np.ndarray]) -> list[Doorway]:
    """The doorways of a map on the turned map."""
    found = []
    for door in seen.doorways:
        image = np.zeros(seen.label.shape, np.bool_)
        image[tuple(door.cells.T)] = True
        found.append(replace(door, cells=np.argwhere(turn(image)).astype(np.int32)))
    return found


@pytest.mark.parametrize("name", ["puzzle", "office", "clinic", "slam"])
def test_turned_and_mirrored_maps_give_the_same_names(name: str) -> None:
    seen = segment(read_map(MAPS / f"{name}.yaml"))
    linked = [at for at, region in enumerate(seen.regions) if region.kind != "pocket"]
    straight = names_of(seen)
    for turn in TURNS:
        names = names_of(seen, turn)
        assert [names[at] for at in linked] == [straight[at] for at in linked]


@pytest.mark.parametrize("seed", range(4))
def test_numbers_given_by_chance_do_not_change_names(seed: int) -> None:
    seen = segment(read_map(MAPS / "clinic.yaml"))
    rank = np.random.default_rng(seed).permutation(len(seen.regions))
    mixed = replace(
        seen,
        label=np.where(seen.label >= 0, rank[seen.label], -1).astype(np.int32),
        regions=tuple(seen.regions[at] for at in np.argsort(rank)),
        doorways=renumbered(seen.doorways, rank.tolist()),
    )
    names = names_of(mixed)
    assert [names[at] for at in rank] == names_of(seen)


@pytest.mark.parametrize("seed", range(3))
def test_stray_cells_leave_the_offices_names(seed: int) -> None:
    grid = read_map(MAPS / "office.yaml")
    stray = np.random.default_rng(seed).random(grid.shape) < 0.01
    free = grid.free ^ stray
    straight, noisy = segment(grid), segment(OccupancyGrid.from_free(free, grid.resolution_m))
    both = (straight.label >= 0) & (noisy.label >= 0)
    before, after = np.array(straight.region_names), np.array(noisy.region_names)
    same = before[straight.label[both]] == after[noisy.label[both]]
    assert same.mean() > 0.95
