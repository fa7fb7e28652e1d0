"""Why a goal cannot be reached: against networkx, and every radius and threshold tried one by one."""

import json

import cv2
import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.depth import Depth
from qualrl.errors import MapError, SettingError
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.report.blocked_map import COLOURS, NAMES, colours_of
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import grid_of

FREE, WALL, UNKNOWN = range(3)
MAPPED = settings(deadline=None, max_examples=40)
HALVES = """
#########
#...#...#
#...#...#
#...#...#
#########
"""
NARROW = """
#################
#.......#.......#
#.......#.......#
#...............#
#.......#.......#
#.......#.......#
#################
"""


@st.composite
def blocked_maps(draw, radii=(0.0,), apart=True):
    """(kind of each cell, start, goal, radius in cells, directions), the goal beyond what is in the way."""
    radius = draw(st.sampled_from(radii))
    side = 6 if radius == 0 else 9
    height, width = draw(st.integers(side - 3, side)), draw(st.integers(side - 1, side + 3))
    scattered = [FREE] * 3 + [WALL, UNKNOWN] if radius == 0 else [FREE] * 30 + [WALL, UNKNOWN]
    cells = draw(st.lists(st.sampled_from(scattered), min_size=height * width, max_size=height * width))
    kind = np.array(cells).reshape(height, width)
    if apart:
        barrier = [FREE, WALL] if radius else [WALL, WALL, UNKNOWN]
        kind[:, width // 2] = draw(st.lists(st.sampled_from(barrier), min_size=height, max_size=height))
    graph = graph_of(fitting(kind == FREE, radius))
    assume(graph)
    start = draw(st.sampled_from(sorted(graph)))
    beyond = sorted(set(graph) - (nx.node_connected_component(graph, start) if apart else {start}))
    assume(beyond)
    return kind, start, draw(st.sampled_from(beyond)), radius, draw(st.sampled_from([4, 8]))


def room_of(free, cell):
    """From a cell's middle to the nearest point of what is not free or not on the map, in cells."""
    nearest = [2 * min(cell[axis] + 0.5, free.shape[axis] - cell[axis] - 0.5) for axis in (0, 1)]
    for other in np.argwhere(~free).tolist():
        apart = [max(abs(a - b) - 0.5, 0.0) for a, b in zip(cell, other, strict=True)]
        nearest.append(2 * float(np.hypot(*apart)))
    return min(nearest) / 2


def fitting(free, radius):
    """Where a robot can stand."""
    fits = free.copy()
    for cell in np.argwhere(free).tolist():
        fits[tuple(cell)] = radius == 0 or room_of(free, cell) + 1e-6 >= radius
    return fits


def graph_of(stands, directions=4):
    """Cells on which a robot can stand, and its moves."""
    graph = nx.Graph()
    cells = {tuple(cell) for cell in np.argwhere(stands).tolist()}
    graph.add_nodes_from(cells)
    for row, column in cells:
        for beside in ((row + 1, column), (row, column + 1)):
            if beside in cells:
                graph.add_edge((row, column), beside)
        for side in (-1, 1) if directions == 8 else ():
            ends = {(row + 1, column + side), (row + 1, column), (row, column + side)}
            if ends <= cells:
                graph.add_edge((row, column), (row + 1, column + side))
    return graph


def connects(stands, start, goal):
    return bool(stands[start] and stands[goal] and nx.has_path(graph_of(stands), start, goal))


def steps_of(stands, start, goal, directions):
    return nx.shortest_path_length(graph_of(stands, directions), start, goal)


def asked(case):
    """The model of a small map, and the answer."""
    kind, start, goal, radius, directions = case
    grid = OccupancyGrid(kind == FREE, kind == WALL, 1.0)
    regions = qualrl.segment(grid, radius_m=radius)
    model = qualrl.build(regions, list(goal), start=list(start), directions=directions)
    return model, qualrl.questions.why_unreachable(model)


def openings_of(answer):
    return {opening.kind: opening for opening in answer.openings}


@MAPPED
@given(blocked_maps(radii=(0.0, 0.9, 1.5), apart=False) | blocked_maps(radii=(0.0, 0.9)))
def test_parts_are_the_components_and_a_reachable_goal_is_told(case):
    kind, start, goal, radius, directions = case
    model, answer = asked(case)
    graph = graph_of(fitting(kind == FREE, radius))
    for part, end in zip(answer.parts, (start, goal), strict=False):
        expected = nx.node_connected_component(graph, end)
        assert {tuple(cell) for cell in np.argwhere(part.mask).tolist()} == expected
        assert part.cells == len(expected)
        assert set(part.regions) == {model.region_names[model.regions.label[cell]] for cell in expected}
    assert answer.is_reachable == nx.has_path(graph, start, goal)
    assert len(answer.parts) == (1 if answer.is_reachable else 2)
    if answer.is_reachable:
        assert answer.steps == steps_of(fitting(kind == FREE, radius), start, goal, directions)
        assert (answer.way[0], answer.way[-1]) == (start, goal)


@MAPPED
@given(blocked_maps(radii=(0.0, 0.9, 1.5)))
def test_no_way_has_fewer_cells_in_the_way_and_each_is_of_its_kind(case):
    kind, start, goal, radius, _ = case
    _, answer = asked(case)
    stands = fitting(kind == FREE, radius)
    graph = nx.DiGraph(graph_of(fitting(np.ones_like(stands), radius)))
    weights = {(a, b): 1000 * int(not stands[b]) + int(kind[b] != FREE) for a, b in graph.edges}
    nx.set_edge_attributes(graph, weights, "weight")
    assert nx.is_path(graph, answer.way)
    assert (answer.way[0], answer.way[-1]) == (start, goal)
    blocked = [cell for cell in answer.way if not stands[cell]]
    least = nx.shortest_path_length(graph, start, goal, weight="weight")
    assert (len(blocked), sum(kind[cell] != FREE for cell in blocked)) == divmod(least, 1000)
    assert [cell for place in answer.crossings for cell in place.cells] == blocked
    assert (answer.obstacle.wall, answer.obstacle.unknown, answer.obstacle.tight) == tuple(
        sum(kind[cell] == of for cell in blocked) for of in (WALL, UNKNOWN, FREE)
    )
    assert answer.obstacle.total == sum(place.kinds.total for place in answer.crossings) > 0


@MAPPED
@given(blocked_maps(radii=(0.0, 0.9, 1.5)))
def test_what_is_cleared_opens_a_way_in_the_map_segmented_anew(case):
    kind, start, goal, radius, directions = case
    model, answer = asked(case)
    opening = openings_of(answer)["clearing"]
    free = kind == FREE
    assert not any(free[cell] for cell in opening.cells)
    assert opening.cleared.total == len(set(opening.cells))
    for cell in opening.cells:
        free[cell] = True
    assert opening.steps == steps_of(fitting(free, radius), start, goal, directions)
    regions = qualrl.segment(OccupancyGrid.from_free(free), radius_m=radius)
    again = qualrl.build(regions, list(goal), start=list(start), directions=directions)
    assert again.grid.steps_to_goal[again.start] == opening.steps
    if radius == 0:
        assert set(opening.cells) == {cell for place in answer.crossings for cell in place.cells}
    assert model.grid.steps_to_goal[model.start] == -1


@MAPPED
@given(blocked_maps(radii=(0.8, 1.2, 1.5, 2.0)))
def test_the_radius_is_the_largest_of_all_that_could_matter(case):
    kind, start, goal, radius, directions = case
    free = kind == FREE
    _, answer = asked(case)
    rooms = sorted({room_of(free, cell) for cell in np.argwhere(free).tolist()})
    opening = [room for room in rooms if room + 1e-6 < radius and connects(fitting(free, room), start, goal)]
    found = openings_of(answer).get("radius")
    assert (found is None) == (not opening)
    assert ("A smaller robot would not get there either." in answer.notes) == (not opening)
    if found is not None:
        assert found.clearance_cells == pytest.approx(max(opening), abs=1e-5)
        assert found.radius_m <= max(opening) + 1e-5
        assert found.radius_m > max(opening) * 0.999
        assert room_of(free, found.narrowest.at) == pytest.approx(max(opening), abs=1e-5)
        assert found.steps == steps_of(fitting(free, found.radius_m), start, goal, directions)


def written(folder, grey, **changed):
    """A ROS map of an image, and its scenario."""
    said = {"occupied_thresh": 0.65, "free_thresh": 0.196, "negate": 0, "mode": "trinary"} | changed
    cv2.imwrite(str(folder / "m.png"), grey)
    lines = [f"{key}: {value}\n" for key, value in said.items()]
    (folder / "m.yaml").write_text("image: m.png\nresolution: 1.0\norigin: [0.0, 0.0, 0.0]\n" + "".join(lines))


GREYS = [255, 254, 254, 230, 206, 205, 204, 150, 90, 89, 30, 1, 0]


@settings(deadline=None, max_examples=50)
@given(st.data(), st.sampled_from([0.0, 0.0, 1.0]), st.booleans())
def test_thresholds_are_the_least_of_all_values_of_the_image(tmp_path_factory, data, radius, negate):
    folder = tmp_path_factory.mktemp("thresholds")
    height, width = data.draw(st.integers(2, 7)), data.draw(st.integers(3, 9))
    row = st.lists(st.sampled_from(GREYS), min_size=width, max_size=width)
    grey = np.array(data.draw(st.lists(row, min_size=height, max_size=height)), np.uint8)
    grey[:, [0, 1, -2, -1]] = np.maximum(grey[:, [0, 1, -2, -1]], 206 * (radius > 0))
    p = np.float32(1) - grey.astype(np.float32) / np.float32(255)
    free = p <= np.float32(0.196)
    graph = graph_of(fitting(free, radius))
    assume(graph)
    start = data.draw(st.sampled_from(sorted(graph)))
    beyond = sorted(set(graph) - nx.node_connected_component(graph, start))
    assume(beyond)
    goal = data.draw(st.sampled_from(beyond))
    if negate:
        grey = 255 - grey
        p = grey.astype(np.float32) / np.float32(255)
        assume(np.array_equal(free, p <= np.float32(0.196)))
    written(folder, grey, negate=int(negate))
    regions = qualrl.segment(qualrl.read_map(folder / "m.yaml"), radius_m=radius)
    answer = qualrl.questions.why_unreachable(qualrl.build(regions, list(goal), start=list(start)))
    opening = [value for value in np.unique(p[p < 1]) if connects(fitting(p <= value, radius), start, goal)]
    found = openings_of(answer).get("thresholds")
    scaled = fitting((p <= np.float32(0.196)) | ((p - 0.196) / (0.65 - 0.196) < 0.005), radius)
    if not opening:
        assert found is None
        assert answer.notes[-1].startswith("No threshold below 1")
        return
    least = p <= opening[0]
    keys = [key for key, *_ in found.settings]
    if connects(scaled, start, goal) and keys == ["mode"]:
        assert found.freed.total < np.count_nonzero(least & ~free)
        return
    then = {key: after for key, _, after in found.settings}
    assert keys == ["free_thresh", "occupied_thresh"][: len(keys)]
    assert (len(keys) == 2) == (then["free_thresh"] >= 0.65)
    assert found.freed.total == np.count_nonzero(least & ~free)
    assert found.freed.wall == np.count_nonzero(least & (p >= np.float32(0.65)))
    assert found.freed_on_way.total == sum(not free[cell] for cell in found.way)
    written(folder, grey, negate=int(negate), **then)
    again = qualrl.read_map(folder / "m.yaml")
    np.testing.assert_array_equal(again.free, least)
    model = qualrl.build(qualrl.segment(again, radius_m=radius), list(goal), start=list(start))
    assert model.grid.steps_to_goal[model.start] == found.steps


WALLED = np.array([[254, 254, 205, 120, 254, 254]] * 3, np.uint8)


@pytest.mark.parametrize(
    ("changed", "settings_then"),
    [
        ({}, {"free_thresh": 0.53}),
        ({"occupied_thresh": 0.4}, {"free_thresh": 0.53, "occupied_thresh": 0.54}),
        ({"mode": "scale"}, {"free_thresh": 0.53}),
        ({"free_thresh": -1, "mode": "raw", "occupied_thresh": 0.9}, None),
    ],
)
def test_thresholds_in_each_mode(tmp_path, changed, settings_then):
    image = WALLED.copy()
    if changed.get("mode") == "raw":
        image = np.where(image == 254, 0, 100).astype(np.uint8)
    written(tmp_path, image, **changed)
    regions = qualrl.segment(qualrl.read_map(tmp_path / "m.yaml"))
    answer = qualrl.questions.why_unreachable(qualrl.build(regions, [0, 5], start=[0, 0]))
    found = openings_of(answer).get("thresholds")
    assert (found and {key: then for key, _, then in found.settings}) == settings_then
    if found and found.freed.unknown:
        assert "Careful: the map does not know" in found.in_words(Depth.NUMBERS)
    assert (found is None) == (answer.notes != ())


def test_another_mode_is_told_where_it_opens_a_way(tmp_path):
    written(tmp_path, np.array([[0, 0, 1, 0, 0]] * 2, np.uint8), mode="raw", negate=1)
    regions = qualrl.segment(qualrl.read_map(tmp_path / "m.yaml"))
    found = openings_of(qualrl.questions.why_unreachable(qualrl.build(regions, [0, 4], start=[0, 0])))["thresholds"]
    assert found.settings == (("mode", "raw", "trinary"),)
    assert found.freed.total == 2


def test_a_map_read_by_older_rules_is_read_by_them_again(tmp_path):
    written(tmp_path, WALLED)
    regions = qualrl.segment(qualrl.read_map(tmp_path / "m.yaml", dialect="humble"))
    found = openings_of(qualrl.questions.why_unreachable(qualrl.build(regions, [0, 5], start=[0, 0])))["thresholds"]
    written(tmp_path, WALLED, free_thresh=found.settings[0][2])
    assert qualrl.read_map(tmp_path / "m.yaml", dialect="humble").free.all()


def test_without_its_file_as_it_was_a_map_has_no_thresholds(tmp_path):
    grid = grid_of(HALVES)
    notes = qualrl.questions.why_unreachable(qualrl.build(qualrl.segment(grid), [1, 7], start=[1, 1])).notes
    assert notes == ("The thresholds of the map were not tried: it was made in memory.",)
    written(tmp_path, WALLED)
    model = qualrl.build(qualrl.segment(qualrl.read_map(tmp_path / "m.yaml")), [0, 5], start=[0, 0])
    written(tmp_path, 255 - WALLED)
    assert "m.yaml has changed since it was read." in qualrl.questions.why_unreachable(model).notes[0]
    (tmp_path / "m.png").unlink()
    assert "no such file" in qualrl.questions.why_unreachable(model).notes[0]
    (tmp_path / "a.map").write_text("type octile\nheight 1\nwidth 3\nmap\n.@.\n")
    other = qualrl.build(qualrl.segment(qualrl.read_map(tmp_path / "a.map")), [0, 2], start=[0, 0])
    assert "is no ROS map or image" in qualrl.questions.why_unreachable(other).notes[0]


def test_an_image_alone_is_read_with_the_usual_thresholds(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), WALLED)
    model = qualrl.build(qualrl.segment(qualrl.read_map(tmp_path / "a.png")), [0, 5], start=[0, 0])
    assert openings_of(qualrl.questions.why_unreachable(model))["thresholds"].settings[0] == (
        "free_thresh",
        0.196,
        0.53,
    )


