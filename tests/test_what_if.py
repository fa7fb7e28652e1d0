"""What a change does to a plan: against the changed world built by hand, networkx, and sums of rewards."""

import json
from fractions import Fraction
from itertools import pairwise

import mpmath
import networkx as nx
import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.qualitative.break_even import BreakEven
from qualrl.qualitative.graph import crossings_of
from qualrl.qualitative.plan_value import Chance, Course, Stretch, contrast
from qualrl.solving.exact import exact_values
from qualrl.spatial.passage import thinnest_passages, with_passage
from tests.certificates import check_signs
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_why_not import COURSES
from tests.worlds import TWO_ROOMS, free_masks, grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
APART = "#.....#" + "#" * (len(LOOP.split()[0]) - 7) + "\n" + LOOP.split()[-1] + "\n"
"""A room below that no doorway leads to."""
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
GAMMAS = st.integers(1, 999).map(lambda thousandths: Fraction(thousandths, 1000))


def worth(course, gamma):
    """The value of a course in exact fractions, reward by reward."""
    rewards = [Fraction(stretch.reward) for stretch in course.stretches for _ in range(stretch.steps)]
    return sum((reward * gamma**t for t, reward in enumerate(rewards)), Fraction(0))


def steps_graph(model):
    return nx.from_edgelist((s, int(t)) for s in range(len(model)) for t in model.grid.successor[s])


@settings(deadline=None, max_examples=100)
@given(COURSES, COURSES, COURSES, GAMMAS)
def test_at_the_break_even_trying_is_worth_as_much_as_going_round(opened, closed, around, gamma):
    found = BreakEven(opened, closed, around)
    a, b, c = (worth(course, gamma) for course in (opened, closed, around))
    if a == b:
        assert found.at(float(gamma)) is None or found.at(float(gamma)) == pytest.approx(float((c - b) / (a - b)))
        return
    exact = (c - b) / (a - b)
    assume(abs(exact) < 1e6)  # else gamma itself, no float, tells too little
    assert found.at(float(gamma)) == pytest.approx(float(exact), rel=1e-6, abs=1e-9)
    assert found.formula().subs("gamma", sympy.Rational(gamma)) == sympy.Rational(exact)


@settings(deadline=None, max_examples=60)
@given(COURSES, COURSES, COURSES, st.sampled_from([0.001, 0.3, 0.97]))
def test_what_trying_is_worth_more_than_going_round(opened, closed, around, gamma):
    opened, closed, around = (Course((Stretch("start", 60, -1.0), *of.stretches)) for of in (opened, closed, around))
    found = BreakEven(opened, closed, around)
    exact = Fraction(gamma)
    for more, sign, way in zip(found.more_than_round(gamma), found.signs_at(gamma), (opened, closed), strict=True):
        wanted = worth(way, exact) - worth(around, exact)
        assert abs(Fraction(more) - wanted) <= abs(wanted) * Fraction(1, 10**40)
        assert sign == (wanted > 0) - (wanted < 0)


def test_where_six_digits_tell_nothing_trying_is_set_beside_going_round():
    model = qualrl.build(REGIONS, (1, 20), start=(1, 1), gamma=0.3)
    doors = crossed(model, qualrl.plan(model).path)
    answer = qualrl.questions.what_if(model, close=doors[:1], chance=0.5)
    values, more = answer.trying.values, answer.to_dict()["trying"]["more_than_round"]
    assert len({f"{of:.6g}" for of in values.values()}) == 1
    ways = answer.trying.break_even
    seen, unseen = (worth(way, Fraction(0.3)) - worth(ways.round, Fraction(0.3)) for way in (ways.open, ways.closed))
    assert unseen < 0 < seen
    assert [float(of) for of in more.values()] == pytest.approx([float(seen), float(unseen)], rel=1e-12)
    told = f"{float(seen):.3g} more than going round if it is, {-float(unseen):.3g} less than going round if it is not"
    assert told in answer.explain()


@settings(deadline=None, max_examples=60)
@given(COURSES, COURSES, COURSES)
def test_the_limit_is_where_the_formula_tends_to(opened, closed, around):
    found = BreakEven(opened, closed, around)
    with mpmath.workdps(120):
        gamma = 1 - mpmath.mpf(10) ** -30
        a, b, c = (
            mpmath.fsum(
                mpmath.mpf(stretch.reward) * gamma**t
                for t, stretch in enumerate(part for part in course.stretches for _ in range(part.steps))
            )
            for course in (opened, closed, around)
        )
        if found.limit is None:
            assert a == b or abs((c - b) / (a - b)) > 1e20
        else:
            assert abs((c - b) / (a - b) - mpmath.mpf(found.limit.numerator) / found.limit.denominator) < 1e-20


