"""What may happen on the way: against plans from every cell, and against chances carried on step by step."""

import json
from itertools import product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import envision as questions
from qualrl.answers.answer import likelihood
from qualrl.answers.depth import Depth
from qualrl.answers.envision import GOAL, START
from qualrl.answers.policy import best_policy
from qualrl.errors import NoPlanError, SettingError
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import exact_values
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_robust import RING
from tests.test_robust_slip import values_of
from tests.test_what_if import crossed
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
DOORS = [door.name for door in REGIONS.doorways]
ENDS = st.tuples(st.sampled_from(CELLS), st.sampled_from(CELLS)).filter(lambda ends: ends[0] != ends[1])


def cells_of(model, state):
    region, door = state
    if door == START:
        return [model.start]
    side = REGIONS.doorways[door].pair.index(region)
    return sorted({int(model.grid.state_of[pair[side]]) for pair in crossings_of(REGIONS, REGIONS.doorways[door])})


def chances_step_by_step(model, moves, state, regions=REGIONS):
    """Probability to leave a state's region by each doorway (GOAL: to end in it), carried on until nothing is left."""
    world, region = model.grid, int(model.region_of[state])
    door_of = {
        frozenset(int(world.state_of[cell]) for cell in pair): at
        for at, door in enumerate(regions.doorways)
        for pair in crossings_of(regions, door)
    }
    at, found = np.zeros(len(world)), {}
    at[state] = 1.0
    if state == world.goal:
        return {GOAL: 1.0}
    while at.sum() > 1e-10:
        after = np.zeros(len(world))
        for here in np.flatnonzero(at):
            for move, there in enumerate(world.successor[here].tolist()):
                share = at[here] * (1 - world.slip if move == moves[here] else world.slip / (world.n_actions - 1))
                if model.region_of[there] != region:
                    key = door_of[frozenset((int(here), there))]
                    found[key] = found.get(key, 0.0) + share
                elif there == world.goal:
                    found[GOAL] = found.get(GOAL, 0.0) + share
                else:
                    after[there] += share
        at = after
    return found


@settings(deadline=None, max_examples=12)
@given(ENDS, st.sampled_from([0.15, 0.4]))
def test_branches_of_slippery_ways_are_those_of_chances_carried_on(ends, slip):
    model = qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.95, slip=slip)
    answer = qualrl.questions.envision(model)
    moves = best_policy(model, exact_values(model.world))
    for state, branches in list(answer.branches.items())[:4]:
        each = [chances_step_by_step(model, moves, cell) for cell in cells_of(model, state)]
        keys = {GOAL if branch.to is None else branch.to[1]: branch for branch in branches}
        possible = {key for found in each for key, of in found.items() if of > 1e-9}
        assert possible <= set(keys)
        for key, branch in keys.items():
            found = [of.get(key, 0.0) for of in each]
            assert branch.least == pytest.approx(min(found), abs=1e-7)
            assert branch.most == pytest.approx(max(found), abs=1e-7)


def walkable_exits(model, state):
    """Doorways out of a state's region (GOAL for the goal in it) that some walk in the region comes to."""
    world, region = model.grid, int(model.region_of[state])
    door_of = {
        frozenset(int(world.state_of[cell]) for cell in pair): at
        for at, door in enumerate(REGIONS.doorways)
        for pair in crossings_of(REGIONS, door)
    }
    if state == world.goal:
        return {GOAL}
    seen, stack, found = {state}, [state], set()
    while stack:
        here = stack.pop()
        for there in map(int, world.successor[here]):
            if there == world.goal and model.region_of[there] == region:
                found.add(GOAL)
            elif model.region_of[there] != region:
                found.add(door_of[frozenset((here, there))])
            elif there not in seen:
                seen.add(there)
                stack.append(there)
    return found


