"""Why a plan does not go by a place: against value iteration on (state, stops made), networkx, and sums of rewards."""

import json
import re
from fractions import Fraction

import mpmath
import networkx as nx
import numpy as np
import pytest
import sympy
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import why_not as answers
from qualrl.answers.stops import states_at, way_by
from qualrl.answers.ways import way_of
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.planning.legs import legs_of
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.graph import crossings_of
from qualrl.qualitative.plan_value import Course, Stretch, contrast, course_of
from qualrl.solving.exact import exact_values
from tests.certificates import check_signs
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_reconcile import THREE_ROOMS
from tests.worlds import grid_of, part_around

REWARDS = st.sampled_from([-3.0, -1.0, -0.5, 0.1, 2.0])
COURSES = st.lists(st.builds(Stretch, st.just("a"), st.integers(1, 9), REWARDS), min_size=1, max_size=4).map(
    lambda stretches: Course(tuple(stretches))
)


def values_by(model, stop):
    """(S,) values of the best way to the goal that enters the stop first, by sweeps over two layers."""
    world = model.grid
    other = world.slip / (world.n_actions - 1)
    chance = np.full((world.n_actions, world.n_actions), other)
    np.fill_diagonal(chance, 1 - world.slip)
    layers = np.zeros((2, len(world)))  # still to enter it, and done
    for _ in range(400):
        for layer in (1, 0):
            ends = world.successor.astype(int)
            at_goal = ends == world.goal
            after = np.where(at_goal, 0.0, layers[1][ends])
            paid = np.where(at_goal, world.goal_reward, world.move_reward)
            if layer == 0:
                ends = np.where(at_goal, np.arange(len(world))[:, None], ends)  # the goal is a wall
                after = np.where(np.isin(ends, stop), layers[1][ends], layers[0][ends])
                paid = np.broadcast_to(world.move_reward, ends.shape)
            layers[layer] = ((paid + world.gamma * after) @ chance.T).max(axis=1)
    return np.where(np.isin(np.arange(len(world)), stop), layers[1], layers[0])


def values_through(model, door):
    """(S,) values of the best way to the goal that makes a step through a doorway first."""
    world = model.grid
    chance = np.full((world.n_actions, world.n_actions), world.slip / (world.n_actions - 1))
    np.fill_diagonal(chance, 1 - world.slip)
    ends, own = world.successor.astype(int), np.arange(len(world))[:, None]
    sides = {frozenset(int(world.state_of[cell]) for cell in ends) for ends in crossings_of(model.regions, door)}
    passes = np.array([[frozenset((s, int(t))) in sides for t in row] for s, row in enumerate(ends)])
    at_goal = ends == world.goal
    paid = np.where(at_goal, world.goal_reward, world.move_reward)
    done, still = np.zeros(len(world)), np.full(len(world), -1 / (1 - world.gamma))
    for _ in range(600):
        done = ((paid + world.gamma * np.where(at_goal, 0.0, done[ends])) @ chance.T).max(axis=1)
    for _ in range(600):
        through = paid + world.gamma * np.where(at_goal, 0.0, done[ends])
        before = world.move_reward + world.gamma * still[np.where(at_goal, own, ends)]
        still = (np.where(passes, through, before) @ chance.T).max(axis=1)
        still[world.goal] = -1 / (1 - world.gamma)
    return still


LOOP_REGIONS = qualrl.segment(grid_of(LOOP))
LOOP_CELLS = [tuple(cell) for cell in np.argwhere(LOOP_REGIONS.grid.free).tolist()]


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_REGIONS.doorways),
    st.sampled_from([0.0, 0.2]),
)  # fmt: skip
def test_a_doorway_is_passed_by_a_step_through_it(start, goal, door, slip):
    assume(start != goal)
    model = qualrl.build(LOOP_REGIONS, list(goal), start=list(start), gamma=0.9, slip=slip)
    exact, expected = exact_values(model.world), values_through(model, door)
    try:
        found = way_by(model, exact, model.start, [door.name])
    except NoPlanError:
        assert expected[model.start] == pytest.approx(-10, abs=1e-6)
        return
    assert found.shifted - exact.shift == pytest.approx(expected[model.start], abs=1e-6)
    first, second = (tuple(model.grid.cells[state].tolist()) for state in found.parts[0][-2:])
    assert frozenset((first, second)) in {frozenset(ends) for ends in crossings_of(LOOP_REGIONS, door)}
    answer = qualrl.questions.why_not(model, door.name)
    assert door.name in answer.by.doors or len(found.parts[1]) < 5  # there and back at once is no leg


