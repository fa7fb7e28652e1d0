"""Zones of scenarios: drawn in metres or as an image, read back, and refused in one line where they are wrong."""

import json

import cv2
import numpy as np
import pytest

from qualrl.errors import PlaceError, ScenarioError
from qualrl.io.scenario import Scenario, load_scenario
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.worlds import TWO_ROOMS

HEAD = "map: rooms.yaml\ngoal: [2, 2]\n"


@pytest.fixture
def rooms(tmp_path, monkeypatch):
    """Two rooms of 8 x 7 cells, 1 m each, and a way to write a scenario of them."""
    monkeypatch.chdir(tmp_path)
    draw(tmp_path, "rooms", TWO_ROOMS)

    def write(text):
        (tmp_path / "s.scenario.yaml").write_text(HEAD + text)
        return load_scenario("s.scenario.yaml")

    return write


def relations_of(scenario):
    return scenario.relations(scenario.regions())


def test_zones_are_polygons_in_metres_or_images(rooms):
    mask = np.full((9, 19), 255, np.uint8)
    mask[1:3, 1:4] = 0
    cv2.imwrite("dock.png", mask)
    cv2.imwrite("not dock.png", 255 - mask)
    see_through = np.zeros((9, 19, 4), np.uint8)
    see_through[..., 3] = 255 - mask
    cv2.imwrite("layer.png", see_through)
    scenario = rooms(
        "zones:\n  metres: [[2, 8], [5, 8], [5, 10], [2, 10]]\n  image: {image: dock.png}\n"
        "  light: {image: not dock.png, inside: light}\n  layer: {image: layer.png}\n"
        "  all: [[-1, -1], [29, -1], [29, 29], [-1, 29]]\n"
        "distance: {near_m: 2, far_m: 10}\n"
    )
    relations = relations_of(scenario)
    expected = [(row, column) for row in (1, 2) for column in (1, 2, 3)]
    for zone in relations.zones[:4]:
        assert [tuple(cell) for cell in np.argwhere(zone.cells).tolist()] == expected
    assert relations.topology("image", "metres") == "EQ"
    west, east = sorted(relations.regions.region_names, key=lambda name: relations.middle(name))
    assert relations.topology("image", west) == "TPP"
    assert relations.topology("image", east) == "DC"
    assert relations.topology(east, "all") == "TPP"
    assert relations.direction("image", east) == "west"
    assert scenario.distance.cuts.name(relations.distance_m(west, east)) == "medium"


WRONG = {
    "zones: {dock: 3}": "3:15: zones.dock: must be corners [[x, y], ...] in metres, or {image: FILE}, got 3",
    "zones: {dock: [[0, 0], [1, 1]]}": "3:15: zones.dock: a polygon has 3 to 1000 corners, got 2",
    "zones: {dock: [[0, 0], [1, 1], [1, no]]}": "3:15: zones.dock: corner 3 must be [x, y] in metres, numbers up to "
    "1e+09, got [1, 'no']",
    "zones: {dock: [[0, 0], [1, 1], [1, .nan]]}": "3:15: zones.dock: corner 3 must be [x, y] in metres, numbers up to "
    "1e+09, got [1, nan]",
    "zones: {dock: {imag: a.png}}": "3:15: zones.dock: unknown key 'imag'; did you mean 'image'?",
    "zones: {dock: {inside: dark}}": "3:15: zones.dock: image must be the name of a file, got nothing",
    "zones: {dock: {image: a.png, inside: red}}": "3:15: zones.dock: inside must be dark or light (the pixels that "
    "belong to the zone), got 'red'",
    "zones: {'1,2': [[0, 0], [1, 1], [1, 0]]}": "3:9: zones.1,2: must not read as two numbers, got '1,2'",
    "distance: {near_m: 5, far_m: 2}": "3:11: distance: near_m must be less than far_m, got near_m 5, far_m 2",
    "distance: {near_m: 0}": "3:20: distance.near_m: must be greater than 0, got 0",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_zone_is_told_with_its_place(rooms, text):
    with pytest.raises(ScenarioError) as caught:
        rooms(text)
    assert str(caught.value) == f"s.scenario.yaml:{WRONG[text]}"


def test_zones_that_do_not_fit_the_map_are_told_with_their_place(rooms):
    cv2.imwrite("small.png", np.zeros((3, 4), np.uint8))
    off = "zones:\n  far: [[50, 50], [51, 50], [51, 51]]"
    for text, expected in {
        off: "4:8: zones.far: covers no cell where a robot could be; check its place on the map",
        "zones:\n  dock: {image: none.png}": "4:9: zones.dock: the image of the zone cannot be used: none.png",
        "zones:\n  dock: {image: small.png}": "4:9: zones.dock: is 4 x 3 pixels large, but the map is 19 x 9",
    }.items():
        with pytest.raises(PlaceError) as caught:
            relations_of(rooms(text))
        assert str(caught.value).startswith(f"s.scenario.yaml:{expected}")
        assert "\n" not in str(caught.value)
    asked = rooms("").with_settings(["zones.far.off=[[50, 50], [51, 50], [51, 51]]"])
    with pytest.raises(PlaceError, match=r"^--set zones.far.off: covers no cell"):
        relations_of(asked)
    with pytest.raises(PlaceError, match=r"s.scenario.yaml:4:11: zones.room A: a place of the map is called so"):
        relations_of(rooms("zones:\n  room A: [[2, 8], [5, 8], [5, 10]]"))
    in_memory = Scenario(map="rooms.yaml", goal="room A", zones={"far": [[50, 50], [51, 50], [51, 51]]})
    with pytest.raises(PlaceError, match=r"^zones.far: covers no cell"):
        relations_of(in_memory)


def test_commands_see_the_zones_and_copies_find_their_images(rooms, tmp_path):
    mask = np.full((9, 19), 255, np.uint8)
    mask[1:3, 1:4] = 0
    cv2.imwrite("dock.png", mask)
    scenario = rooms("zones: {dock: {image: dock.png}}\nlearn: {episodes: 3}")
    document = json.loads(qualrl_command("describe", "s.scenario.yaml", "--json", cwd=tmp_path)[0])
    assert [place for place in document["places"] if place["sort"] == "zone"] == [
        {"name": "dock", "sort": "zone", "centre": list(relations_of(scenario).centre("dock"))}
    ]
    qualrl_command("run", "s.scenario.yaml", "-o", "deep/er", "-q", cwd=tmp_path)
    copy = load_scenario(tmp_path / "deep" / "er" / "scenario.yaml")
    assert relations_of(copy).topology("dock", "room A") == relations_of(scenario).topology("dock", "room A")
