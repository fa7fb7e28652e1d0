"""Landmarks: corners, junctions and dead ends where a person would name them, and nowhere else."""

import numpy as np

from qualrl.models.hybrid_mdp import hybrid_mdp
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import PlaceCell
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.segmentation import segment


def cells(seen: RegionMap, kind: str) -> list[tuple[int, int]]:
    """Cells of the landmarks of one kind, sorted."""
    return sorted(mark.cell for mark in seen.landmarks if mark.kind == kind)


def drawn(text: str) -> OccupancyGrid:
    """A map drawn in characters, '#' for walls, 1 m a cell."""
    return OccupancyGrid.from_free(np.array([list(row) for row in text.split()]) != "#")


def test_puzzle_has_the_ten_landmarks_of_its_corridors() -> None:
    seen = segment(
        drawn("""
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
    """)
    )
    corners = {(1, 1), (1, 11), (11, 1), (11, 11), (3, 3), (3, 9), (9, 3), (9, 9)}
    assert corners <= set(cells(seen, "corner"))
    assert cells(seen, "doorway") == [(2, 6), (8, 6)]
    assert cells(seen, "junction") == []
    assert cells(seen, "dead end") == []
    model = hybrid_mdp(seen, PlaceCell(6, 6))
    level = model.landmarks
    places = {model.cell_of(int(np.flatnonzero(level.landmark_of == at)[0])) for at in range(len(level.names))}
    assert corners | {(2, 6), (8, 6)} <= places


def test_each_region_has_its_centre_as_a_landmark_which_the_model_leaves_out() -> None:
    free = np.zeros((60, 100), np.bool_)
    free[1:59, 1:50] = free[1:59, 52:99] = free[25:35, 50:52] = free[0, 0] = True
    seen = segment(OccupancyGrid.from_free(free, 0.1))
    assert [region.kind for region in seen.regions] == ["room", "room", "pocket"]
    centres = [mark for mark in seen.landmarks if mark.kind == "centre"]
    assert [(mark.name, mark.cell, mark.regions) for mark in centres] == [
        ("centre 1", seen.regions[0].centre, (0,)),
        ("centre 2", seen.regions[1].centre, (1,)),
    ]
    names = hybrid_mdp(seen, PlaceCell(30, 5)).landmarks.names
    assert {mark.name for mark in seen.landmarks} - set(names) == {"centre 1", "centre 2"}


def test_a_post_in_a_corridor_makes_no_junction_and_a_side_corridor_does() -> None:
    free = np.zeros((200, 400), np.bool_)
    free[20:60, 10:390] = free[60:190, 300:340] = True
    free[38:43, 150:155] = False
    (row, column), *others = cells(segment(OccupancyGrid.from_free(free, 0.05)), "junction")
    assert others == []
    assert 35 <= row < 65
    assert 310 <= column < 330


def test_a_bend_is_no_junction() -> None:
    free = np.zeros((320, 420), np.bool_)
    free[10:40, 10:410] = free[10:310, 380:410] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert cells(seen, "junction") == []
    assert len(cells(seen, "dead end")) == 2


def test_a_room_has_four_corners() -> None:
    free = np.zeros((102, 122), np.bool_)
    free[1:101, 1:121] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert cells(seen, "corner") == [(1, 1), (1, 120), (100, 1), (100, 120)]
    assert [mark.name for mark in seen.landmarks] == ["corner 1", "corner 2", "corner 3", "corner 4", "centre 1"]


def test_ragged_walls_have_no_corners_of_their_own() -> None:
    generator = np.random.default_rng(1)
    free = np.zeros((220, 320), np.bool_)
    free[10:210, 10:310] = True
    for column in range(320):
        free[: 10 + generator.integers(0, 3), column] = False
        free[210 - generator.integers(0, 3) :, column] = False
    for row in range(220):
        free[row, : 10 + generator.integers(0, 3)] = False
        free[row, 310 - generator.integers(0, 3) :] = False
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert len(cells(seen, "corner")) == 4


def test_narrow_corridors_meet_at_a_junction_and_end_dead() -> None:
    seen = segment(
        drawn("""
        ###############
        #.............#
        #######.#######
        #######.#######
        #######.#######
        #######.#######
        #######.#######
        ###############
    """)
    )
    assert [region.kind for region in seen.regions] == ["corridor"]
    assert cells(seen, "junction") == [(1, 7)]
    assert cells(seen, "dead end") == [(1, 1), (1, 13), (6, 7)]


def test_wide_corridors_meet_at_a_junction_and_end_dead() -> None:
    free = np.zeros((320, 420), np.bool_)
    free[10:40, 10:410] = free[10:310, 195:225] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert [region.kind for region in seen.regions] == ["corridor"]
    ((row, column),) = cells(seen, "junction")
    assert 10 <= row < 60
    assert 180 <= column < 240
    ends = cells(seen, "dead end")
    assert len(ends) == 3
    assert ends[0][1] < 50 or ends[0][1] > 370
    assert ends[2][0] > 270


def test_a_corridor_that_ends_at_a_door_has_no_dead_end_there() -> None:
    free = np.zeros((102, 302), np.bool_)
    free[1:101, 1:101] = True
    free[46:56, 101:104] = True
    free[40:62, 104:301] = True
    seen = segment(OccupancyGrid.from_free(free, 0.05))
    assert seen.region_names == ("room A", "corridor 1")
    ((_, column),) = cells(seen, "dead end")
    assert column > 270