@settings(deadline=None, max_examples=60)
@given(COURSES, COURSES, COURSES, st.sampled_from([0.0, 0.25, 0.3, 1.0]), GAMMAS)
def test_a_chance_is_worth_what_its_ways_are_on_average(first, second, other, likely, gamma):
    chance = Chance(likely, first, second)
    p = Fraction(likely)
    mean = p * worth(first, gamma) + (1 - p) * worth(second, gamma)
    assert chance.value(float(gamma)) == pytest.approx(float(mean), abs=1e-9)
    assert chance.formula().subs("gamma", sympy.Rational(gamma)) == sympy.Rational(mean)
    found = contrast(chance, other)
    powers = set(chance.terms()) | set(other.terms())
    whole = {k: int((chance.terms().get(k, 0) - other.terms().get(k, 0)) * found.scale) for k in powers}
    check_signs(json.loads(json.dumps(found.signs.certificate())), whole)
    difference = mean - worth(other, gamma)
    for verdict in found.verdicts:
        if verdict.low < float(gamma) < verdict.high:
            assert (difference > 0) - (difference < 0) == verdict.sign


def test_two_corridors_and_a_door():
    """The lab is 11 steps shorter than the corridor if its door is open, and costs 8 steps there and back if not."""
    opened, around = Course((Stretch("lab", 30, -1.0),)), Course((Stretch("corridor", 40, -1.0),))
    closed = Course((Stretch("lab", 4, -1.0), Stretch("corridor", 44, -1.0)))
    found = BreakEven(opened, closed, around)
    assert found.limit == Fraction(8, 18)
    assert found.at(1 - 1e-9) == pytest.approx(8 / 18, abs=1e-6)
    assert found.grows.in_words("open", "closed") == "for every gamma in (0, 1) open is worth more: proved"


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS), st.sampled_from([door.name for door in REGIONS.doorways]))
def test_closing_a_doorway_does_what_closing_it_by_hand_does(start, goal, door):
    assume(start != goal)
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.97)
    by_hand = model.with_closed([door])
    answer = qualrl.questions.what_if(model, close=door)
    assert answer.before.value == pytest.approx(exact_values(model.world).value[model.start])
    if by_hand.grid.steps_to_goal[model.start] < 0:
        assert answer.after is None
        assert "no way leads" in answer.explain()
        return
    assert answer.after.value == pytest.approx(exact_values(by_hand.world).value[model.start])
    assert answer.after.steps == by_hand.grid.steps_to_goal[model.start]
    assert answer.switch is None
    assert (answer.trying is None) == (door not in crossed(model, qualrl.plan(model).path))


def crossed(model, path):
    """The doorways that a path over cells passes, in its order."""
    door_of = {frozenset(ends): door.name for door in REGIONS.doorways for ends in crossings_of(REGIONS, door)}
    return [door_of[frozenset(ends)] for ends in pairwise(path) if frozenset(ends) in door_of]


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS))
def test_trying_is_to_go_there_and_from_there_round_as_is_cheapest(start, goal):
    assume(start != goal)
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.97)
    path = qualrl.plan(model).path
    doors = crossed(model, path)
    assume(doors)
    answer = qualrl.questions.what_if(model, close=doors, chance=0.3)
    assume(answer.after)
    found, walk = answer.trying, [int(model.grid.state_of[cell]) for cell in path]
    closed = steps_graph(model.with_closed(doors))
    opened, target = steps_graph(model), model.grid.goal
    from_start, back = (nx.single_source_shortest_path_length(closed, of) for of in (model.start, target))
    onward = nx.single_source_shortest_path_length(opened, target)

    def value(steps):
        return -(1 - 0.97 ** (steps - 1)) / (1 - 0.97) + 100 * 0.97 ** (steps - 1)

    tries = {
        (from_start[here] + 1 + onward[there], from_start[here] + back[here])
        for here, there in set(opened.to_directed().edges) - set(closed.to_directed().edges)
        if here in from_start and here != target
    }
    around = value(from_start[target])
    probabilities = {
        (around - value(shut)) / (value(seen) - value(shut)): (seen, shut) for seen, shut in tries if seen < shut
    }
    there = next(at for at in range(len(walk) - 1) if not closed.has_edge(walk[at], walk[at + 1]))
    if min(probabilities, default=1) > 1 - 1e-9 and len(walk) - 1 == there + back[walk[there]]:
        assert found.break_even.at(0.97) is None
        assert "makes no difference" in answer.explain()
        return
    p = min(probabilities)
    assert 0 <= p <= 1 + 1e-9
    assert found.break_even.at(0.97) == pytest.approx(p, abs=1e-6)
    assert found.values["round"] == pytest.approx(around)
    gain = found.values["open"] - found.values["closed"]
    assert (found.values["round"] - found.values["closed"]) / gain == pytest.approx(p, abs=1e-6)
    assert any(value(steps) == pytest.approx(found.values["open"]) for steps, _ in tries)
    better = [of for of in found.contrast.verdicts if of.low < 0.97 < of.high]
    assert all(of.sign == (0 if p == 0.3 else 1 if p < 0.3 else -1) for of in better)


