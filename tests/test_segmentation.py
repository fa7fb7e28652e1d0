"""Regions and doorways: the partition holds on any map, and known maps give the rooms a person sees."""

import math
from collections import deque

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qualrl.errors import SettingError
from qualrl.kernels import regions as kernels
from qualrl.spatial.distance import distance_within, thickness_over
from qualrl.spatial.doorways import find_doorways
from qualrl.spatial.naming import letters, reading_order
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import Doorway, RegionMap
from qualrl.spatial.segmentation import segment

PUZZLE = """
#############
#...........#
#.####.####.#
#.#.......#.#
#.#.#####.#.#
#.#.#...#.#.#
#.#.#...#.#.#
#.#.#...#.#.#
#.#.##.##.#.#
#.#.......#.#
#.#########.#
#...........#
#############
"""

FREE = arrays(np.bool_, st.tuples(st.integers(1, 24), st.integers(1, 24))).filter(lambda free: bool(free.any()))


def drawn(text: str) -> np.ndarray:
    """Free cells of a map drawn in characters, '#' for walls."""
    return np.array([list(row) for row in text.split()]) != "#"


def two_rooms(resolution_m: float = 0.05, gap: slice = slice(52, 70)) -> OccupancyGrid:
    """Two rooms of 6 m x 4 m side by side, with a door of 0.9 m in the wall between them."""
    free = np.zeros((122, 166), np.bool_)
    free[1:121, 1:81] = free[1:121, 85:165] = True
    free[gap, 81:85] = True
    return OccupancyGrid.from_free(free, resolution_m)


def office() -> np.ndarray:
    """A corridor of 30 m x 2 m at 0.1 m a cell, with five rooms of 5 m x 5.8 m on each side."""
    free = np.zeros((144, 302), np.bool_)
    free[62:82, 1:301] = True
    for number in range(5):
        left = 1 + 60 * number
        free[1:60, left : left + 58] = free[84:143, left : left + 58] = True
        free[60:62, left + 25 : left + 34] = free[82:84, left + 25 : left + 34] = True
    return free


def connected(free: np.ndarray) -> int:
    """Number of 4-connected pieces, found the slow way."""
    left = {(int(r), int(c)) for r, c in np.argwhere(free)}
    pieces = 0
    while left:
        pieces += 1
        queue = deque([left.pop()])
        while queue:
            row, column = queue.popleft()
            for cell in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
                if cell in left:
                    left.remove(cell)
                    queue.append(cell)
    return pieces


def check(seen: RegionMap) -> None:
    """Everything that holds of any region map."""
    free, label = seen.grid.free, seen.label
    assert label.dtype == np.int32
    assert label.shape == free.shape
    np.testing.assert_array_equal(label >= 0, free)
    assert set(np.unique(label[free])) == set(range(len(seen.regions)))
    for index, region in enumerate(seen.regions):
        assert region.cells == (label == index).sum()
        assert label[region.centre] == index
        assert connected(label == index) == 1
    assert len(set(seen.all_names)) == len(seen.all_names)
    check_doorways(seen)
    for mark in seen.landmarks:
        assert free[mark.cell]
        assert label[mark.cell] in mark.regions
        assert all(free[row, column] for row, column in mark.cells)
    assert [mark.name for mark in seen.landmarks[: len(seen.doorways)]] == [door.name for door in seen.doorways]


def check_chord(door: Doorway) -> None:
    """The chord is the longest one between cells of the doorway, the width its length, the midpoint in its middle."""
    cells = [(int(row), int(column)) for row, column in door.cells]
    longest = max(math.dist(here, there) for here in cells for there in cells)
    first, last = door.ends
    assert {first, last} <= set(cells)
    assert math.dist(first, last) == longest
    middle = ((first[0] + last[0]) / 2, (first[1] + last[1]) / 2)
    assert math.dist(door.midpoint, middle) == min(math.dist(cell, middle) for cell in cells)