@pytest.mark.parametrize("directions", [4, 8])
def test_closed_doorways_are_named_and_as_few_as_can_be_are_opened(directions):
    regions = qualrl.segment(grid_of(LOOP))
    model = qualrl.build(regions, [2, 24], start=[2, 2], directions=directions)
    closed = model.with_closed([door.name for door in regions.doorways])
    answer = qualrl.questions.why_unreachable(closed)
    opening = openings_of(answer)["doorways"]
    pairs = {door.name: door.pair for door in regions.doorways}
    ends = [int(model.region_of[state]) for state in (model.start, model.grid.goal)]
    graph = nx.Graph(pairs.values())
    assert len(opening.doors) == nx.shortest_path_length(graph, *ends) > 1
    assert [place.door for place in answer.crossings] == list(opening.doors)
    left = model.with_closed([name for name in pairs if name not in opening.doors])
    assert left.grid.steps_to_goal[left.start] == opening.steps
    assert "clearing" not in openings_of(answer)
    assert f"{len(opening.doors)} closed doorways, in {len(opening.doors)} places:" in answer.explain()


def test_a_single_closed_doorway_is_named_where_it_is():
    model = qualrl.build(qualrl.segment(grid_of(NARROW)), [2, 12], start=[2, 2]).with_closed(["door 1"])
    answer = qualrl.questions.why_unreachable(model)
    line = "In the way at least: 1 closed doorway, door 1, between room A and room B at row 3, column"
    assert answer.explain().splitlines()[3].startswith(line)
    assert openings_of(answer)["doorways"].brief() == "door 1 opened"