@settings(deadline=None, max_examples=60)
@given(free_masks(side=9, connected=False))
def test_passages_are_the_thinnest_and_join_two_regions_and_nothing_else(free):
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    for one in range(len(regions.regions)):
        for other in range(one + 1, len(regions.regions)):
            found = thinnest_passages(regions, one, other)
            expected = passages_by_hand(regions.label, one, other)
            fewest = min(map(len, expected), default=0)
            assert {of.cells for of in found} == {cells for cells in expected if len(cells) == fewest}
            for passage in found[:2]:
                opened, name = with_passage(regions, passage)
                assert opened.regions[one].cells == (opened.label == one).sum()
                assert doors_between(opened) == steps_between(opened)
                assert name in opened.all_names
                assert name not in regions.all_names


def passages_by_hand(label, one, other):
    """Straight runs of walls between a cell of each region, with walls on both sides, cell by cell."""
    free = np.pad(label >= 0, 1)
    found = set()
    for row, column in np.argwhere(label == one).tolist():
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            r, c, cells = row + down, column + right, []
            while 0 <= r < label.shape[0] and 0 <= c < label.shape[1] and label[r, c] < 0:
                cells.append((r, c))
                r, c = r + down, c + right
            beside = [(r + side * right, c + side * down) for r, c in cells for side in (-1, 1)]
            inside = 0 <= r < label.shape[0] and 0 <= c < label.shape[1]
            if cells and inside and label[r, c] == other and not any(free[a + 1, b + 1] for a, b in beside):
                found.add(tuple(sorted(cells)))
    return found


def steps_between(regions):
    """All steps between cells of two regions."""
    cells = [tuple(cell) for cell in np.argwhere(regions.label >= 0).tolist()]
    label = {cell: int(regions.label[cell]) for cell in cells}
    beside = [(a, (a[0] + down, a[1] + right)) for a in cells for down, right in ((0, 1), (1, 0))]
    return {frozenset(ends) for ends in beside if ends[1] in label and label[ends[0]] != label[ends[1]]}


def doors_between(regions):
    return {frozenset(ends) for door in regions.doorways for ends in crossings_of(regions, door)}


def test_the_cells_that_are_left_otherwise_are_those_whose_plans_leave_by_another_doorway():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    door = qualrl.questions.what_if(model, slip=0.0).before.doors[0]
    changed = model.with_closed([door])
    expected: dict[str, int] = {}
    for cell in CELLS:
        if cell != (2, 24):
            ways = [crossed(of, qualrl.plan(of, start=list(cell)).path) for of in (model, changed)]
            if first_or_none(ways[0]) != first_or_none(ways[1]):
                name = REGIONS.region_names[REGIONS.label[cell]]
                expected[name] = expected.get(name, 0) + 1
    answer = qualrl.questions.what_if(model, close=door)
    assert {turned.region: turned.cells for turned in answer.turned} == expected
    assert expected
    assert sum(turned.of for turned in answer.turned) <= len(CELLS)
    assert all(turned.cut_off == 0 for turned in answer.turned)


def first_or_none(doors):
    return doors[0] if doors else None


