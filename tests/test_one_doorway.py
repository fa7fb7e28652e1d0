"""Regions left by one doorway: against sweeps over the region alone, breadth-first searches and whole plans."""

from functools import cache

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.policy import moves_as_good
from qualrl.errors import NoPlanError, SettingError
from qualrl.planning.legs import legs_of
from qualrl.planning.on_the_way import SIDES
from qualrl.planning.one_doorway import Room
from qualrl.qualitative.graph import crossings_of
from qualrl.questions import robust, why
from qualrl.solving.exact import exact_values
from tests.room_grids import room_grid
from tests.test_planning import LOOP
from tests.worlds import PUZZLE, grid_of

BENT = """
##############
#..#.....#...#
#..#.....#...#
#............#
#..#.........#
#.##.#####..##
#........#...#
#..#.........#
#........#...#
##############
"""
"""With doorways round a corner, which a diagonal step passes from cell to cell, neither of them beside the doorway."""
RING = """
###############
#.............#
#.###########.#
#.#...#.....#.#
#.#.........#.#
#.#...#.....#.#
#..#..#.....#.#
#.#..##.####..#
#.#.........#.#
#.#.........#.#
#.#...#.......#
#.#.######.##.#
#.....#.....#.#
#.#...#.....#.#
#.#...#.......#
#.#...#.....#.#
#.###########.#
#.###########.#
###############
"""
"""Round the rooms in the middle a corridor, which takes longer from end to end than the rooms do."""
THROUGH_AND_BACK = """
###########
#.........#
#.#######.#
#.#..#....#
#....#....#
#.##....#.#
#.#..#..#.#
#.##.####.#
#.#..#..#.#
#.......#.#
#.##.###..#
#.#..#..#.#
#.......#.#
#.#######.#
#.#######.#
###########
"""
"""From a corridor it is shorter through a room and back into the corridor than along it."""
MAPS = LOOP, PUZZLE, BENT, RING, THROUGH_AND_BACK


@cache
def regions_of(text):
    """Found when a test runs, not when it is collected: that would compile in every worker."""
    return qualrl.segment(grid_of(text))


@cache
def coming_back():
    return qualrl.segment(grid_of(THROUGH_AND_BACK))


def cells_of(regions):
    return [tuple(cell) for cell in np.argwhere(regions.grid.free).tolist()]


@st.composite
def models(draw, texts=MAPS, motions=((4, 0.0), (4, 0.2), (8, 0.0), (8, 0.2))):
    regions = regions_of(draw(st.sampled_from(texts)))
    beside_doors = sorted({cell for door in regions.doorways for ends in crossings_of(regions, door) for cell in ends})
    goal = draw(st.sampled_from(beside_doors) | st.sampled_from(cells_of(regions)))
    start = draw(st.sampled_from(cells_of(regions)))
    assume(start != goal)
    directions, slip = draw(st.sampled_from(motions))
    return qualrl.build(regions, list(goal), start=list(start), gamma=0.95, directions=directions, slip=slip)


def sweeps_through(model, region, door):
    """(S,) values of a region's cells where one doorway is open, or none, but the goal is (door None)."""
    world, ends = model.grid, model.grid.successor.astype(int)
    sides = set() if door is None else {
        frozenset(int(world.state_of[cell]) for cell in pair) for pair in crossings_of(model.regions, door)
    }  # fmt: skip
    passes = np.array([[frozenset((s, t)) in sides for t in row] for s, row in enumerate(ends.tolist())])
    leaves, at_goal = model.region_of[ends] != region, ends == world.goal
    stays = (leaves & ~passes) | (at_goal & ~leaves & (door is not None))
    chance = np.full((world.n_actions, world.n_actions), world.slip / (world.n_actions - 1))
    np.fill_diagonal(chance, 1 - world.slip)
    everywhere = exact_values(world).value
    within = model.region_of == region
    values = np.where(within, -1 / (1 - world.gamma), everywhere)
    own = np.arange(len(world))[:, None]
    for _ in range(700):
        paid = np.where(at_goal & ~stays, world.goal_reward, world.move_reward)
        after = np.where(at_goal & ~stays, 0.0, values[np.where(stays, own, ends)])
        values = np.where(within, ((paid + world.gamma * after) @ chance.T).max(axis=1), everywhere)
    return values