def test_a_closed_doorway_beyond_a_wall_is_opened_with_it():
    regions = qualrl.segment(
        grid_of("#########\n#.#.....#\n#.#.....#\n#.#.....#\n####.####\n#.......#\n#.......#\n#########")
    )
    (door,) = regions.doorways
    model = qualrl.build(regions, [6, 6], start=[1, 1]).with_closed([door.name])
    answer = qualrl.questions.why_unreachable(model)
    opening = openings_of(answer)["clearing"]
    told = [place.door for place in answer.crossings if place.door is not None]
    assert opening.doors == tuple(told)
    assert opening.steps > 0
    assert answer.obstacle.wall == 1


def test_a_robot_that_would_stick_out_of_the_map_is_given_no_way_along_its_edge():
    free = np.ones((7, 15), bool)
    free[2:, 7] = False  # the gap is two cells high, and beyond the map's edge nothing is free
    grid = OccupancyGrid.from_free(free)
    answer = qualrl.questions.why_unreachable(qualrl.build(qualrl.segment(grid, radius_m=1.5), [4, 12], start=[4, 2]))
    assert all(1 <= row < 6 for row, _ in answer.way)
    assert openings_of(answer)["radius"].radius_m == 0.5


def test_models_without_a_map_or_a_start_are_refused():
    table = TabularMDP.from_outcomes({0: {0: [(1.0, 1, 1.0, True)]}, 1: {0: [(1.0, 1, 0.0, True)]}}, gamma=0.9)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.why_unreachable(qualrl.HybridMDP.from_table(table, ["a", "b"], start=0))
    with pytest.raises(SettingError, match="say where to start"):
        qualrl.questions.why_unreachable(qualrl.build(qualrl.segment(grid_of(HALVES)), [1, 7]))
    with pytest.raises(TypeError, match="needs a HybridMDP"):
        qualrl.questions.why_unreachable("office")
    with pytest.raises(MapError, match="fits nowhere"):
        qualrl.segment(grid_of(HALVES), radius_m=9.0)


