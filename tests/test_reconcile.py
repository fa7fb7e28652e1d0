"""What would make an expected plan best: against every set of closed doorways, by networkx's shortest paths."""

import json
from itertools import combinations, pairwise, product

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import reconcile as questions
from qualrl.answers.ways import course
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.solving.exact import exact_values
from qualrl.spatial.place import names_between_commas
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_one_doorway import coming_back
from tests.test_planning import LOOP
from tests.test_robust_slip import iterated
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
DOORS = [door.name for door in REGIONS.doorways]
NEIGHBOURS = nx.Graph(door.pair for door in REGIONS.doorways)


def length(model, closed):
    """Steps of the shortest way with doorways closed; None where there is none."""
    world = model.with_closed(closed).grid
    graph = nx.from_edgelist((s, int(t)) for s in range(len(model)) for t in world.successor[s])
    try:
        return nx.shortest_path_length(graph, model.start, world.goal)
    except nx.NetworkXNoPath:
        return None


def is_best(model, expected, closed):
    """Whether ways along the expected regions alone are as short as any, and pass all of them in their order."""
    pairs = {frozenset(pair) for pair in pairwise(expected)}
    others = [
        door.name for door in REGIONS.doorways if frozenset(REGIONS.region_names[at] for at in door.pair) not in pairs
    ]
    own = length(model, {*others, *closed})
    return own is not None and own == length(model, closed)


@settings(deadline=None, max_examples=25)
@given(st.data())
def test_no_smaller_set_of_closed_doorways_would_do(data):
    start, goal = data.draw(st.sampled_from(CELLS)), data.draw(st.sampled_from(CELLS))
    ends = [int(REGIONS.label[cell]) for cell in (start, goal)]
    assume(ends[0] != ends[1])
    routes = sorted(nx.all_simple_paths(NEIGHBOURS, *ends))
    expected = [REGIONS.region_names[at] for at in data.draw(st.sampled_from(routes))]
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.97)
    try:
        answer = qualrl.questions.reconcile(model, expected)
    except NoPlanError:  # the best way along them still passes one of them for some cells only, or none leads on
        others = [name for name in DOORS if not is_between(name, expected)]
        changed = model.with_closed(others)
        assert not changed.can_reach[model.start] or qualrl.plan(changed).places != tuple(expected)
        return
    assert answer.is_smallest
    assert not answer.opened
    assert is_best(model, expected, answer.closed)
    for fewer in combinations(DOORS, len(answer.closed) - 1) if answer.closed else ():
        if is_best(model, expected, fewer):
            way = qualrl.plan(model.with_closed([name for name in DOORS if not is_between(name, expected)] + [*fewer]))
            assert way.places != tuple(expected)  # it leaves out one of them where it cuts a ragged border


def passes(model, closed, expected):
    """(whether some best way, as it goes if no move slips, passes just the expected regions; whether some does not)."""
    world, region = model.with_closed(closed).grid, model.region_of
    onward = world.successor.astype(int)
    value = iterated(onward, world.move_reward, world.goal, world.goal_reward, world.gamma, [world.slip], np.min)
    worth = np.where(onward == world.goal, world.goal_reward, -1 + world.gamma * value[onward])
    q = (1 - world.slip) * worth + world.slip / 3 * (worth.sum(axis=1, keepdims=True) - worth)
    best = q >= q.max(axis=1, keepdims=True) - 1e-9
    names = [REGIONS.region_names[at] for at in region]
    told, waiting = set(), [(model.start, (names[model.start],))]
    seen = set(waiting)
    while waiting:
        state, places = waiting.pop()
        if state == world.goal:
            told.add(places == tuple(expected))
            continue
        for to in onward[state][best[state]]:
            after = int(to), places if names[to] == places[-1] else (*places, names[to])
            if len(after[1]) > 2 * len(REGIONS.region_names):  # round in circles of ways that are as good
                continue
            if after not in seen:
                seen.add(after)
                waiting.append(after)
    return True in told, False in told


