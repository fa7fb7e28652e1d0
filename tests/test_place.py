"""Places: how they are written, and which free cell each stands for."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import PlaceError, QualrlError, UnknownNameError
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import Place, PlaceCell, PlaceMetres, PlaceName, read_place, resolve_cell
from qualrl.spatial.region_map import Landmark, Region, RegionMap


@pytest.mark.parametrize(
    ("written", "place"),
    [
        ("room A", PlaceName("room A")),
        ("120,45", PlaceCell(120, 45)),
        (" 120 , 45 ", PlaceCell(120, 45)),
        ([120, 45], PlaceCell(120, 45)),
        ((-1, 0), PlaceCell(-1, 0)),
        ("3.5,2", PlaceMetres(3.5, 2.0)),
        ("3,2.", PlaceMetres(3.0, 2.0)),
        ("-3.5, +.5", PlaceMetres(-3.5, 0.5)),
        ("1e1,2", PlaceMetres(10.0, 2.0)),
        ([3.5, 2], PlaceMetres(3.5, 2.0)),
        ([3.0, 2.0], PlaceMetres(3.0, 2.0)),
        ("1,2,3", PlaceName("1,2,3")),
        ("12", PlaceName("12")),
        ("1;2", PlaceName("1;2")),
        ("door A-B", PlaceName("door A-B")),
        ("\u0661,\u0662", PlaceName("\u0661,\u0662")),
        (PlaceCell(1, 2), PlaceCell(1, 2)),
    ],
)
def test_how_places_are_written(written: object, place: Place) -> None:
    read = read_place(written)
    assert read == place
    assert type(read) is type(place)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("", "a place needs a name, got ''"),
        ("  ", "a place needs a name"),
        ("x" * 101, "the name of a place has at most 100 characters, got 101"),
        ("1" * 5000 + ",1", "the name of a place has at most 100 characters"),
        ("1e999,0", "a point needs two finite numbers, got inf, 0.0"),
        (f"{10**10},1", "no map has a cell [10000000000, 1]"),
        (12, "got 12; quote a name that looks like a number"),
        (None, "must be a name, [row, column] in whole numbers, or [x, y] in metres with a decimal point, got nothing"),
        ([1], "got [1]"),
        ([1, True], "got [1, True]"),
        ([1, "2"], "got [1, '2']"),
        ([10**400, 0.5], "got a number too large for a point"),
        ({"x": 1}, "got a mapping of 1 keys"),
    ],
)
def test_what_is_no_place(written: object, said: str) -> None:
    with pytest.raises(PlaceError) as caught:
        read_place(written)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_name_that_reads_as_numbers_is_no_name() -> None:
    with pytest.raises(PlaceError, match="reads as two numbers"):
        PlaceName("1,2")


@settings(deadline=None)
@given(st.text(max_size=30) | st.from_regex(r"[-+0-9.eE, ]{1,12}", fullmatch=True))
def test_any_text_is_a_place_or_refused(text: str) -> None:
    try:
        place = read_place(text)
    except PlaceError:
        return
    assert read_place(place) == place


@settings(deadline=None)
@given(st.integers(-(10**9), 10**9), st.integers(-(10**9), 10**9), st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
def test_numbers_come_back(row: int, column: int, x_m: float, y_m: float) -> None:
    assert read_place(f"{row},{column}") == read_place([row, column]) == PlaceCell(row, column)
    assert read_place(f"{x_m!r},{y_m!r}") == read_place([x_m, y_m]) == PlaceMetres(x_m, y_m)


@pytest.fixture
def regions() -> RegionMap:
    """Two rooms of 4 x 3 cells with a wall of one column, an unknown corner, and one landmark."""
    free = np.ones((4, 7), np.bool_)
    free[:, 3] = False
    free[3, 6] = False
    occupied = np.zeros((4, 7), np.bool_)
    occupied[:, 3] = True
    label = np.where(free, np.arange(7) // 4, -1).astype(np.int32)
    return RegionMap(
        OccupancyGrid(free, occupied, 0.5, (10.0, 20.0, 0.0)),
        label,
        (
            Region("room A", "room", 12, 3.0, (1.5, 1.0), (1, 1)),
            Region("room B", "room", 11, 2.75, (1.4, 4.9), (1, 5)),
        ),
        (),
        (Landmark("corner A1", "corner", (0, 0), np.array([[0, 0]], np.int32), (0,)),),
    )


def test_names_cells_and_points_stand_for_cells(regions: RegionMap) -> None:
    assert resolve_cell(PlaceName("room B"), regions) == (1, 5)
    assert resolve_cell(PlaceName("corner A1"), regions) == (0, 0)
    assert resolve_cell(PlaceCell(3, 5), regions) == (3, 5)
    assert resolve_cell(PlaceMetres(10.25, 20.25), regions) == (3, 0)
    assert resolve_cell(PlaceMetres(13.4, 21.9), regions) == (0, 6)


@pytest.mark.parametrize(
    ("written", "kind", "said"),
    [
        ("room a", UnknownNameError, "no place is called 'room a'; did you mean 'room A'?"),
        ("kitchen", UnknownNameError, "no place is called 'kitchen'; known are 'room A', 'room B', 'corner A1'"),
        ("500,3", PlaceError, "cell 500,3 lies outside the map of 4 x 7 cells"),
        ("-1,3", PlaceError, "cell -1,3 lies outside the map of 4 x 7 cells"),
        ("1,3", PlaceError, "cell 1,3 lies in a wall; the nearest free cell is 1,2"),
        ("3,6", PlaceError, "cell 3,6 lies where the map is unknown; the nearest free cell is 2,6"),
        (
            "9.9,21.0",
            PlaceError,
            "point 9.9, 21 m lies outside the map of 4 x 7 cells, "
            "which spans x 10.00 to 13.50 m and y 20.00 to 22.00 m",
        ),
        ("1e308,-1e308", PlaceError, "point 1e+308, -1e+308 m lies outside the map of 4 x 7 cells"),
        ("11.6,20.1", PlaceError, "point 11.6, 20.1 m lies in a wall; the nearest free cell is 3,2"),
    ],
)
def test_places_where_no_robot_can_stand(regions: RegionMap, written: str, kind: type[QualrlError], said: str) -> None:
    with pytest.raises(kind) as caught:
        resolve_cell(read_place(written), regions)
    assert str(caught.value).startswith(said)


@settings(deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False), st.data())
def test_any_point_is_a_free_cell_or_refused(x_m: float, y_m: float, data: st.DataObject) -> None:
    yaw_rad = data.draw(st.floats(-7, 7))
    grid = OccupancyGrid(np.array([[True, False]]), np.array([[False, True]]), 1.0, (0.0, 0.0, yaw_rad))
    regions = RegionMap(grid, np.array([[0, -1]], np.int32), (), (), ())
    with contextlib.suppress(PlaceError):
        assert grid.free[resolve_cell(PlaceMetres(x_m, y_m), regions)]