def check_doorways(seen: RegionMap) -> None:
    """Doorways hold one end of every step between regions, and join what the free space joins."""
    label, height, width = seen.label, *seen.label.shape
    cells: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for door in seen.doorways:
        assert door.pair[0] < door.pair[1]
        assert len({int(label[row, column]) for row, column in door.cells}) == 1
        check_chord(door)
        cells.setdefault(door.pair, set()).update((int(row), int(column)) for row, column in door.cells)
    touching = set()
    for row in range(height):
        for column in range(width):
            for r, c in ((row + 1, column), (row, column + 1)):
                if r < height and c < width and label[row, column] >= 0 <= label[r, c] != label[row, column]:
                    pair = tuple(sorted((int(label[row, column]), int(label[r, c]))))
                    touching.add(pair)
                    assert {(row, column), (r, c)} & cells[pair]
    assert touching == set(cells)
    graph = nx.Graph(touching)
    graph.add_nodes_from(range(len(seen.regions)))
    assert nx.number_connected_components(graph) == connected(seen.grid.free)


@settings(deadline=None, max_examples=150)
@given(FREE, st.sampled_from([0.05, 0.3, 1.0]))
def test_any_map_is_partitioned(free: np.ndarray, resolution_m: float) -> None:
    check(segment(OccupancyGrid.from_free(free, resolution_m)))


@settings(deadline=None, max_examples=50)
@given(FREE, st.sampled_from([0.05, 1.0]))
def test_label_images_count_from_1_and_leave_pockets_out(free: np.ndarray, resolution_m: float) -> None:
    check_label_image(segment(OccupancyGrid.from_free(free, resolution_m)))


def test_a_pocket_is_not_in_the_label_image() -> None:
    free = two_rooms().free.copy()
    free[20:23, 82:84] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    image = check_label_image(seen)
    assert sorted(region.kind for region in seen.regions) == ["pocket", "room", "room"]
    assert np.unique(image).size == 3
    assert (image[20:23, 82:84] == 0).all()
    assert image[60, 40] != image[60, 120]
    np.testing.assert_array_equal((image > 0).sum(), free.sum() - 6)


def check_label_image(seen: RegionMap) -> np.ndarray:
    """One cell at a time: the number of its region counted from 1, 0 in pockets and where not free."""
    image = seen.label_image()
    assert image.dtype == np.int32
    assert image.shape == seen.label.shape
    for cell, index in np.ndenumerate(seen.label):
        is_pocket = index >= 0 and seen.regions[index].kind == "pocket"
        assert image[cell] == (0 if is_pocket or not seen.grid.free[cell] else index + 1)
    return image


@settings(deadline=None, max_examples=40)
@given(FREE, st.integers(2, 5), st.sampled_from([0.05, 0.2]))
def test_any_map_of_larger_blocks_is_partitioned(free: np.ndarray, block: int, resolution_m: float) -> None:
    check(segment(OccupancyGrid.from_free(free.repeat(block, 0).repeat(block, 1), resolution_m)))


@settings(deadline=None, max_examples=40)
@given(FREE)
def test_a_map_gives_the_same_regions_each_time(free: np.ndarray) -> None:
    first, second = (segment(OccupancyGrid.from_free(free)) for _ in range(2))
    np.testing.assert_array_equal(first.label, second.label)
    assert first.regions == second.regions
    assert [mark.name for mark in first.landmarks] == [mark.name for mark in second.landmarks]


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (1, 9), (9, 1)])
def test_a_map_without_walls_is_one_region(shape: tuple[int, int]) -> None:
    seen = segment(OccupancyGrid.from_free(np.ones(shape, np.bool_)))
    check(seen)
    assert len(seen.regions) == 1
    assert seen.regions[0].kind != "pocket"


def test_puzzle_is_two_rings_round_a_room() -> None:
    seen = segment(OccupancyGrid.from_free(drawn(PUZZLE)))
    check(seen)
    assert seen.region_names == ("room A", "corridor 1", "corridor 2")
    outer, inner, centre = (int(seen.label[cell]) for cell in ((1, 1), (3, 3), (6, 6)))
    assert (centre, outer, inner) == (0, 1, 2)
    assert [door.cells.tolist() for door in seen.doorways] == [[[8, 6]], [[2, 6]]]
    assert [door.width_m for door in seen.doorways] == [1.0, 1.0]
    assert not any(door.is_open for door in seen.doorways)