@pytest.mark.no_cover
@settings(deadline=None, max_examples=15)
@given(st.data())
def test_where_moves_slip_no_smaller_set_would_do_either(data):
    start, goal = data.draw(st.sampled_from(CELLS)), data.draw(st.sampled_from(CELLS))
    ends = [int(REGIONS.label[cell]) for cell in (start, goal)]
    assume(ends[0] != ends[1])
    routes = sorted(nx.all_simple_paths(NEIGHBOURS, *ends))
    expected = [REGIONS.region_names[at] for at in data.draw(st.sampled_from(routes))]
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.95, slip=0.15)
    try:
        answer = qualrl.questions.reconcile(model, expected)
    except NoPlanError:
        return
    assert passes(model, answer.closed, expected)[0]
    assert answer.best.places == qualrl.plan(model).places
    if answer.is_smallest:
        for size in range(len(answer.closed)):
            for fewer in combinations(DOORS, size):
                assert not model.with_closed(fewer).can_reach[model.start] or passes(model, fewer, expected)[1]
    else:
        for door in answer.closed:
            assert passes(model, set(answer.closed) - {door}, expected)[1]


def is_between(name, expected):
    door = next(door for door in REGIONS.doorways if door.name == name)
    return {REGIONS.region_names[at] for at in door.pair} in [set(pair) for pair in pairwise(expected)]


def test_walls_are_opened_where_the_plan_needs_it():
    regions = qualrl.segment(grid_of(THREE_ROOMS))
    left, middle, right, corridor = (
        regions.region_names[regions.label[cell]] for cell in ((2, 2), (2, 10), (2, 18), (7, 10))
    )
    model = qualrl.build(regions, [2, 18], start=[2, 2], gamma=0.97)
    answer = qualrl.questions.reconcile(model, [left, middle, right])
    assert len(answer.opened) == 2
    assert answer.closed == ()
    assert answer.own.steps == 16 < answer.best.steps
    assert "It would be best with passage 1 opened" in answer.explain()
    answer = qualrl.questions.reconcile(model, [left, corridor, middle, right])
    assert len(answer.opened) == 1
    assert answer.own.places == (left, corridor, middle, right)


THREE_ROOMS = """
#####################
#......#......#.....#
#......#......#.....#
#......#......#.....#
#......#......#.....#
###.#####.########.##
#...................#
#...................#
#...................#
#####################
"""


def test_the_best_plan_needs_no_change():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    answer = qualrl.questions.reconcile(model, qualrl.plan(model).places)
    assert answer.closed == answer.opened == ()
    assert "best already" in answer.explain()
    assert answer.own == answer.best


def test_where_the_search_ends_too_early_it_does_not_call_its_set_smallest(monkeypatch):
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    names = REGIONS.region_names
    ends = [int(REGIONS.label[cell]) for cell in ((2, 2), (2, 24))]
    longest = max(nx.all_simple_paths(NEIGHBOURS, *ends), key=len)
    expected = [names[at] for at in longest]
    smallest = qualrl.questions.reconcile(model, expected)
    assert smallest.is_smallest
    assert smallest.closed
    monkeypatch.setattr(questions, "MOST_SOLVED", 2)
    found = qualrl.questions.reconcile(model, expected)
    assert not found.is_smallest
    assert "undecided" in found.explain()
    assert is_best(model, expected, found.closed)
    for door in found.closed:
        assert not is_best(model, expected, set(found.closed) - {door})


def test_what_cannot_be_expected_is_refused():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    places = list(qualrl.plan(model).places)
    for asked, error, words in (
        ([], SettingError, "say which regions"),
        (["kitchen"], UnknownNameError, "no region is called 'kitchen'"),
        (places[1:], SettingError, "begins and ends there"),
        ([places[0], places[1], places[0], *places[1:]], SettingError, "twice"),
    ):
        with pytest.raises(error, match=words):
            qualrl.questions.reconcile(model, asked)


def test_the_course_of_no_walk_is_empty():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2])
    assert course(model, [model.start]).steps == 0