def model_of(data, directions=4, slip=0.0):
    """A small map with a few walls, and start, goal and the landmark "mark" in different cells of it."""
    free = np.ones(data.draw(st.tuples(st.integers(2, 6), st.integers(3, 6))), np.bool_)
    corner = tuple(np.argwhere(free)[0])
    for row, column in data.draw(st.lists(st.sampled_from(np.argwhere(free).tolist()), max_size=9)):
        free[row, column] = (row, column) == corner
    free = part_around(free, corner)
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 2)
    start, goal, mark = data.draw(st.permutations(cells))[:3]
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    model = qualrl.build(
        regions, list(goal), start=list(start), gamma=0.9, slip=slip, directions=directions,
        landmarks={"mark": list(mark)},
    )  # fmt: skip
    assume(all(door.name != "mark" for door in model.regions.doorways))  # a doorway is passed by steps, not cells
    return model


@settings(deadline=None, max_examples=60)
@given(st.data(), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.2]))
def test_values_by_a_stop_are_those_of_the_layers(data, directions, slip):
    model = model_of(data, directions, slip)
    stop = states_at(model, "mark")
    expected = values_by(model, stop)
    start, exact = model.start, exact_values(model.world)
    try:
        found = way_by(model, exact, start, ["mark"])
    except NoPlanError:
        graph = nx.from_edgelist((s, int(t)) for s in range(len(model)) for t in model.grid.successor[s])
        graph.remove_node(model.grid.goal)
        assert not any(nx.has_path(graph, start, s) for s in stop.tolist())
        return
    assert found.shifted - exact.shift == pytest.approx(expected[start], abs=1e-6)
    assert found.walk[0] == start
    assert found.walk[-1] == model.grid.goal
    assert found.walk.index(model.grid.goal) == len(found.walk) - 1
    assert set(stop.tolist()) & set(found.walk)
    assert all(t in model.grid.successor[s] for s, t in zip(found.walk, found.walk[1:], strict=False))


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_the_way_by_a_stop_is_as_short_as_can_be(data):
    model = model_of(data)
    graph = nx.from_edgelist((s, int(t)) for s in range(len(model)) for t in model.grid.successor[s])
    onward = nx.single_source_shortest_path_length(graph, model.grid.goal)
    graph.remove_node(model.grid.goal)
    before = nx.single_source_shortest_path_length(graph, model.start)
    lengths = [before[s] + onward[s] for s in states_at(model, "mark").tolist() if s in before]
    assume(lengths)
    found = way_by(model, exact_values(model.world), model.start, ["mark"])
    assert len(found.walk) - 1 == min(lengths)


@settings(deadline=None, max_examples=100)
@given(COURSES, COURSES, st.integers(1, 999))
def test_verdicts_and_formulas_are_those_of_the_rewards_added_up(first, second, thousandths):
    found = contrast(first, second)
    whole = {k: int((first.terms().get(k, 0) - second.terms().get(k, 0)) * found.scale) for k in range(60)}
    check_signs(json.loads(json.dumps(found.signs.certificate())), whole)
    gamma = Fraction(thousandths, 1000)
    worth = []
    for course in (first, second):
        rewards = [Fraction(stretch.reward) for stretch in course.stretches for _ in range(stretch.steps)]
        worth.append(sum(reward * gamma**t for t, reward in enumerate(rewards)))
        assert course.value(float(gamma)) == pytest.approx(float(worth[-1]), abs=1e-9)
        assert course.formula().subs("gamma", sympy.Rational(thousandths, 1000)) == sympy.Rational(worth[-1])
    inside = [verdict for verdict in found.verdicts if verdict.low < float(gamma) < verdict.high]
    for verdict in inside:
        assert (worth[0] > worth[1]) - (worth[0] < worth[1]) == verdict.sign