def can_leave(model, region, door):
    """States of a region from which a way leads out by a doorway, not over the goal; door None: a way to the goal."""
    world, graph = model.grid, nx.DiGraph([("out", "out")])
    within = {int(state) for state in np.flatnonzero(model.region_of == region)}
    for state in within - {world.goal} if door is not None else within:
        graph.add_edges_from((int(to), state) for to in world.successor[state] if int(to) in within - {world.goal})
    if door is None:
        graph.add_edges_from(("out", state) for state in within if world.goal in world.successor[state])
    else:
        ends = [tuple(int(world.state_of[cell]) for cell in pair) for pair in crossings_of(model.regions, door)]
        inner = [pair[0] if pair[0] in within else pair[1] for pair in ends]
        outer = [pair[1] if pair[0] in within else pair[0] for pair in ends]
        graph.add_edges_from(
            ("out", state)
            for state, to in zip(inner, outer, strict=True)
            if state != world.goal and world.steps_to_goal[to] >= 0
        )
    return nx.descendants(graph, "out")


def test_no_doorway_that_only_the_goal_leads_to_is_a_way_out():
    """Its value once was that of never arriving, or did not settle."""
    puzzle = qualrl.load_scenario("puzzle").regions()
    model = qualrl.build(puzzle, [2, 6], start=[11, 1], gamma=0.9, slip=0.1)
    answer = robust(model, slip=(0.1, 0.2))
    assert list(answer.worth) == ["staying in corridor 1"]
    for gamma in (0.9, 0.999999):
        model = qualrl.build(puzzle, [2, 6], start=[11, 1], gamma=gamma, slip=0.1, directions=8)
        assert qualrl.plan(model, exact=True).path[-1] == model.cell_of(model.grid.goal)


@settings(deadline=None, max_examples=60)
@given(models(motions=((4, 0.0), (4, 0.2))), st.data())
def test_values_are_those_of_sweeps_over_the_region(model, data):
    door = data.draw(st.sampled_from(model.regions.doorways))
    region = data.draw(st.sampled_from(door.pair))
    goal_here = region == int(model.region_of[model.grid.goal])
    door = data.draw(st.sampled_from([door, None])) if goal_here else door
    exact = exact_values(model.world)
    room = Room.of(model, model.regions, np.flatnonzero(model.region_of == region)).left_by(door)
    found = room.values(exact.shifted, exact.shift, model.grid.slip)
    expected, away = sweeps_through(model, region, door)[room.inside], room.inside != model.grid.goal
    leaves = [state in can_leave(model, region, door) for state in room.inside[away].tolist()]
    np.testing.assert_array_equal(np.isfinite(found[away]), leaves)
    np.testing.assert_allclose(np.where(np.isfinite(found), found, 0.0)[away] - exact.shift, expected[away], atol=1e-5)


@settings(deadline=None, max_examples=60)
@given(models(motions=((4, 0.0), (8, 0.0))))
def test_without_slips_a_step_of_the_exact_plan_is_worth_what_the_rest_of_the_plan_is(model):
    exact, found = exact_values(model.world), qualrl.plan(model)
    states = [int(model.grid.state_of[cell]) for cell in found.path]
    for step, leg in zip(found.steps, legs_of(model, states), strict=True):
        value = exact.value[states[leg.first]]
        assert step.runner_up_value is None or step.runner_up_value <= value + 1e-9
        if step.free_value is not None:  # a diagonal cuts the corner of a region that does not count as passed
            assert model.grid.directions == 8
            assert step.free_value == pytest.approx(value, abs=1e-9)
            assert step.value < step.free_value
            assert f"worth {step.free_value:.6g}; bound to" in step.reason
            assert "slips" not in step.reason
            continue
        assert step.value == pytest.approx(value, abs=1e-9)
        assert step.margin is None or step.margin >= -1e-9


@settings(deadline=None, max_examples=60)
@given(models(texts=(BENT, RING), motions=((8, 0.2), (8, 0.0), (4, 0.2), (4, 0.85), (8, 0.9))))
def test_why_answers_wherever_a_way_leads_to_the_goal(model):
    answer = qualrl.questions.why(model)
    assert answer.best.value == pytest.approx(exact_values(model.world).value[model.start])
    if answer.other is not None and model.grid.slip == 0:  # else doorways shut to slips may be for the other way
        assert answer.other.worth.beside(answer.best.worth) <= 0


def test_another_doorway_that_is_worth_more_because_slips_cannot_pass_the_rest_is_told_so():
    model = qualrl.build(regions_of(BENT), [5, 10], start=[6, 3], gamma=0.95, slip=0.9, directions=8)
    answer = qualrl.questions.why(model)
    more = answer.other.value - answer.best.value
    assert more > 0
    assert f", {more:.3g} more while no slip leads through another doorway." in answer.explain()
    assert f"Counted for the plan, the {-more:.3g} at gamma 0.95 is made up of:" in answer.explain()