def scenario(folder, text, more="", **changed):
    draw(folder, "rooms", text)
    (folder / "rooms.scenario.yaml").write_text(f"map: rooms.yaml\nstart: [2, 2]\ngoal: [2, 12]\n{more}")


def test_the_answer_says_what_its_fields_hold(tmp_path):
    scenario(tmp_path, NARROW, "radius_m: 1.4\n")
    out = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--json", cwd=tmp_path, expect=1)[0]
    document = json.loads(out)
    told = qualrl_command("why-unreachable", "rooms.scenario.yaml", cwd=tmp_path, expect=1)[0].splitlines()
    assert told == document["sentences"]
    assert told[0] == f"No way leads from {document['from']} to {document['to']}."
    for part, line in zip(document["parts"], told[1:], strict=False):
        assert line.endswith(f"{', '.join(part['regions'])} ({part['cells']} cells, {part['area_m2']:.2f} m2).")
    (place,) = document["crossings"]
    row, column = place["at"]
    x_m, y_m = place["at_m"]
    assert [x_m, y_m] == [1 + column + 0.5, 2 + 7 - row - 0.5]
    assert place["at"] in place["cells"]
    assert told[3] == (
        f"In the way at least: {document['obstacle']['tight']} cells too tight for the robot, between "
        f"{' and '.join(place['between'])} at row {row}, column {column} (x {x_m:.2f} m, y {y_m:.2f} m)."
    )
    radius, clearing = document["openings"]
    assert told[5].startswith(f"- radius_m {radius['radius_m']:g} instead of {radius['radius_now_m']:g}")
    assert told[5].endswith(f"takes {radius['steps']} steps.")
    assert f"{clearing['cleared']['wall']} wall cells cleared; " in told[6]
    assert told[6].endswith(f"takes {clearing['steps']} steps.")
    assert radius["radius_m"] == 0.5
    assert len(told) == 7 + len(document["notes"])