def test_a_corridor_and_a_lab_have_two_thresholds():
    corridor = Course((Stretch("corridor", 39, -1.0), Stretch("corridor", 1, 200.0)))
    lab = Course((Stretch("hall", 22, -1.0), Stretch("lab", 9, -3.0), Stretch("lab", 1, 200.0)))
    found = contrast(corridor, lab)
    assert found.in_words("the corridor", "the lab") == (
        "worth more is the corridor for gamma in (0, 0.680493), the lab for gamma in (0.680493, 0.993064), "
        "the corridor for gamma in (0.993064, 1): proved"
    )
    with mpmath.workdps(50):
        for verdict in found.verdicts:
            gamma = mpmath.mpf(verdict.low + verdict.high) / 2
            worth = [
                sum(
                    mpmath.mpf(reward) * gamma**t
                    for t, reward in enumerate(of.reward for of in course.stretches for _ in range(of.steps))
                )
                for course in (corridor, lab)
            ]
            assert mpmath.sign(worth[0] - worth[1]) == verdict.sign


def test_courses_join_steps_that_are_alike():
    course = course_of(["a", "a", "b", "b"], [-1, -1, -1, 5])
    assert course.stretches == (Stretch("a", 2, -1.0), Stretch("b", 1, -1.0), Stretch("b", 1, 5.0))
    assert course.steps == 4


def test_rewards_that_are_no_numbers_are_refused():
    with pytest.raises(SettingError, match="rewards must be finite"):
        contrast(Course((Stretch("a", 1, float("inf")),)), Course((Stretch("a", 1, 1.0),)))


@pytest.fixture(scope="module")
def loop():
    return qualrl.build(qualrl.segment(grid_of(LOOP)), [2, 24], start=[2, 2], gamma=0.95)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_CELLS), st.sampled_from([4, 8]))
@example((8, 11), (2, 24), 8)
def test_a_way_turns_alike_whether_it_is_told_in_one_part_or_in_two(start, goal, directions):
    model = qualrl.build(LOOP_REGIONS, list(goal), start=list(start), gamma=0.95, directions=directions)
    walk = exact_walk(model, exact_values(model.world), model.start)
    whole = way_of(model, [walk], 0.0)
    for leg in legs_of(model, walk)[1:]:
        parts = way_of(model, [walk[: leg.first + 1], walk[leg.first :]], 0.0)
        if parts.places == whole.places:
            assert (parts.passes, parts.turns) == (whole.passes, whole.turns)


def test_models_without_a_doorway_are_solved_where_the_depth_tells_of_them_alone(loop, monkeypatch):
    solved = []
    monkeypatch.setattr(answers, "exact_values", lambda world: solved.append(world) or exact_values(world))
    answer = qualrl.questions.why_not(loop, "corridor 1")
    answer.explain("names")
    assert len(solved) == 1
    assert "were open seldom enough" in answer.explain("signs")
    assert len(solved) == 1 + len(answer.rather) > 1


@settings(deadline=None, max_examples=25)
@given(st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_REGIONS.region_names))
def test_how_seldom_a_doorway_must_be_open_for_the_way_by_a_stop(start, goal, stop):
    assume(start != goal)
    model = qualrl.build(LOOP_REGIONS, list(goal), start=list(start), gamma=0.95)
    try:
        answer = qualrl.questions.why_not(model, stop)
    except NoPlanError:
        return
    assert {of.door for of in answer.rather} == set(answer.best.doors) - set(answer.by.doors)
    graph = nx.from_edgelist((s, int(t)) for s in range(len(model)) for t in model.grid.successor[s])
    onward = nx.single_source_shortest_path_length(graph, model.grid.goal)

    def value(steps):
        return 120 * 0.95 ** (steps - 1) - 20

    for of in answer.rather:
        shut = nx.from_edgelist(
            (s, int(t)) for s in range(len(model)) for t in model.with_closed([of.door]).grid.successor[s]
        )
        there, back = (nx.single_source_shortest_path_length(shut, at) for at in (model.start, model.grid.goal))
        seen_shut = {
            there[here] + back[here]
            for here, to in set(graph.to_directed().edges) - set(shut.to_directed().edges)
            if here in there and there[here] + 1 + onward[to] == answer.best.steps
        }
        assert of.break_even.closed.steps in seen_shut
        best, closed, by = (value(n) for n in (answer.best.steps, of.break_even.closed.steps, answer.by.steps))
        if of.below is None:
            assert closed >= by - 1e-9
            continue
        assert of.below == pytest.approx((by - closed) / (best - closed), abs=1e-9)
        if not answer.is_by_itself:
            assert f"if {of.door} were open with a probability below {of.below:.4g} at gamma 0.95" in answer.explain()


