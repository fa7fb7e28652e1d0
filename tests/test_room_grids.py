"""Grids of rooms: the rooms are the squares between the walls and the doors the gaps, exactly."""

import numpy as np
import pytest

import qualrl
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests.room_grids import room_grid, rooms_between_walls


@pytest.mark.parametrize(
    ("n", "k", "resolution_m"), [(12, 4, 1.0), (10, 5, 1.0), (8, 8, 1.0), (8, 8, 0.5), (5, 16, 1.0), (3, 32, 0.2)]
)
@pytest.mark.parametrize("seed", range(4))
def test_rooms_are_the_squares_and_doors_the_gaps(seed: int, n: int, k: int, resolution_m: float) -> None:
    free, gaps = room_grid(seed, n, k)
    seen = qualrl.segment(OccupancyGrid.from_free(free, resolution_m))
    rooms = rooms_between_walls(free, k)
    found = {room: {int(seen.label[cell]) for cell in cells} for room, cells in rooms.items()}
    assert all(len(labels) == 1 for labels in found.values())
    assert sorted(label for labels in found.values() for label in labels) == list(range(n * n))
    assert {region.kind for region in seen.regions} == {"room"}
    # A gap may belong to the room on either side: the doorway is it, or the cell before it.
    at = [door.cells.tolist() for door in seen.doorways]
    assert [len(cells) for cells in at] == [1] * len(gaps)
    assert [door.width_m for door in seen.doorways] == [resolution_m] * len(gaps)
    assert not any(door.is_open for door in seen.doorways)
    left = set(gaps)
    for ((row, column),) in at:
        near = {(row, column), (row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)} & left
        assert near
        left -= {min(near)}
    assert left == set()


def test_between_the_same_rooms_each_gap_is_a_doorway() -> None:
    free = np.ones((8, 16), np.bool_)
    free[0] = free[:, 0] = free[:, 8] = False
    free[2, 8] = free[6, 8] = True
    seen = qualrl.segment(OccupancyGrid.from_free(free))
    assert [door.cells.tolist() for door in seen.doorways] == [[[2, 8]], [[6, 8]]]