def test_a_door_between_two_rooms() -> None:
    seen = segment(two_rooms())
    check(seen)
    assert seen.region_names == ("room A", "room B")
    (door,) = seen.doorways
    assert door.name == "door 1"
    assert not door.is_open
    assert door.width_m == pytest.approx(0.9)
    assert 81 <= door.cells[:, 1].min() == door.cells[:, 1].max() <= 84
    assert door.cells[:, 0].tolist() == list(range(52, 70))
    column = int(door.cells[0, 1])
    assert door.ends == ((52, column), (69, column))
    assert door.midpoint == (60, column)


def test_the_width_of_a_bent_row_is_that_of_its_chord() -> None:
    label = np.ones((8, 7), np.int32)
    label[:4] = label[4:6, 2:5] = 0
    distance, nothing, wide = np.ones(label.shape, np.float32), np.full_like(label, -1), np.full(2, 9, np.float32)
    (door,) = find_doorways(label, distance, nothing, wide, 0.5)
    assert len(door.cells) == 9
    assert (door.ends, door.width_m) == (((3, 0), (3, 6)), 3.5)
    assert door.midpoint == (4, 2)


def test_names_run_from_west_to_east_whatever_a_stray_cell_does() -> None:
    grid = two_rooms()
    for row, column in ((5, 7), (5, 150), (100, 20), (119, 160)):
        free = grid.free.copy()
        free[row, column] = False
        seen = segment(OccupancyGrid.from_free(free, grid.resolution_m))
        assert seen.label[60, 40] == 0
        assert seen.label[60, 120] == 1


def test_two_doors_between_the_same_rooms_are_two_doorways() -> None:
    free = two_rooms().free.copy()
    free[10:26, 81:85] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    check(seen)
    assert [door.pair for door in seen.doorways] == [(0, 1), (0, 1)]
    assert [door.name for door in seen.doorways] == ["door 1", "door 2"]


def test_a_post_in_a_door_does_not_make_it_two() -> None:
    free = two_rooms(gap=slice(40, 80)).free.copy()
    free[58:62, 81:85] = False
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert len(seen.doorways) == len({door.pair for door in seen.doorways})


def test_office_has_ten_rooms_on_a_corridor() -> None:
    seen = segment(OccupancyGrid.from_free(office(), 0.1))
    check(seen)
    assert [region.kind for region in seen.regions] == ["room"] * 10 + ["corridor"]
    assert len(seen.doorways) == 10
    assert not any(door.is_open for door in seen.doorways)
    assert all(door.pair[1] == 10 for door in seen.doorways)


def test_chairs_do_not_divide_a_room() -> None:
    free = office()
    generator = np.random.default_rng(3)
    for row, column in zip(generator.integers(2, 56, 60), generator.integers(2, 296, 60), strict=True):
        free[row : row + 2, column : column + 2] = False
    seen = segment(OccupancyGrid.from_free(free, 0.1))
    check(seen)
    assert sum(region.kind == "room" for region in seen.regions) == 10


@pytest.mark.parametrize(("resolution_m", "names"), [(0.3, {"room A", "corridor 1"}), (0.1, {"hall 1", "corridor 1"})])
def test_a_corridor_opens_into_a_hall(resolution_m: float, names: set[str]) -> None:
    free = np.zeros((102, 222), np.bool_)
    free[1:101, 1:101] = free[40:60, 101:221] = True
    seen = segment(OccupancyGrid.from_free(free, resolution_m))
    check(seen)
    assert set(seen.region_names) == names
    (opening,) = seen.doorways
    assert opening.is_open
    assert opening.name == "opening 1"
    assert opening.width_m == pytest.approx(20 * resolution_m, abs=2 * resolution_m)


def test_a_grid_of_rooms_with_gaps_of_one_cell_is_exact() -> None:
    generator = np.random.default_rng(8)
    free = np.ones((65, 65), np.bool_)
    free[::8] = free[:, ::8] = False
    gaps = 0
    for row in range(8):
        for column in range(8):
            free[8 * row + 8, 8 * column + generator.integers(1, 8)] = row < 7
            free[8 * row + generator.integers(1, 8), 8 * column + 8] = column < 7
            gaps += (row < 7) + (column < 7)
    seen = segment(OccupancyGrid.from_free(free))
    check(seen)
    assert [region.kind for region in seen.regions] == ["room"] * 64
    assert len(seen.doorways) == gaps
    for door in seen.doorways:
        ((row, column),) = door.cells.tolist()
        assert row % 8 == 0 or column % 8 == 0