@settings(deadline=None, max_examples=25)
@given(ENDS, st.sampled_from([1e-13, 0.001, 0.3]))
def test_only_what_no_walk_can_avoid_is_certain_and_only_what_none_can_do_impossible(ends, slip):
    model = qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.95, slip=slip)
    answer = qualrl.questions.envision(model)
    for state, branches in answer.branches.items():
        each = [walkable_exits(model, cell) for cell in cells_of(model, state)]
        for branch in branches:
            key = GOAL if branch.to is None else branch.to[1]
            assert (branch.least == 1) == all(found == {key} for found in each)
            assert (branch.most == 1) == any(found == {key} for found in each)
            assert (branch.least == 0) == any(key not in found for found in each)
            assert any(key in found for found in each)
    words = dict(zip(answer.branches, answer.explain("signs").splitlines()[1:], strict=False))
    for state, line in words.items():
        assert ("(certain)" in line) == any(branch.least == 1 for branch in answer.branches[state])
        assert "impossible" not in line
    assert not any(line.endswith(": impossible") for line in answer.explain("signs").splitlines())


@pytest.mark.parametrize(
    ("bounds", "told", "words"),
    [
        ((1.0, 1.0), "certain", "surely"),
        ((1 - 7e-15, 1 - 7e-15), "almost certain", "almost 1"),
        ((0.999999, 0.999999), "almost certain", "0.999999"),
        ((0.96, 1.0), "likely", "0.96 to 1"),
        ((0.0, 1.0), "possible", "0 to 1"),
        ((0.5, 0.5 + 1e-9), "possible", "0.5"),
        ((0.0, 5.85e-14), "almost impossible", "0 to 5.85e-14"),
        ((0.0, 0.0), "impossible", "0"),
    ],
)
def test_bounds_in_words(bounds, told, words):
    assert likelihood(*bounds) == told
    assert questions._bounds(*bounds, Depth.NUMBERS) == words


def shortest_ways(model, cell):
    """The doorways of each shortest way from a cell to the goal."""
    graph = nx.Graph()
    for here, there in ((a, int(b)) for a, ends in enumerate(model.grid.successor) for b in ends if a != int(b)):
        graph.add_edge(here, there)
    paths = nx.all_shortest_paths(graph, cell, model.grid.goal)
    return {tuple(crossed(model, [model.cell_of(at) for at in path])) for path in paths}


def test_of_two_ways_that_are_as_good_neither_is_sure():
    regions = qualrl.segment(grid_of(RING))
    model = qualrl.build(regions, [9, 19], start=[1, 1], gamma=0.95)
    answer = qualrl.questions.envision(model)
    start, *_ = answer.branches.values()
    assert [(of.least, of.most) for of in start] == [(0.0, 1.0), (0.0, 1.0)]
    assert len(answer.courses) == 2
    assert all((course.least, course.most) == (0.0, 1.0) for course in answer.courses)
    assert "surely" not in answer.explain().splitlines()[1]
    assert "certain" not in answer.explain("signs").splitlines()[1]


@pytest.mark.parametrize("slip", [0.1, 0.3])
def test_where_moves_slip_all_moves_that_are_as_good_are_branches(slip):
    """A map like its mirror image along the diagonal: against every choice among moves that are as good."""
    free = np.zeros((11, 11), bool)
    free[1:10, 1:10] = True
    free[5, :] = free[:, 5] = False
    for ends in ((2, 5), (5, 2), (8, 5), (5, 8)):
        free[ends] = True
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    model = qualrl.build(regions, [9, 9], start=[1, 1], gamma=0.95, slip=slip)
    world, home = model.grid, model.region_of[model.start]
    value = values_of(world, [slip], np.min)
    worth = np.where(world.successor == world.goal, world.goal_reward, -1 + world.gamma * value[world.successor])
    worth = (1 - slip) * worth + slip * (worth.sum(axis=1, keepdims=True) - worth) / 3
    good = worth >= worth.max(axis=1, keepdims=True) - 1e-9
    inside = [state for state in range(len(model)) if model.region_of[state] == home]
    assert 2 <= sum(good[state].sum() > 1 for state in inside) <= 8
    found = []
    for moves in product(*(np.flatnonzero(good[state]) for state in inside)):
        chosen = dict(zip(inside, moves, strict=True))
        found.append(chances_step_by_step(model, chosen, model.start, regions))
    answer = qualrl.questions.envision(model)
    for branch in answer.branches[int(home), START]:
        each = [of[branch.to[1]] for of in found]
        assert branch.least == pytest.approx(min(each), abs=1e-7)
        assert branch.most == pytest.approx(max(each), abs=1e-7)
        assert branch.most - branch.least > 0.1
    assert len(answer.branches[int(home), START]) == 2
    one, other = answer.branches[int(home), START]
    assert (one.least, one.most) == pytest.approx((other.least, other.most))


