"""MovingAI maps and path tasks: what is read, and errors that point at the line."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import MapError
from qualrl.io.moving_ai import PathTask, parse_moving_ai, read_moving_ai, read_scenarios
from qualrl.io.read_map import read_map

SMALL = "type octile\nheight 2\nwidth 5\nmap\n.GS@O\nTW@@.\n"


def complaint(text: str) -> str:
    with pytest.raises(MapError) as caught:
        parse_moving_ai(text.encode("latin-1"), "m.map")
    return str(caught.value)


def test_terrain() -> None:
    grid = parse_moving_ai(SMALL.encode(), "m.map")
    assert grid.free.tolist() == [[True, True, True, False, False], [False] * 4 + [True]]
    assert (grid.occupied == ~grid.free).all()
    assert (grid.resolution_m, grid.origin, grid.source) == (1.0, (0.0, 0.0, 0.0), "m.map")
    assert grid.sha256 == hashlib.sha256(SMALL.encode()).hexdigest()


def test_a_map_is_known_by_its_name_or_by_its_first_line(tmp_path: Path) -> None:
    for name in ("m.map", "m.txt"):
        (tmp_path / name).write_text(SMALL)
        assert read_map(tmp_path / name).shape == (2, 5)
    assert read_map(tmp_path / "m.map", resolution_m=0.5).resolution_m == 0.5
    assert read_moving_ai(tmp_path / "m.map", 2.0).resolution_m == 2.0


def test_windows_lines_and_blank_lines_at_the_end_are_fine() -> None:
    assert parse_moving_ai(SMALL.replace("\n", "\r\n").encode(), "m").shape == (2, 5)
    assert parse_moving_ai(SMALL.rstrip().encode(), "m").shape == (2, 5)
    assert parse_moving_ai((SMALL + "\n \n").encode(), "m").shape == (2, 5)


@settings(deadline=None)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_what_is_written_by_hand_is_read(height: int, width: int, seed: int) -> None:
    cells = np.random.default_rng(seed).choice(list(".GS@OTW"), (height, width))
    cells[0, 0] = "."
    rows = "\n".join("".join(row) for row in cells)
    grid = parse_moving_ai(f"type octile\nheight {height}\nwidth {width}\nmap\n{rows}\n".encode(), "m")
    assert grid.free.tolist() == [[cell in ".GS" for cell in row] for row in cells]


@pytest.mark.parametrize(
    ("change", "instead", "said"),
    [
        ("type octile", "type tile", "m.map:1:1: expected 'type octile', got 'type tile'; is it a MovingAI map?"),
        (SMALL, "", "m.map:1:1: expected 'type octile', got ''; is it a MovingAI map?"),
        (SMALL, "type octile", "m.map:2:1: expected 'height HEIGHT', got ''; is it a MovingAI map?"),
        ("height 2\n", "", "m.map:2:1: expected 'height HEIGHT', got 'width 5'; is it a MovingAI map?"),
        ("height 2", "height two", "m.map:2:8: height must be a whole number above 0"),
        ("width 5", "width 0", "m.map:3:7: width must be a whole number above 0"),
        ("width 5", "width 5 6", "m.map:3:1: expected 'width WIDTH', got 'width 5 6'; is it a MovingAI map?"),
        (
            "height 2",
            "height 30000000",
            "m.map:2:8: the header promises 30000000 rows, the file has 2; correct one of them",
        ),
        ("width 5", "width 900000000", "m.map:2:1: 2 x 900000000 cells are more than the 400,000,000 that can be read"),
        ("\nmap\n", "\nmop\n", "m.map:4:1: expected 'map', got 'mop'; is it a MovingAI map?"),
        ("TW@@.\n", "", "m.map:2:8: the header promises 2 rows, the file has 1; correct one of them"),
        ("TW@@.\n", "TW@@.\n.....\n", "m.map:7:1: more rows than the 2 that the header promises; correct one"),
        ("TW@@.", "TW@@", "m.map:6:1: the row has 4 cells, the header promises 5; correct one"),
        ("TW@@.", "TW@@..", "m.map:6:1: the row has 6 cells, the header promises 5; correct one"),
        ("TW@@.", "TW#@.", "m.map:6:3: '#' is no MovingAI terrain; use one of .GS@OTW"),
        ("TW@@.", "TW@\xe9.", "m.map:6:4: 'é' is no MovingAI terrain; use one of .GS@OTW"),
        (".GS@O\nTW@@.", "@@@@@\nWWWWW", "m.map: no cell is free, so there is nowhere for a robot to be"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(change: str, instead: str, said: str) -> None:
    assert change in SMALL
    assert complaint(SMALL.replace(change, instead)) == said


@settings(deadline=None)
@given(st.binary(max_size=60), st.booleans())
def test_any_bytes_are_a_map_or_one_line_an_error(data: bytes, headed: bool) -> None:
    told = "m.map:"
    try:
        parse_moving_ai(b"type octile\nheight 2\nwidth 2\nmap\n" * headed + data, "m.map")
    except MapError as problem:
        told = str(problem)
    assert told.startswith("m.map:")
    assert "\n" not in told


def test_path_tasks(tmp_path: Path) -> None:
    path = tmp_path / "m.map.scen"
    path.write_text("version 1\n0\tmaps/my map.map\t5\t2\t1\t0\t4\t1\t3.41421\n3 m.map 5 2 0 0 0 0 0\n\n")
    assert read_scenarios(path) == [
        PathTask(0, "maps/my map.map", (2, 5), (0, 1), (1, 4), 3.41421),
        PathTask(3, "m.map", (2, 5), (0, 0), (0, 0), 0.0),
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ":1:1: expected 'version 1', got ''"),
        ("version 2\n", ":1:1: expected 'version 1', got 'version 2'"),
        ("version 1.0\n1 2 3\n", ":2:1: expected 9 fields separated by tabs, got 3"),
        ("version 1\n\n0\tm\t5\t2\tx\t0\t4\t1\t3\n", ":3:1: expected numbers, but for the map's path"),
        ("version 1\n0\tm\t5\t2\t5\t0\t4\t1\t3\n", ":2:1: start and goal must lie inside 5 x 2 cells"),
        ("version 1\n0\tm\t5\t2\t0\t0\t4\t1\tnan\n", ":2:1: start and goal must lie inside 5 x 2 cells"),
    ],
)
def test_wrong_path_tasks(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "m.scen"
    path.write_text(text)
    with pytest.raises(MapError) as caught:
        read_scenarios(path)
    assert str(caught.value).startswith(f"{path}{said}")