def doors_of(way):
    """The doorways and the goal of a way in JSON, each with where it lies, how far it is and what is passed."""
    ends = zip([*way["passes"], "the goal"], way["turns"], way["lengths_m"], way["sees"], strict=True)
    return ", ".join(
        f"{name} {turn} in {far_m:.2f} m" + (f" past {' and '.join(seen)}" if seen else "")
        for name, turn, far_m, seen in ends
    )


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(LOOP_CELLS), st.sampled_from(LOOP_CELLS), st.sampled_from([4, 8]), st.data())
def test_stretches_add_up_to_the_way_and_landmarks_are_told_where_the_path_comes_by(start, goal, directions, data):
    assume(start != goal)
    model = qualrl.build(LOOP_REGIONS, list(goal), start=list(start), gamma=0.9, directions=directions)
    stop = data.draw(st.sampled_from([mark.name for mark in LOOP_REGIONS.landmarks if mark.kind == "corner"]))
    try:
        found = way_by(model, exact_values(model.world), model.start, [stop])
    except NoPlanError:
        return
    way = way_of(model, found.parts, found.shifted, stops=found.stops)
    assert len(way.lengths_m) == len(way.sees) == len(way.turns) == len(way.passes) + 1
    assert sum(way.lengths_m) == pytest.approx(way.length_m)
    path = np.array(
        [model.cell_of(state) for part in (found.parts[0], *(part[1:] for part in found.parts[1:])) for state in part]
    )
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    ends, marks = np.cumsum((0.0, *way.lengths_m)), {mark.name: mark for mark in LOOP_REGIONS.landmarks}
    told = [name for names in way.sees for name in names]
    assert len({*told}) == len(told)
    for names, low, high in zip(way.sees, ends, ends[1:], strict=False):
        for name in names:
            away = np.min([np.hypot(*(path - cell).T) for cell in marks[name].cells], axis=0)
            near = walked[away <= 1]  # metres, as cells are 1 m
            assert marks[name].kind != "centre"
            assert ((near >= low - 1e-9) & (near <= high + 1e-9)).any()


def test_a_way_tells_where_to_turn():
    """Down to the corridor, along it to the left as one comes out, and up; by the middle room: in and back out."""
    regions = qualrl.segment(grid_of(THREE_ROOMS))
    model = qualrl.build(regions, [2, 18], start=[2, 3], gamma=0.97)
    answer = qualrl.questions.why_not(model, regions.region_names[regions.label[2, 10]])
    assert answer.best.turns == ("to the south", "to the left", "straight ahead")
    assert answer.by.turns == ("to the south", "to the left", "behind you", "to the left", "straight ahead")
    first, second = answer.best.doors
    assert f"by {first} to the south, {second} to the left, the goal straight ahead)" in answer.explain("names")


def test_a_landmark_to_come_by_is_one_of_the_things_passed():
    """On the corridor's floor, to the right as one comes out of the first door; from there on by the compass."""
    regions = qualrl.segment(grid_of(THREE_ROOMS))
    model = qualrl.build(regions, [2, 18], start=[2, 3], gamma=0.97, landmarks={"mat": [8, 1]})
    answer = qualrl.questions.why_not(model, "mat")
    first, second = answer.by.doors
    assert answer.by.passes == (first, "mat", second)
    assert answer.by.turns == ("to the south", "straight ahead", "to the east", "straight ahead")
    assert f"by {first} to the south, mat straight ahead, {second} to the east, the goal" in answer.explain("names")
    here = qualrl.questions.why_not(qualrl.build(regions, [2, 18], start=[2, 3], landmarks={"mat": [2, 3]}), "mat")
    assert here.by.turns == here.best.turns
    assert here.by.passes == here.best.passes


