"""Landmarks placed by hand: in scenarios and in the library, at doorways, and what is said of wrong ones."""

from pathlib import Path

import numpy as np
import pytest

import qualrl
from qualrl.errors import PlaceError, QualrlError, ScenarioError, UnknownNameError
from qualrl.io.model_file import read_model, write_model
from qualrl.io.scenario import Scenario, dump_scenario, load_scenario
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import read_place
from qualrl.spatial.placed_landmarks import with_landmarks
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.segmentation import segment
from tests.worlds import PUZZLE, TWO_ROOMS, grid_of

MAPS = Path(__file__).parent.parent / "maps"
PAPER = {
    "S0": (11, 1), "S1": (1, 1), "S2": (1, 11), "S3": (11, 11), "S4": (9, 9), "S5": (9, 3), "S6": (3, 3), "S7": (3, 9),
    "S8": (2, 6), "S9": (8, 6),
}  # fmt: skip


def placed(regions: RegionMap, **places: object) -> RegionMap:
    return with_landmarks(regions, {name: read_place(place) for name, place in places.items()})


@pytest.fixture(scope="module")
def puzzle() -> RegionMap:
    return segment(grid_of(PUZZLE))


@pytest.fixture(scope="module")
def rooms() -> RegionMap:
    """Two rooms with a door two cells high."""
    rows = TWO_ROOMS.strip().splitlines()
    rows[5] = rows[4]
    return segment(grid_of("\n".join(rows)))


def test_the_bundled_puzzle_has_the_papers_landmarks() -> None:
    model = load_scenario(MAPS / "puzzle.scenario.yaml").build()
    assert model.regions is not None
    assert {mark.name: mark.cell for mark in model.regions.landmarks} == PAPER
    assert set(model.landmarks.names) == {*PAPER, "goal"}
    assert model.start == model.state_at(read_place("S0")) == model.grid.state_of[11, 1]
    assert [int(np.sum(model.landmarks.landmark_of == at)) for at in range(len(model.landmarks.names))] == [1] * 11


def test_arcs_join_the_landmarks_of_a_region_and_a_doorways_landmark_joins_both(puzzle: RegionMap) -> None:
    model = qualrl.build(puzzle, [6, 6], start="S0", landmarks=PAPER)
    outer, inner = {"S0", "S1", "S2", "S3"}, {"S4", "S5", "S6", "S7"}
    expected = {
        (a, b)
        for group in (outer | {"S8"}, inner | {"S8", "S9"}, {"S9", "goal"})
        for a in group
        for b in group
        if a != b
    }
    assert set(model.landmarks.arcs) == expected


def test_a_landmark_in_a_doorway_takes_it_over(rooms: RegionMap) -> None:
    (door,) = rooms.doorways
    top, bottom = door.cells.tolist()
    taken = placed(rooms, gate=bottom)
    assert taken.doorways[0].name == "gate"
    (mark,) = taken.landmarks
    assert (mark.name, mark.kind, mark.cell, mark.regions) == ("gate", "doorway", tuple(bottom), door.pair)
    np.testing.assert_array_equal(mark.cells, [top, bottom])
    assert "go through gate" in qualrl.plan(qualrl.build(taken, "room B"), start="room A").explain()
    assert rooms.doorways[0].name == "door 1"  # what was given stays as it was


def test_other_landmarks_keep_the_doorways_and_replace_the_rest(rooms: RegionMap) -> None:
    marked = placed(rooms, lamp=(2, 3), spot="6.5, 6.5")
    assert [(mark.name, mark.kind, mark.regions) for mark in marked.landmarks] == [
        ("door 1", "doorway", (0, 1)),
        ("lamp", "placed", (int(rooms.label[2, 3]),)),
        ("spot", "placed", (int(rooms.label[2, 6]),)),
    ]
    assert marked.landmarks[2].cell == (2, 6)
    assert [mark.kind for mark in placed(rooms).landmarks] == ["doorway"]
    assert placed(rooms, here="room A").landmarks[1].cell == rooms.regions[0].centre
    assert placed(rooms, **{"corner 1": (2, 2)}).landmarks[1].cell == (2, 2)