@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_staying_in_the_goals_region_is_set_beside_leaving_it(slip):
    regions = regions_of(RING)
    model = qualrl.build(regions, [17, 13], start=[17, 1], gamma=0.95, slip=slip)
    within = nx.grid_2d_graph(*regions.label.shape)
    within = within.subgraph([cell for cell in within if regions.label[cell] == regions.label[17, 1]])
    alone = nx.shortest_path_length(within, (17, 1), (17, 13))
    answer = qualrl.questions.why(model)
    assert answer.best.doors
    assert answer.other_action == f"stay in {model.region_names[regions.label[17, 1]]}"
    assert (answer.other.doors, answer.other.steps) == ((), alone)
    if slip == 0:
        assert answer.other.value == pytest.approx(-(1 - 0.95 ** (alone - 1)) / 0.05 + 100 * 0.95 ** (alone - 1))
    assert sum(entry.difference for entry in answer.entries) == pytest.approx(answer.margin, abs=1e-6)
    step = qualrl.plan(model).steps[0]
    assert step.runner_up == f"staying in {step.place}"
    assert step.runner_up_value == pytest.approx(answer.other.value)


def test_what_cannot_be_told_there_is_refused_in_words():
    model = qualrl.build(regions_of(RING), [17, 13], start=[17, 1], gamma=0.95)
    here = model.region_names[model.region_of[model.start]]
    ways = [door.pair for door in model.regions.doorways if int(model.region_of[model.start]) in door.pair]
    beside = model.region_names[next(end for end in ways[0] if model.region_names[end] != here)]
    with pytest.raises(SettingError, match="no region twice"):
        qualrl.questions.reconcile(model, [here, beside, here])


def test_a_doorway_that_leads_nowhere_is_no_way():
    first, *_, last = cells_of(regions_of(LOOP))
    model = qualrl.build(regions_of(LOOP), list(first), start=list(last), gamma=0.95)
    region = int(model.region_of[model.start])
    doors = [door for door in model.regions.doorways if region in door.pair]
    shut = model.with_closed(door.name for door in doors)
    room = Room.of(shut, regions_of(LOOP), np.flatnonzero(shut.region_of == region)).left_by(doors[0])
    assert not len(room.beyond)
    exact = exact_values(shut.world)
    assert np.isneginf(room.values(exact.shifted, exact.shift, 0.0)).all()
    with pytest.raises(NoPlanError):
        qualrl.questions.why(shut)


def test_what_is_lost_near_gamma_1_is_told_where_it_is_more_than_values_may_be_off():
    regions = regions_of(BENT)
    model = qualrl.build(regions, [1, 1], start=[6, 7], gamma=0.999999, slip=0.001)
    answer = qualrl.questions.which_matters(model)
    told = {loss.name: loss.loss for loss in answer.losses if loss.kind == "doorway" and loss.loss is not None}
    now = exact_values(model.world).value[model.start]
    assert 0 < answer.off < 1e-3
    assert min(told.values()) < 1e-3
    for door in regions.doorways:
        shut = model.with_closed([door.name])
        if shut.can_reach[model.start]:
            lost = now - exact_values(shut.world).value[model.start]
            assert (door.name in told) == (lost > answer.off)
            assert told.get(door.name, lost) == pytest.approx(lost, abs=answer.off)


@pytest.mark.parametrize("directions", [4, 8])
def test_near_gamma_1_moves_are_as_good_only_where_they_are_at_smaller_ones(directions):
    regions, found = regions_of(BENT), []
    for gamma in (0.9999, 0.999999):
        model = qualrl.build(regions, [1, 1], start=[6, 7], gamma=gamma, slip=0.001, directions=directions)
        found.append(moves_as_good(model, exact_values(model.world)))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(("slip", "words"), [(0.0, "exactly as much as"), (0.1, "to within")])