def test_the_answer_holds_every_number_that_it_says(loop):
    stop = next(name for name in loop.region_names if name not in qualrl.plan(loop).places)
    answer = qualrl.questions.why_not(loop, stop)
    document = json.loads(json.dumps(answer.to_dict()))
    best, by = document["best"], document["by"]
    assert stop in by["places"]
    assert by["steps"] > best["steps"]
    said = " ".join(document["sentences"])
    assert document["costs"] == best["value"] - by["value"]
    for number in (
        f"({best['steps']} steps, {best['length_m']:.2f} m by {doors_of(best)}), worth {best['value']:.6g}.",
        f"({by['steps']} steps, {by['length_m']:.2f} m by {doors_of(by)}), worth {by['value']:.6g}.",
        f"costs {document['costs']:.3g} at gamma {document['gamma']:g}: {by['steps'] - best['steps']} steps more "
        f"and {by['length_m'] - best['length_m']:.2f} m more.",
    ):
        assert number in said
    for way in (best, by):
        gamma, steps = document["gamma"], way["steps"]
        assert way["value"] == pytest.approx(-(1 - gamma ** (steps - 1)) / (1 - gamma) + 100 * gamma ** (steps - 1))
    assert document["contrast"]["decided"]
    assert [of["better"] for of in document["contrast"]["verdicts"]] == ["best"]
    assert "for every gamma in (0, 1) the best way is worth more: proved" in said
    assert not re.search(r"nan|inf\b", said)


def test_stops_are_passed_in_their_order(loop):
    first, second = loop.region_names[:2]
    for order in ([first, second], [second, first]):
        way = way_by(loop, exact_values(loop.world), loop.start, order)
        assert len(way.parts) == 3
        for name, part in zip(order, way.parts, strict=False):
            assert loop.region_names[loop.region_of[part[-1]]] == name


def test_a_stop_on_the_way_costs_nothing(loop):
    answer = qualrl.questions.why_not(loop, qualrl.plan(loop).places[0])
    assert "costs nothing at gamma 0.95" in answer.explain()
    assert answer.best.steps == answer.by.steps


def test_where_moves_slip_other_gammas_are_undecided():
    model = qualrl.build(qualrl.segment(grid_of(LOOP)), [2, 24], start=[2, 2], gamma=0.95, slip=0.1)
    answer = qualrl.questions.why_not(model, model.region_names[-1])
    assert answer.contrast is None
    assert "undecided: moves slip" in answer.explain()
    assert answer.to_dict()["contrast"] is None


def test_what_cannot_be_answered_is_refused(loop):
    with pytest.raises(UnknownNameError, match="no place is called 'kitchen'"):
        qualrl.questions.why_not(loop, "kitchen")
    with pytest.raises(SettingError, match="say by which place"):
        qualrl.questions.why_not(loop, [])
    behind = qualrl.build(
        qualrl.segment(grid_of("#######\n#.....#\n#######")), [1, 4], start=[1, 1], landmarks={"end": [1, 5]}
    )
    with pytest.raises(NoPlanError, match="without passing the goal first"):
        qualrl.questions.why_not(behind, "end")


def test_the_command_answers_and_refuses(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    plan = json.loads(qualrl_command("plan", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])
    places = json.loads(qualrl_command("show", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])["regions"]
    stop = next(region["name"] for region in places if region["name"] not in plan["places"])
    asked = "why-not", "loop.scenario.yaml", "--via", stop
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    assert document["best"]["steps"] == plan["length_steps"]
    assert document["via"] == [stop]
    assert qualrl_command(*asked, cwd=tmp_path)[0].splitlines() == document["sentences"]
    _, error = qualrl_command("why-not", "loop.scenario.yaml", "--via", "nowhere", cwd=tmp_path, expect=2)
    assert error.startswith("qualrl: no place is called 'nowhere'")
    assert error.count("\n") == 1
    _, error = qualrl_command("why-not", "loop.scenario.yaml", cwd=tmp_path, expect=2)
    assert "--via" in error