def test_specks_are_pockets_and_cheap() -> None:
    free = np.zeros((400, 400), np.bool_)
    free[1:100, 1:399] = True
    free[120::4, ::4] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    kinds = [region.kind for region in seen.regions]
    assert kinds.count("pocket") == 7000
    assert kinds.count("room") + kinds.count("corridor") == 1
    assert seen.regions[1].name == "pocket 1"


def test_a_closed_room_is_a_room_and_no_pocket() -> None:
    seen = segment(two_rooms(gap=slice(0, 0)))
    check(seen)
    assert seen.region_names == ("room A", "room B")
    assert seen.doorways == ()


def test_unknown_cells_belong_to_no_region() -> None:
    grid = two_rooms()
    seen = segment(OccupancyGrid(grid.free, np.zeros_like(grid.free), grid.resolution_m))
    check(seen)
    assert len(seen.regions) == 2


@pytest.mark.parametrize("setting", [{"pinch": 1.5}, {"min_area_m2": -1.0}, {"furniture_m": float("nan")}])
def test_a_setting_out_of_range_is_refused(setting: dict[str, float]) -> None:
    with pytest.raises(SettingError, match=next(iter(setting))):
        segment(two_rooms(), **setting)


@settings(deadline=None, max_examples=60)
@given(FREE)
def test_thickness_is_the_largest_disc_over_nearly_every_cell(free: np.ndarray) -> None:
    padded = np.pad(free, 1)
    walls, cells = np.argwhere(~padded), np.argwhere(padded)
    radius = np.sqrt(((cells[:, None] - walls[None]) ** 2).sum(axis=2)).min(axis=1)
    distance = np.zeros(padded.shape, np.float32)
    distance[tuple(cells.T)] = radius
    covers = np.sqrt(((cells[:, None] - cells[None]) ** 2).sum(axis=2)) < radius[:, None] - 1e-3
    largest = np.where(covers, radius[:, None], 0).max(axis=0)
    thickness = thickness_over(distance)[tuple(cells.T)]
    assert (thickness <= largest + 1e-3).all()
    assert (thickness >= 0.8 * largest).mean() >= 0.9  # only ridges hold discs, so some corners see a smaller one


@settings(deadline=None, max_examples=60)
@given(arrays(np.int32, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(-1, 2)))
def test_pieces_are_the_connected_parts_of_each_label(label: np.ndarray) -> None:
    piece, count = kernels.pieces(label)
    np.testing.assert_array_equal(piece < 0, label < 0)
    assert count == sum(connected(label == value) for value in (0, 1, 2))
    for number in range(count):
        assert len(np.unique(label[piece == number])) == 1


def test_letters_go_on_after_z() -> None:
    assert [letters(index) for index in (0, 25, 26, 51, 52, 702)] == ["A", "Z", "AA", "AZ", "BA", "AAA"]


def test_places_are_read_line_by_line() -> None:
    assert reading_order([(10.0, 9.0), (11.0, 2.0), (30.0, 1.0), (9.5, 5.0)], line=3.0) == [1, 3, 0, 2]


def test_distances_do_not_depend_on_where_an_image_lies_in_memory() -> None:
    free = np.pad(np.ones((16, 16), np.bool_), 1)
    free[4, 7] = free[9, 3] = False
    once = distance_within(free)
    held = []
    for size in range(1, 400):
        held.append(bytearray(size))
        np.testing.assert_array_equal(distance_within(free.copy()), once)
    rows, columns = np.nonzero(~free)
    at = np.argwhere(free)
    nearest = ((at[:, :1] - rows) ** 2 + (at[:, 1:] - columns) ** 2).min(axis=1)
    np.testing.assert_array_equal(once[free], np.sqrt(nearest.astype(np.float32)))