def test_a_wall_is_opened_where_the_way_is_best():
    regions = qualrl.segment(grid_of(LOOP))
    model = qualrl.build(regions, [2, 24], start=[2, 2], gamma=0.97)
    names = [model.region_names[regions.label[cell]] for cell in ((2, 12), (2, 24))]
    answer = qualrl.questions.what_if(model, open=tuple(names))
    assert answer.before.steps == 26
    assert answer.after.steps == 24  # up to row 4 for the first wall still
    assert "passage 1" in answer.after.doors
    assert "passage 1 opened from" in answer.explain()
    assert qualrl.questions.what_if(model, open=tuple(names[::-1])).after.steps == 24


@pytest.mark.parametrize(
    ("start", "goal", "changes"),
    [((9, 3), (2, 24), {"gamma": 0.5}), ((9, 3), (2, 24), {"goal_reward": 0.0}), ((1, 7), (8, 24), {"slip": 0.4})],
)
def test_a_number_changes_the_way_where_it_is_said_to(start, goal, changes):
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.95, directions=8)
    answer = qualrl.questions.what_if(model, **changes)
    ((name, to),) = changes.items()
    first = getattr(model.grid, name)
    assert answer.switch.name == name
    assert abs(answer.switch.same - answer.switch.other) <= 1e-4 * abs(to - first)
    settings_of = {"gamma": 0.95, "directions": 8}
    places = [
        qualrl.plan(
            qualrl.build(REGIONS, list(goal), start=list(start), **(settings_of | {name: number}))
        ).places
        for number in (first, answer.switch.same, answer.switch.other, to)
    ]  # fmt: skip
    assert places[0] == places[1] == answer.before.places
    assert places[2] != places[0]
    assert places[3] == answer.after.places != places[0]
    if name == "gamma":
        signs = {
            gamma: [of.sign for of in answer.contrast.verdicts if of.low < gamma < of.high] for gamma in (first, to)
        }
        assert signs == {first: [1], to: [-1]}
    else:
        assert answer.contrast is None


def test_what_changes_nothing_says_so():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    answer = qualrl.questions.what_if(model, slip=0.0)
    assert answer.is_same_way
    assert "the same way" in answer.explain()
    assert answer.switch is None


@pytest.mark.parametrize("changes", [{"slip": 0.1}, {"gamma": 0.9}, {"directions": 8}, {"close": "door 1"}])
def test_where_no_way_leads_it_says_what_stays_out_of_reach(changes):
    regions = qualrl.segment(grid_of(LOOP + APART))
    model = qualrl.build(regions, [2, 24], start=[len(LOOP.split()), 2], gamma=0.97)
    answer = qualrl.questions.what_if(model, **changes)
    assert answer.before is None
    assert answer.after is None
    assert answer.switch is None
    shut = model.with_closed([changes["close"]]) if "close" in changes else model
    before, after = (len(nx.node_connected_component(steps_graph(of), model.grid.goal)) for of in (model, shut))
    assert [(of.arriving, of.cells) for of in answer.reach] == [(before, len(model)), (after, len(model))]
    told = answer.explain().splitlines()
    assert told[0].endswith("no way leads there.")
    assert f"still no way leads from {answer.start} to {answer.goal}." in told[1]
    assert f"can be reached from {after} of {len(model)} cells with that" in told[2]
    assert "'qualrl why-unreachable' tells" in told[2]
    assert not any(character.isdigit() for character in answer.explain("signs").splitlines()[2])


def test_what_cannot_be_asked_is_refused():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.97)
    room = model.region_names[0]
    for asked, error, words in (
        ({}, SettingError, "say what to change"),
        ({"close": "door 99"}, UnknownNameError, "no doorway or region is called 'door 99'"),
        ({"open": (room, "kitchen")}, UnknownNameError, "no region is called 'kitchen'"),
        ({"open": (room, room)}, SettingError, "the same region"),
        ({"slip": 2.0}, SettingError, "slip must be"),
        ({"slope": 2.0}, SettingError, "no number of a model is called 'slope'"),
        ({"chance": 0.5}, SettingError, "of doorways to close"),
        ({"chance": 1.5, "close": "door 1"}, SettingError, "from 0 to 1"),
    ):
        with pytest.raises(error, match=words):
            qualrl.questions.what_if(model, **asked)
    one_wall = qualrl.segment(grid_of("#####\n#...#\n###.#\n#...#\n#####"))
    if len(one_wall.regions) > 1:
        with pytest.raises(NoPlanError):
            qualrl.questions.what_if(qualrl.build(one_wall, [1, 1], start=[3, 1]), open=one_wall.region_names[:2])
    table = qualrl.HybridMDP.from_table(model.grid.table(), ["all"] * len(model), start=model.start)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.what_if(table, close="door 1")