@settings(deadline=None, max_examples=25)
@given(ENDS)
def test_without_slips_branches_are_what_plans_do(ends):
    model = qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.95)
    answer = qualrl.questions.envision(model)
    for state, branches in answer.branches.items():
        taken = []
        for cell in cells_of(model, state):
            if cell == model.grid.goal:
                taken.append(None)
                continue
            doors = crossed(model, qualrl.plan(model, start=list(model.cell_of(cell))).path)
            taken.append(doors[0] if doors else None)
        doors = {branch.door for branch in branches}
        assert doors >= set(taken)
        assert {(of.least, of.most) for of in branches} == {(1.0 if len(doors) == 1 else 0.0, 1.0)}
        ways = [way for cell in cells_of(model, state) for way in shortest_ways(model, cell)]
        assert doors <= {way[0] if way else None for way in ways}
        assert doors >= {way[0] if way else None for way in ways if len(way) == min(map(len, ways))}
    (likeliest, *_) = answer.courses
    assert likeliest.most == 1.0
    plan = qualrl.plan(model)
    assert [model.region_names[region] for region, _ in likeliest.states][:1] == [plan.places[0]]


@settings(deadline=None, max_examples=25)
@given(ENDS, st.sampled_from([0.0, 0.3]))
def test_bounds_hold_together(ends, slip):
    model = qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.95, slip=slip)
    answer = qualrl.questions.envision(model)
    for branches in answer.branches.values():
        assert sum(branch.least for branch in branches) <= 1 + 1e-9
        assert sum(branch.most for branch in branches) >= 1 - 1e-9
        assert all(branch.to is None or branch.to in answer.branches for branch in branches)
    assert len(answer.branches) <= answer.of_all
    assert answer.has_all_courses
    for course in answer.courses:
        assert len(set(course.states)) == len(course.states)
        assert 0 <= course.least <= course.most <= 1
    if slip:
        assert sum(course.least for course in answer.courses) <= 1 + 1e-9
        document = json.loads(json.dumps(answer.to_dict()))
        assert len(document["states"]) == len(answer.branches)


def test_a_slippery_way_is_simulated():
    """How often walks take the likeliest course lies between its bounds."""
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95, slip=0.2)
    answer = qualrl.questions.envision(model)
    moves, world = best_policy(model, exact_values(model.world)), model.grid
    course = answer.courses[0]
    wanted = [region for region, _ in course.states]
    generator, taken, n_walks = np.random.default_rng(1), 0, 2000
    for _ in range(n_walks):
        state, passed = model.start, [int(model.region_of[model.start])]
        while state != world.goal:
            move = moves[state]
            if generator.random() < world.slip:
                move = generator.choice([other for other in range(4) if other != move])
            state = int(world.successor[state, move])
            if model.region_of[state] != passed[-1]:
                passed.append(int(model.region_of[state]))
        taken += passed == wanted
    spread = 4 * np.sqrt(0.25 / n_walks)
    assert course.least - spread <= taken / n_walks <= course.most + spread


def test_what_is_too_large_or_leads_nowhere_is_refused(monkeypatch):
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95, slip=0.2)
    monkeypatch.setattr(questions, "MOST_CELLS", 5)
    with pytest.raises(SettingError, match="more than the 5"):
        qualrl.questions.envision(model)
    with pytest.raises(NoPlanError):
        qualrl.questions.envision(model.with_closed(DOORS))
    with pytest.raises(NoPlanError, match="fades"):
        qualrl.questions.envision(qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=1e-200))
    table = qualrl.HybridMDP.from_table(model.grid.table(), ["all"] * len(model), start=model.start)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.envision(table)


def test_the_command_answers(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    asked = "envision", "loop.scenario.yaml", "--set", "motion.slip=0.2"
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    assert qualrl_command(*asked, cwd=tmp_path)[0].splitlines() == document["sentences"]
    assert document["states"][0]["entered_by"] is None
    assert all(branch["least"] <= branch["most"] for state in document["states"] for branch in state["branches"])