def test_mirrored_doorways_are_worth_as_much_as_far_as_can_be_told(slip, words):
    wall, row, passage = "#" * 17, "#.......#.......#", "#...............#"
    rows = [wall, row, passage, row, row, row, passage, row, wall]
    regions = qualrl.segment(grid_of("\n".join(rows)))
    assert len(regions.doorways) == 2
    model = qualrl.build(regions, [4, 14], start=[4, 2], gamma=0.95, slip=slip)
    assert words in qualrl.plan(model).steps[0].reason


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.data())
def test_a_plan_and_why_tell_the_same_way(seed, data):
    free, _ = room_grid(seed, 3, 5)
    regions = qualrl.segment(qualrl.OccupancyGrid(free, ~free, 1.0))
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    start, goal = (data.draw(st.sampled_from(cells)) for _ in range(2))
    model = qualrl.build(regions, list(goal), start=list(start), gamma=0.95)
    assume(start != goal and model.can_reach[model.start])
    steps, told = qualrl.plan(model).steps, why(model).best
    assert [step.passes for step in steps] == list(told.sees)
    assert [step.length_m for step in steps] == pytest.approx(told.lengths_m)
    turns = [f"to the {step.compass}" if step.compass else step.side and SIDES[step.side] for step in steps]
    assert turns == list(told.turns)


@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_a_doorway_that_the_plan_comes_back_from_is_its_choice(slip):
    model = qualrl.build(coming_back(), [14, 9], start=[14, 1], gamma=0.95, slip=slip)
    plan, answer = qualrl.plan(model), why(model)
    assert plan.places[:3] == answer.best.places[:3] == ("corridor 1", "room B", "corridor 1")
    assert answer.best.value == pytest.approx(exact_values(model.world).value[model.start])
    own, other = (answer.best.doors[0], answer.other.doors[0])
    doors = {door.name: door for door in model.regions.doorways}
    region = int(model.region_of[model.start])
    swept, swept_other = (sweeps_through(model, region, doors[name])[model.start] for name in (own, other))
    assert plan.steps[0].value == pytest.approx(swept, abs=1e-5)
    assert plan.steps[0].runner_up_value == pytest.approx(swept_other, abs=1e-5)
    free = answer.best.value if plan.steps[0].free_value is None else plan.steps[0].free_value
    assert free == pytest.approx(answer.best.value)


def test_the_doorway_of_the_plan_is_compared_while_slips_are_uncertain():
    model = qualrl.build(coming_back(), [14, 9], start=[14, 1], gamma=0.95)
    answer = robust(model, slip=(0.1, 0.2))
    assert next(iter(answer.worth)) == why(model).best.doors[0]
    at_worst = qualrl.build(coming_back(), [14, 9], start=[14, 1], gamma=0.95, slip=0.2)
    least, _ = next(iter(answer.worth.values()))
    assert least <= exact_values(at_worst.world).value[at_worst.start] + 1e-9


@pytest.mark.parametrize(("start", "goal"), [((1, 1), (1, 13)), ((1, 7), (16, 1)), ((17, 1), (17, 13))])
def test_staying_in_the_goals_region_is_compared_while_slips_are_uncertain(start, goal):
    model = qualrl.build(regions_of(RING), list(goal), start=list(start), gamma=0.95, slip=0.1)
    region = int(model.region_of[model.start])
    assert region == model.region_of[model.grid.goal]
    worth = robust(model, slip=(0.1, 0.1)).worth
    doors = {door.name: door for door in model.regions.doorways}
    assert f"staying in {model.region_names[region]}" in worth
    for name, (least, most) in worth.items():
        expected = sweeps_through(model, region, doors.get(name))[model.start]
        assert least - 1e-6 <= expected <= most + 1e-6


@pytest.mark.parametrize(("start", "goal", "can_come_back"), [((11, 3), (11, 7), True), ((11, 7), (11, 3), False)])
def test_that_ways_which_come_back_are_not_compared_is_said_where_there_are_some(start, goal, can_come_back):
    regions = coming_back()
    model = qualrl.build(regions, list(goal), start=list(start), gamma=0.95)
    answer, reason = why(model), qualrl.plan(model).steps[0].reason
    assert answer.other is None
    region = model.region_names.index(answer.at)
    around = nx.MultiGraph([door.pair for door in regions.doorways if region not in door.pair])
    beyond = [sum(door.pair) - region for door in regions.doorways if region in door.pair]
    around.add_nodes_from(beyond)
    joined = any(sum(of in part for of in beyond) > 1 for part in nx.connected_components(around))
    assert can_come_back is joined is answer.can_come_back
    assert ("leads on from there without coming back, so" in answer.explain()) is can_come_back
    assert ("to the goal without coming back, worth" in reason) is can_come_back
    slipping = qualrl.build(regions, list(goal), start=list(start), gamma=0.95, slip=0.2)
    step, value = qualrl.plan(slipping).steps[0], exact_values(slipping.world).value[slipping.start]
    assert step.reason.endswith(f"worth {value:.6g}")
    assert (step.value if step.free_value is None else step.free_value) == pytest.approx(value)