def test_what_the_command_proposes_opens_a_way_when_done(tmp_path):
    scenario(tmp_path, NARROW, "radius_m: 1.4\n")
    out = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--json", cwd=tmp_path, expect=1)[0]
    radius, clearing = json.loads(out)["openings"]
    smaller = f"radius_m={radius['radius_m']}"
    done = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--set", smaller, "--json", cwd=tmp_path)[0]
    assert json.loads(done)["steps"] == radius["steps"]
    assert json.loads(done)["reachable"]
    image = cv2.imread(str(tmp_path / "rooms.png"), cv2.IMREAD_GRAYSCALE)
    for row, column in clearing["cells"]:
        image[row, column] = 254
    cv2.imwrite(str(tmp_path / "rooms.png"), image)
    done = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--json", cwd=tmp_path)[0]
    assert json.loads(done)["steps"] == clearing["steps"]


def test_the_picture_comes_whole_or_not_at_all(tmp_path):
    scenario(tmp_path, NARROW, "radius_m: 1.4\n")
    out, _ = qualrl_command("why-unreachable", "rooms.scenario.yaml", "-o", "out", cwd=tmp_path, expect=1)
    assert out.endswith("The picture is out/why_unreachable.png.\n")
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["why_unreachable.json", "why_unreachable.png"]
    assert cv2.imread(str(tmp_path / "out" / "why_unreachable.png")).std() > 0
    document = json.loads((tmp_path / "out" / "why_unreachable.json").read_text())
    assert document["sentences"] == out.splitlines()[:-1]
    before = sorted(tmp_path.iterdir())
    _, err = qualrl_command("why-unreachable", "rooms.scenario.yaml", "-o", "rooms.png", cwd=tmp_path, expect=2)
    assert "is a file" in err
    _, err = qualrl_command(
        "why-unreachable", "rooms.scenario.yaml", "-o", "new", "--set", "goal=[0, 0]", cwd=tmp_path, expect=2
    )
    assert "in a wall; the nearest free cell is" in err
    assert sorted(tmp_path.iterdir()) == before
    qualrl_command("why-unreachable", "rooms.scenario.yaml", "-o", "out", "--set", "radius_m=0", "-q", cwd=tmp_path)
    assert json.loads((tmp_path / "out" / "why_unreachable.json").read_text())["reachable"]