def test_the_command_answers_and_refuses(tmp_path):
    draw(tmp_path, "rooms", TWO_ROOMS)
    (tmp_path / "rooms.scenario.yaml").write_text("map: rooms.yaml\nstart: [2, 2]\ngoal: [2, 15]\n")
    ask = "what-if", "rooms.scenario.yaml"
    said = qualrl_command(*ask, "--close", "door 1", "--chance", "0.5", cwd=tmp_path)[0]
    assert "no way leads" in said
    assert "From 57 cells no way is left: 57 of 57 in room A." in said
    assert "no question: no way leads round" in said
    document = json.loads(qualrl_command(*ask, "--open", "room A,room B", "--json", cwd=tmp_path)[0])
    assert document["after"]["steps"] == 13 < document["before"]["steps"] == 17
    said = qualrl_command(*ask, "--open", "room A,room B", cwd=tmp_path)[0]
    assert said.splitlines() == document["sentences"]
    document = json.loads(qualrl_command(*ask, "--slip", "0.2", "--set", "reward.goal=9", "--json", cwd=tmp_path)[0])
    assert document["changes"] == ["reward.goal=9", "motion.slip=0.2"]
    assert document["after"]["value"] < document["before"]["value"]
    for asked, words in (
        (("--close", "door 9"), "no doorway or region is called 'door 9'"),
        (("--slip", "2"), "--slip"),
        (("--open", "room A"), "name two regions with a comma between"),
        (("--set", "learn.gama=0.9"), "did you mean"),
        ((), "say what to change"),
    ):
        error = qualrl_command(*ask, *asked, cwd=tmp_path, expect=2)[1]
        assert words in error
        assert error.count("\n") == 1


def test_what_cells_are_left_by_is_compared_by_doorways_not_names_and_only_on_maps_of_one_size(tmp_path):
    draw(tmp_path, "one", TWO_ROOMS)
    draw(tmp_path, "other", "\n".join(row + "#" for row in TWO_ROOMS.strip().splitlines()))
    scenario = tmp_path / "s.yaml"
    scenario.write_text("map: one.yaml\nstart: room A\ngoal: room B\n")
    loaded = qualrl.load_scenario(scenario)

    def told(*settings):
        answer = json.loads(qualrl_command("what-if", scenario, "--json", *settings, cwd=tmp_path)[0])
        return answer["turned"], qualrl_command("what-if", scenario, *settings, cwd=tmp_path)[0]

    (door,) = loaded.build().regions.doorways
    turned, words = told("--set", f"names={{{door.name}: gate}}")
    assert turned == []
    assert "by gate" in words
    assert "From every cell the best way leaves its region as before." in words
    turned, words = told("--set", "map=other.yaml")
    assert turned is None
    assert "as before" not in words
    assert "of another size" in words


def test_where_a_wall_is_opened_and_nothing_gained_it_is_not_said_that_the_way_is_the_old_one():
    answer = qualrl.questions.what_if(qualrl.load_scenario("office").build(), open=("room A", "corridor 1"))
    assert answer.before.doors != answer.after.doors
    assert answer.turned == ()
    assert "the best way leaves its region as before" not in answer.explain()
    assert "From every cell to leave its region as before is as good as any way." in answer.explain()


def test_where_cells_are_lost_it_is_said_what_that_changes(tmp_path):
    draw(
        tmp_path,
        "halls",
        "\n".join(["#" * 15, *["#......#......#"] * 2, "#.............#", *["#......#......#"] * 2, "#" * 15]),
    )
    scenario = tmp_path / "s.yaml"
    scenario.write_text("map: halls.yaml\nstart: [3, 2]\ngoal: [3, 12]\n")
    command = ("what-if", scenario, "--set", "radius_m=1.0")
    answer = json.loads(qualrl_command(*command, "--json", cwd=tmp_path)[0])
    assert answer["after"] is None
    assert answer["is_opened"] is False
    assert sum(of["cut_off"] for of in answer["turned"]) > 0
    assert "no way is left" in qualrl_command(*command, cwd=tmp_path)[0]
