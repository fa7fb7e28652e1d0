"""Maps in relations, and routes as one walks them: turns by angles, landmarks cell by cell, sentences by their JSON."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import UnknownNameError
from qualrl.planning.describe import MOST_LINES, NOWHERE_BEYOND, describe, walk_between
from qualrl.planning.on_the_way import REACH_M, Mark, QuantitySpace, turned
from qualrl.qualitative.checking import check
from qualrl.qualitative.statements import read_statement
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import Region, RegionMap
from qualrl.spatial.relations import Relations
from qualrl.spatial.zones import Zone
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_relations import regions_of
from tests.worlds import grid_of, part_around

# A corridor with a room above its left end, one below its right end, and one above its right end.
CORRIDOR = """
########################
#......##########......#
#......##########......#
#......##########......#
#......##########......#
###.################.###
#......................#
#......................#
#################.######
###############......###
###############......###
###############......###
########################
"""
MIRRORED = {"left": "right", "right": "left", "straight": "straight", "back": "back", None: None}
HEADINGS = st.tuples(st.integers(-4, 4), st.integers(-4, 4)).filter(any)


@given(HEADINGS, HEADINGS)
def test_turns_are_told_by_their_angle(before, after):
    angles = [math.degrees(math.atan2(-down, right)) for down, right in (before, after)]
    angle = round((angles[1] - angles[0] + 180) % 360 - 180, 6)
    if abs(angle) <= 45:
        expected = "straight"
    elif abs(angle) >= 135:
        expected = "back"
    else:
        expected = "left" if angle > 0 else "right"
    assert turned(before, after) == expected


def walk_on(free, start, goal):
    regions = qualrl.segment(OccupancyGrid.from_free(free, 0.5))
    return walk_between(regions, f"{start[0]},{start[1]}", f"{goal[0]},{goal[1]}")


def test_a_corridor_is_walked_with_the_same_turns_however_the_map_is_turned():
    free = grid_of(CORRIDOR).free
    height, width = free.shape
    upper_left, upper_right, lower = (2, 3), (2, 20), (10, 17)
    walk = walk_on(free, upper_left, upper_right)
    assert [(at.side, at.turn) for at in walk.passages] == [(None, None), ("left", "back"), ("straight", None)]
    assert [at.turn for at in walk_on(free, upper_left, lower).passages] == [None, "straight", None]
    for turns in range(4):
        for mirrored in (False, True):

            def place(cell, turns=turns, mirrored=mirrored):
                marked = np.zeros(free.shape, np.bool_)
                marked[cell] = True
                found = np.argwhere(shown(marked, turns, mirrored))[0].tolist()
                return found[0], found[1]

            other = walk_on(shown(free, turns, mirrored), place(upper_left), place(upper_right))
            told = [(at.side, at.turn) for at in walk.passages]
            if mirrored:
                told = [(MIRRORED[side], MIRRORED[turn]) for side, turn in told]
            assert [(at.side, at.turn) for at in other.passages] == told
    assert (height, width) == (13, 24)


def shown(cells, turns, mirrored):
    return np.ascontiguousarray(np.rot90(cells[:, ::-1] if mirrored else cells, turns))


@st.composite
def routes(draw):
    free = np.ones(draw(st.tuples(st.integers(3, 9), st.integers(3, 12))), np.bool_)
    cells = np.argwhere(free).tolist()
    for row, column in draw(st.lists(st.sampled_from(cells), max_size=30)):
        free[row, column] = (row, column) == (0, 0)
    free = part_around(free, (0, 0))
    resolution_m = draw(st.sampled_from([0.4, 1.0]))
    regions = qualrl.segment(OccupancyGrid.from_free(free, resolution_m))
    ends = [tuple(draw(st.sampled_from(np.argwhere(free).tolist()))) for _ in range(2)]
    return regions, ends


@settings(deadline=None, max_examples=60)
@given(routes())
def test_passages_follow_the_path_and_landmarks_their_cells(drawn):
    regions, (start, goal) = drawn
    walk = walk_between(regions, f"{start[0]},{start[1]}", f"{goal[0]},{goal[1]}")
    path = [tuple(cell) for cell in walk.route.path.tolist()]
    assert (path[0], path[-1]) == (start, goal)
    names = [at.region for at in walk.passages]
    entered = [regions.region_names[regions.label[cell]] for cell in path]
    assert names[0] == entered[0]
    assert names[-1] == entered[-1]
    joined = {door.name: {regions.region_names[side] for side in door.pair} for door in regions.doorways}
    for here, there in zip(walk.passages, walk.passages[1:], strict=False):
        assert here.left_by == there.entered_by
        assert joined[here.left_by] == {here.region, there.region}
    assert sum(at.steps for at in walk.passages) == len(path) - 1
    reach = max(REACH_M / regions.grid.resolution_m, 1)
    expected = {}
    for mark in regions.landmarks:
        own = [step for step, cell in enumerate(path) if regions.label[cell] in mark.regions]
        away = [min(math.dist(path[step], cell) for cell in mark.cells.tolist()) for step in own]
        if own and min(away) <= reach + 1e-9:
            expected[mark.name] = own[away.index(min(away))]
    marks = walk.space.marks
    assert {mark.name: mark.step for mark in marks if mark.kind not in ("start", "goal")} == expected
    assert [mark.step for mark in marks] == sorted(mark.step for mark in marks)
    assert (marks[0].kind, marks[-1].kind) == ("start", "goal")
    for step in range(len(path)):
        here = walk.space.position(step)
        at = [mark.name for mark in marks if mark.step == step]
        if at:
            assert here == (" = ".join(at),)
        else:
            before, after = ({mark.step for mark in marks if mark.name in side.split(" = ")} for side in here)
            assert max(before) < step < min(after)
            assert not any(max(before) < mark.step < min(after) for mark in marks)


def test_a_position_is_a_landmark_or_between_two():
    marks = [("home", "start", 0), ("door 1", "doorway", 4), ("corner 2", "corner", 4), ("lab", "goal", 6)]
    space = QuantitySpace(tuple(Mark(*mark) for mark in marks))
    told = [space.position(step) for step in (0, 3, 4, 5, 6)]
    assert told == [
        ("home",), ("home", "door 1 = corner 2"), ("door 1 = corner 2",), ("door 1 = corner 2", "lab"), ("lab",)
    ]  # fmt: skip


def test_every_number_of_the_sentences_stands_in_the_json():
    regions = qualrl.segment(grid_of(CORRIDOR, 0.5))
    zone = np.zeros(regions.grid.shape, np.bool_)
    zone[2:4, 2:4] = True
    answer = describe(Relations(regions, [Zone("dock", zone)]), DistanceCuts(4.0, 8.0))
    document = json.loads(json.dumps(answer.to_dict()))
    names = [place["name"] for place in document["places"]]
    assert len(document["relations"]) == len(names) * (len(names) - 1)
    assert answer.explain().splitlines() == document["sentences"]
    (line,) = [line for line in document["sentences"] if line.startswith("dock: ")]
    pairs = {(pair["of"], pair["seen_from"]): pair for pair in document["relations"]}
    (holder,) = [b for a, b in pairs if a == "dock" and pairs[a, b]["rcc8"] in ("TPP", "NTPP")]
    pair = pairs[holder, "dock"]
    words = NOWHERE_BEYOND.get(pair["direction"], pair["direction"])
    assert line == f"dock: {holder} (contains it, {words}, {pair['distance']}, {pair['walk_m']:.1f} m)"
    for line in document["sentences"][2:]:
        seen_from, _, told = line.partition(": ")
        for of, words in re.findall(r"([\w ]+?) \(([^)]*)\)", told):
            pair = pairs[of.strip(), seen_from]
            assert pair["distance"] in words
            assert f"{pair['walk_m']:.1f} m" in words
            assert NOWHERE_BEYOND.get(pair["direction"], pair["direction"]) in words
            assert all(door in words for door in pair["doorways"])


def test_a_direction_that_is_told_is_one_that_holds_as_a_claim():
    """An L around a room's corner lies south of it, but neither south-west nor west for the most part."""
    label = [[1, 0, 0], [1, 0, 0], [1, 1, 1], [1, 1, 1], [-1, 2, 2]]
    relations = Relations(regions_of(label), [])
    answer = describe(relations, DistanceCuts(), of="region 0")
    pairs = {pair["of"]: pair for pair in answer.to_dict()["relations"]}
    assert pairs["region 1"]["shares"] == {"west": 0.25, "south-west": 0.25, "south": 0.5}
    assert pairs["region 1"]["direction"] == "south"
    for name, pair in pairs.items():
        claim = read_statement(f"{name} {pair['direction']} of region 0")
        assert check(relations, [claim], DistanceCuts()).holds
        assert f"{name}: {pair['direction']}, " in answer.explain()
    ring = regions_of([[1, 1, 1], [1, 0, 1], [1, 1, 1]])
    assert "region 1: on several sides, " in describe(Relations(ring), DistanceCuts(), of="region 0").explain()
    assert "region 0: within its bounds, " in describe(Relations(ring), DistanceCuts(), of="region 1").explain()