@pytest.mark.parametrize(
    ("places", "error", "said"),
    [
        ({"a": (0, 0)}, PlaceError, "landmarks.a: cell 0,0 lies in a wall; the nearest free cell is 1,1"),
        ({"a": (99, 0)}, PlaceError, "landmarks.a: cell 99,0 lies outside the map"),
        ({"a": "romo A"}, UnknownNameError, "landmarks.a: no place is called 'romo A'; did you mean 'room A'?"),
        ({"a": (1, 1), "b": (1, 1)}, ScenarioError, "landmarks.b: lies on cell 1,1, where 'a' is already"),
        ({"a": (4, 9), "b": (5, 9)}, ScenarioError, "landmarks.b: lies in 'door 1' as 'a' does"),
        ({"room A": (1, 1)}, ScenarioError, "landmarks.room A: another place is called so already"),
        ({"door 1": (1, 1)}, ScenarioError, "landmarks.door 1: another place is called so already"),
    ],
)
def test_wrong_landmarks(rooms: RegionMap, places: dict[str, object], error: type[QualrlError], said: str) -> None:
    with pytest.raises(error) as caught:
        placed(rooms, **places)
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)
    assert placed(rooms, **{"door 1": (4, 9)}).doorways[0].name == "door 1"


def write(folder: Path, landmarks: str) -> Path:
    file = folder / "s.yaml"
    file.write_text(f"map: {MAPS / 'puzzle.yaml'}\ngoal: [6, 6]\nlandmarks: {landmarks}\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("landmarks", "said"),
    [
        ("{a: 3}", "s.yaml:3:16: landmarks.a: must be a name, [row, column]"),
        ("{a: [1, 1], '1,2': [1, 2]}", "s.yaml:3:24: landmarks.1,2: must not read as two numbers"),
        ("[a]", "s.yaml:3:12: landmarks: must be a mapping 'name: ...', got ['a']"),
        ("{a: [0, 0]}", "s.yaml: landmarks.a: cell 0,0 lies in a wall"),
        ("{a: nowhere}", "s.yaml: landmarks.a: no place is called 'nowhere'"),
        ("{a: [1, 1], b: '1,1'}", "s.yaml: landmarks.b: lies on cell 1,1, where 'a' is already"),
    ],
)
def test_wrong_landmarks_in_a_scenario(tmp_path: Path, landmarks: str, said: str) -> None:
    with pytest.raises(QualrlError) as caught:
        load_scenario(write(tmp_path, landmarks)).build()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scenario_with_landmarks_is_written_and_read_back(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, "{S 0: [11, 1], lamp: [6.5, 3.0], mid: room A}"))
    again = tmp_path / "again.yaml"
    again.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(again) == scenario
    moved = scenario.with_settings(["landmarks.S 0=[1, 1]"])
    assert moved.landmarks is not None
    assert moved.landmarks["S 0"] == read_place([1, 1])
    assert moved.landmarks["lamp"] == read_place([6.5, 3.0])
    assert Scenario(map="m.png", goal=read_place("x")).landmarks is None


def test_a_model_with_placed_landmarks_is_stored_and_read_back(puzzle: RegionMap, tmp_path: Path) -> None:
    model = qualrl.build(puzzle, [6, 6], landmarks=PAPER)
    write_model(model, tmp_path / "m.npz")
    again = read_model(tmp_path / "m.npz")
    assert isinstance(again, HybridMDP)
    assert again.landmarks.arcs == model.landmarks.arcs
    assert again.regions is not None
    assert [mark.kind for mark in again.regions.landmarks] == ["doorway"] * 2 + ["placed"] * 8


def test_names_come_first_so_places_use_the_new_ones() -> None:
    regions = segment(OccupancyGrid.from_free(np.ones((30, 40), np.bool_), 1.0))
    model = qualrl.build(regions, "hall", names={"room A": "hall"}, landmarks={"middle": "hall"})
    assert model.landmarks.names == ("middle", "goal")