def test_colours_are_those_of_parts_and_of_what_is_in_the_way():
    regions = qualrl.segment(grid_of(NARROW), radius_m=1.4)
    answer = qualrl.questions.why_unreachable(qualrl.build(regions, [2, 12], start=[2, 2]))
    index = colours_of(regions, answer)
    named = {name: {tuple(cell) for cell in np.argwhere(index == NAMES.index(name)).tolist()} for name in COLOURS}
    assert named["in the way"] == {cell for place in answer.crossings for cell in place.cells}
    assert named["to be cleared"] == set(openings_of(answer)["clearing"].cells) - named["in the way"]
    for name, part in zip(("start's part", "goal's part"), answer.parts, strict=True):
        assert named[name] == {tuple(cell) for cell in np.argwhere(part.mask).tolist()}
    assert named["unknown"] == named["freed by the threshold"] == set()


def test_refusals_point_to_the_question(tmp_path):
    scenario(tmp_path, HALVES.replace("#...#...#", "#......#......#").replace("#########", "#" * 15))
    for command in (["run", "-o", "out"], ["which-matters"], ["plan"]):
        _, err = qualrl_command(command[0], "rooms.scenario.yaml", *command[1:], cwd=tmp_path, expect=1)
        assert "'qualrl why-unreachable' tells what is in the way" in err
    out, _ = qualrl_command("why-unreachable", "rooms.scenario.yaml", cwd=tmp_path, expect=1)
    assert "a doorway through the wall between room A and room B, 1 cell (1.00 m) thick: 1 wall cell cleared" in out


def test_changes_while_learning_are_left_aside(tmp_path):
    changes = "changes: [{after: 5, close: door 1}]\n"
    scenario(tmp_path, NARROW, changes)
    _, err = qualrl_command("plan", "rooms.scenario.yaml", cwd=tmp_path, expect=1)
    assert "leave a way open" in err
    out, _ = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--from", "room A", cwd=tmp_path)
    assert out.startswith("row 2, column 12 in room B can be reached from room A: the shortest way takes")
    out, _ = qualrl_command("why-unreachable", "rooms.scenario.yaml", "--set", "motion.slip=0.1", cwd=tmp_path)
    assert out.endswith("at least, as moves slip.\n")