def test_many_places_are_cut_short_for_people_only():
    label = np.arange(60, dtype=np.int32)[None].repeat(2, axis=0)
    cells = [Region(f"r{n}", "room", 2, 2.0, (0.5, float(n)), (0, n)) for n in range(60)]
    grid = OccupancyGrid(label >= 0, label < 0, 1.0, (0.0, 0.0, math.pi / 2))
    answer = describe(Relations(RegionMap(grid, label, tuple(cells), (), ())), DistanceCuts())
    lines = answer.explain().splitlines()
    assert len(lines) == MOST_LINES + 3
    assert lines[0] == "North is where y of the map's frame grows, turned by 90 degrees in the image."
    assert lines[2] == "r0: joined to nothing"
    assert lines[-1] == "and 20 more places (--json lists all)"
    assert len(answer.to_dict()["relations"]) == 60 * 59
    only = describe(Relations(answer.relations.regions), DistanceCuts(), of="r3")
    assert "r5: north, near, 2.0 m" in only.explain()
    assert {pair["seen_from"] for pair in only.to_dict()["relations"]} == {"r3"}
    with pytest.raises(UnknownNameError, match="did you mean 'r3'"):
        describe(answer.relations, DistanceCuts(), of="r 3")


def test_the_command_describes_and_refuses(tmp_path):
    draw(tmp_path, "rooms", CORRIDOR)
    (tmp_path / "rooms.scenario.yaml").write_text("map: rooms.yaml\ngoal: [2, 3]\n")
    document = json.loads(qualrl_command("describe", "rooms.yaml", "--json", cwd=tmp_path)[0])
    assert qualrl_command("describe", "rooms.scenario.yaml", cwd=tmp_path)[0].splitlines() == document["sentences"]
    told, _ = qualrl_command("describe", "rooms.yaml", "--from", "2,3", "--to", "2,20", cwd=tmp_path)
    assert "lies to the left" in told
    assert "through it, you turn back compared with how you came in" in told
    route = json.loads(
        qualrl_command("describe", "rooms.yaml", "--from", "2,3", "--to", "2,20", "--json", cwd=tmp_path)[0]
    )["route"]
    assert f"From 2,3 to 2,20: {route['length_m']:.2f} m." in told
    for at in route["passages"]:
        assert f"{at['length_m']:.2f} m" in told
    for mark in route["landmarks"]:
        assert mark["kind"] == "centre" or f"{mark['name']} at {mark['at_m']:.2f} m" in told
    from_door = "--from", "door 1", "--to", "2,20"
    told = qualrl_command("describe", "rooms.yaml", *from_door, cwd=tmp_path)[0].partition("On the way")[2]
    assert told.count("door 1 at 0.00 m") == told.count("door 1") == 1
    for wrong in (["--from", "2,3"], ["--of", "room A", "--from", "2,3", "--to", "2,20"]):
        _, error = qualrl_command("describe", "rooms.yaml", *wrong, cwd=tmp_path, expect=2)
        assert error == "qualrl: say either --of NAME, or both --from PLACE and --to PLACE, or none of them\n"
    _, error = qualrl_command("describe", "rooms.yaml", "--of", "rom A", cwd=tmp_path, expect=2)
    assert "did you mean 'room A'?" in error


def test_what_no_way_leads_to_is_far_and_pockets_are_told_when_asked_for():
    regions = qualrl.segment(grid_of("#######\n#.#...#\n#.#...#\n#.#...#\n#######"))
    room, pocket = regions.region_names
    assert [place["name"] for place in describe(regions.relations, DistanceCuts()).to_dict()["places"]] == [room]
    answer = describe(regions.relations, DistanceCuts(), of=pocket)
    assert answer.explain().splitlines()[-1] == f"{room}: east, far, no way"
    (pair,) = answer.to_dict()["relations"]
    assert (pair["walk_m"], pair["distance"], pair["rcc8"]) == (None, "far", "DC")