def test_the_command_answers_and_refuses(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    places = list(qualrl.plan(qualrl.build(REGIONS, [2, 24], start=[2, 2])).places)
    asked = "reconcile", "loop.scenario.yaml", "--expect", ", ".join([places[0], "corridor 1", places[-1]])
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    assert document["closed"]
    assert document["own"]["places"] == [places[0], "corridor 1", places[-1]]
    assert qualrl_command(*asked, cwd=tmp_path)[0].splitlines() == document["sentences"]
    error = qualrl_command("reconcile", "loop.scenario.yaml", "--expect", "room A,,", cwd=tmp_path, expect=2)[1]
    assert "write names with a comma between" in error
    assert error.count("\n") == 1


def test_names_may_hold_commas(tmp_path):
    draw(tmp_path, "loop", LOOP)
    names = "names: {room A: 'lab, upstairs', room C: 'lab, upstairs, left'}\n"
    (tmp_path / "loop.scenario.yaml").write_text(f"map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n{names}")
    places = json.loads(qualrl_command("plan", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])["places"]
    assert any("," in place for place in places)
    asked = qualrl_command("reconcile", "loop.scenario.yaml", "--expect", ",".join(places), "--json", cwd=tmp_path)
    assert json.loads(asked[0])["own"]["places"] == places
    opened = "lab, upstairs, left ,lab,upstairs"
    document = json.loads(qualrl_command("what-if", "loop.scenario.yaml", "--open", opened, "--json", cwd=tmp_path)[0])
    assert "from lab, upstairs, left to lab, upstairs (" in document["changes"][0]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a, b", ["a", "b"]),
        ("x, y, a", ["x, y", "a"]),
        ("x,y,z", ["x, y, z"]),
        ("x, z", ["x", "z"]),
        ("a, x, y, b", ["a", "x, y", "b"]),
        ("x, y, w", ["x, y", "w"]),  # it is w that is not known
        ("a, 'x', \"y, z\" ,b", ["a", "x", "y, z", "b"]),
        ("cook's, 'a", ["cook's", "'a"]),
    ],
)
def test_names_are_told_apart_by_commas_and_quotes(text, found):
    assert names_between_commas(text, ["a", "b", "x, y", "x, y, z"]) == found


NAMES = st.lists(st.sampled_from(["a", "b", "c", "a, b", "b,c", "a, b, c", "c, a"]), min_size=1, max_size=5)


@given(NAMES, NAMES.map(set).map(sorted))
def test_names_with_commas_are_read_in_the_only_way_or_in_none(asked, known):
    """Against all ways to join what stands between commas."""
    text = ", ".join(asked)
    parts = [part.strip() for part in text.split(",")]
    plain = {name.replace(", ", ","): name for name in known}
    joints = product(",;", repeat=len(parts) - 1)
    joined = ["".join(part + joint for part, joint in zip(parts, [*joint, ""], strict=True)) for joint in joints]
    readings = [[plain.get(name) for name in names.split(";")] for names in joined]
    readings = [names for names in readings if None not in names]
    quoted = ", ".join(f'"{name}"' for name in asked)
    assert names_between_commas(quoted, known) == asked
    if len(readings) == 1:
        assert names_between_commas(text, known) == readings[0]
    elif len(readings) > 1:
        with pytest.raises(SettingError, match="with quotes around each name"):
            names_between_commas(text, known)


def test_what_can_be_read_twice_is_refused_unless_quotes_tell(tmp_path):
    draw(tmp_path, "loop", LOOP)
    places = list(qualrl.plan(qualrl.build(REGIONS, [2, 24], start=[2, 2])).places)
    names = dict(zip(places, ["a", "b", "c"], strict=True)) | {"corridor 1": "a, b"}
    told = ", ".join(f"{place}: '{name}'" for place, name in names.items())
    (tmp_path / "loop.scenario.yaml").write_text(f"map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nnames: {{{told}}}\n")
    asked = "reconcile", "loop.scenario.yaml", "--expect"
    error = qualrl_command(*asked, "a, b, c", cwd=tmp_path, expect=2)[1]
    assert 'can be read as "a", "b", "c" or as "a, b", "c": write it so, with quotes around each name' in error
    assert error.count("\n") == 1
    document = json.loads(qualrl_command(*asked, '"a", "b", "c"', "--json", cwd=tmp_path)[0])
    assert document["own"]["places"] == ["a", "b", "c"]
    assert document["closed"] == []


def test_where_the_way_shown_is_closed_the_one_that_is_left_is_told(monkeypatch):
    model = qualrl.build(coming_back(), [14, 9], start=[14, 1], gamma=0.95)
    # A doorway of the way itself is closed last, so of small maps none makes the search end there by itself.
    monkeypatch.setattr(questions._Search, "closings", lambda search: (frozenset({"door 2"}), True))
    expected = ("corridor 1", "room A", "corridor 2")
    answer = qualrl.questions.reconcile(model, expected)
    assert answer.own.doors[0] == "door 2"
    kept = {"door 1", "opening 1"}
    left = model.with_closed([door.name for door in model.regions.doorways if door.name not in kept])
    assert (answer.then.places, answer.then.doors[0]) == (expected, "door 1")
    assert answer.then.value == pytest.approx(exact_values(left.world).value[left.start])
    assert f"The way there is then another: {' -> '.join(expected)}" in answer.explain()
    assert answer.to_dict()["then"]["doors"] == list(answer.then.doors)
