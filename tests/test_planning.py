"""Plans: their paths, their values and their reasons, against brute force on the grid."""

import itertools
import json
import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import NoPlanError, PlaceError, SettingError, UnknownNameError
from qualrl.planning.legs import legs_of
from qualrl.planning.on_the_way import REACH_M, SIDES, passages
from qualrl.planning.plan import Step
from qualrl.qualitative.graph import crossings_of
from tests import oracles
from tests.worlds import PUZZLE, TWO_ROOMS, free_masks, grid_of

LOOP = """
###########################
#........#........#.......#
#........#........#.......#
#.................#.......#
#........#................#
#........#........#.......#
#........#........#.......#
#####.##########.#####.####
#.........................#
#.........................#
###########################
"""


DEAD_END = """
###################
#........#........#
#........#........#
#........#........#
#.................#
###.###.##........#
#........#........#
#........#........#
#........#........#
###################
"""

CORNER_TOUCH = """
#..#.
.##..
###..
#....
..#..
....#
.#...
...#.
.....
.##.#
##...
"""


def regions_of(text, resolution_m=1.0):
    return qualrl.segment(grid_of(text, resolution_m))


@given(st.data(), free_masks(side=9), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.2]))
@settings(max_examples=40, deadline=None)
def test_exact_plans_walk_from_start_to_goal_through_touching_places(data, free, directions, slip):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 1)
    start, goal = (data.draw(st.sampled_from(cells)) for _ in range(2))
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    model = qualrl.build(regions, list(goal), start=list(start), gamma=0.95, slip=slip, directions=directions)
    plan = qualrl.plan(model)
    twin = oracles.GridTwin(free, goal, directions, slip)
    assert plan.path[0] == start
    assert plan.path[-1] == goal
    assert all(twin.graph().has_edge(a, b) for a, b in zip(plan.path, plan.path[1:], strict=False))
    assert plan.length_steps == len(plan.path) - 1
    if slip == 0 and directions == 4:
        assert plan.length_steps == plan.shortest_steps
    assert plan.value == pytest.approx(twin.values(0.95)[start], abs=1e-6)
    assert all(model.graph.has_edge(a, b) for a, b in zip(plan.places, plan.places[1:], strict=False))
    assert plan.places[0] == model.region_names[regions.label[start]]
    assert plan.places[-1] == model.region_names[regions.label[goal]]
    assert [step.place for step in plan.steps] == list(plan.places)
    assert sum(step.steps for step in plan.steps) == plan.length_steps
    assert json.loads(json.dumps(plan.to_dict()))["length_steps"] == plan.length_steps


def value_through_only(model, regions, door, cell, gamma):
    """Value of leaving a cell's region by one door only, by shortest paths on the grid: no shared code."""
    here = regions.label[cell]
    graph = oracles.GridTwin(regions.grid.free, model.grid.goal_cell).graph()
    allowed = {frozenset(pair) for pair in crossings_of(regions, door)}
    whole_to_goal = nx.single_source_shortest_path_length(graph.reverse(), model.grid.goal_cell)
    inside = [c for c in graph if regions.label[c] == here]
    lengths = nx.single_source_shortest_path_length(graph.subgraph(inside), cell)
    steps = min(
        lengths[a] + 1 + whole_to_goal[b]
        for a in inside
        for b in graph.successors(a)
        if frozenset((a, b)) in allowed and a in lengths
    )
    return float(oracles.deterministic_value(steps, str(gamma)))


@pytest.mark.parametrize("goal", [[8, 25], [1, 1], [1, 24]])
def test_each_reason_is_what_brute_force_over_the_doors_gives(goal):
    regions = regions_of(LOOP)
    model = qualrl.build(regions, goal, start="room A", gamma=0.97)
    plan = qualrl.plan(model)
    doors = {door.name: door for door in regions.doorways}
    walked, compared = 0, 0
    for step in plan.steps[:-1]:
        cell = plan.path[walked]
        walked += step.steps
        taken = next(name for name in doors if f"go through {name} to {step.to}" == step.action)
        assert step.value == pytest.approx(value_through_only(model, regions, doors[taken], cell, 0.97), abs=1e-9)
        if step.runner_up is None:
            assert "only way" in step.reason
            continue
        compared += 1
        other = step.runner_up.split(" to ")[0]
        worth = value_through_only(model, regions, doors[other], cell, 0.97)
        assert step.runner_up_value == pytest.approx(worth, abs=1e-9)
        assert step.margin == pytest.approx(step.value - worth, abs=1e-9)
        assert step.margin >= -1e-12
        assert f"{step.value:.6g}" in step.reason
    assert compared or len(plan.steps) < 3


def test_doors_that_only_lead_back_are_no_alternative():
    regions = regions_of(TWO_ROOMS)
    plan = qualrl.plan(qualrl.build(regions, "room B", gamma=0.9), "room A")
    assert plan.places == ("room A", "room B")
    assert plan.steps[0].reason == f"the only way on from room A to the goal, worth {plan.value:.6g}"
    assert plan.explain().splitlines()[0].startswith("From room A to room B: room A -> room B (")


def test_a_learned_detour_through_a_dead_end_has_a_finite_value_and_says_what_it_costs():
    regions = regions_of(DEAD_END)
    model = qualrl.build(regions, [4, 16], start=[1, 1], gamma=0.97)
    training = qualrl.train(model, "q-learning", episodes=1, max_steps=1)
    walk = nx.shortest_path(oracles.GridTwin(regions.grid.free, None).graph(), (1, 1), (7, 5))
    walk += [(7, 6), (7, 7), (6, 7), (5, 7), (4, 7)]  # out of the closet again by its other door
    walk += nx.shortest_path(oracles.GridTwin(regions.grid.free, None).graph(), (4, 7), model.grid.goal_cell)[1:]
    assert len(set(walk)) == len(walk)
    training.q[:] = -1000.0
    for here, there in itertools.pairwise(walk):
        state, target = (int(model.grid.state_of[cell]) for cell in (here, there))
        training.q[state, model.grid.successor[state].tolist().index(target)] = 50.0
    plan = training.plan()
    assert list(plan.path) == walk
    assert plan.places[0] == plan.places[2]
    assert all(np.isfinite(step.value) for step in plan.steps)
    assert plan.steps[0].to == plan.places[1]
    assert plan.steps[0].runner_up is not None
    assert f"{plan.steps[0].value:.6g}" in plan.steps[0].reason


def test_learned_plans_follow_what_was_learned():
    regions = regions_of(PUZZLE)
    model = qualrl.build(regions, [6, 6], start=[11, 1], gamma=0.9)
    training = qualrl.train(model, "hql", episodes=3000, alpha=0.05, epsilon=0.05)
    plan = training.plan()
    assert plan.source == "hql"
    assert plan.length_steps == 32
    assert plan.value == pytest.approx(training.q[model.start].max())
    assert qualrl.plan(training).path == plan.path
    assert qualrl.plan(training, exact=True).source == "exact"
    elsewhere = qualrl.plan(training, goal=[1, 11])
    assert elsewhere.source == "exact"
    assert "another goal" in elsewhere.notes[0]
    assert elsewhere.length_steps == 20


def test_a_run_that_learned_too_little_says_so_and_plans_exactly():
    model = qualrl.build(regions_of(PUZZLE), [6, 6], start=[11, 1], gamma=0.9)
    training = qualrl.train(model, "q-learning", episodes=1, max_steps=50)
    assert training.greedy_steps is None
    plan = training.plan()
    assert plan.source == "exact"
    assert "does not lead there" in plan.notes[0]
    assert plan.notes[0] in plan.explain()


def test_ways_of_equal_length_change_region_as_seldom_as_they_can():
    open_plan = "\n".join(["#" * 40, *["#" + "." * 38 + "#"] * 12, "#" * 40])
    regions = regions_of(open_plan + "\n" + "\n".join(["#" + "." * 38 + "#"] * 3 + ["#" * 40]))
    model = qualrl.build(regions, [12, 38], start=[1, 1], gamma=0.99)
    plan = qualrl.plan(model)
    assert plan.length_steps == plan.shortest_steps
    assert len(plan.places) == 1 + len(set(plan.places)) - 1


def test_brief_excursions_over_a_border_are_no_places():
    regions = regions_of(TWO_ROOMS)
    model = qualrl.build(regions, "room B")
    left = [s for s in range(len(model)) if model.region_of[s] == 0]
    right = [s for s in range(len(model)) if model.region_of[s] == 1]
    walk = left[:6] + right[:2] + left[6:12] + right[:9]
    legs = legs_of(model, walk)
    assert [(leg.region, leg.first, leg.last) for leg in legs] == [(0, 0, 13), (1, 14, 22)]
    long_visit = left[:6] + right[:4] + left[6:12]
    assert [leg.region for leg in legs_of(model, long_visit)] == [0, 1, 0]


def test_renaming_changes_nothing_but_names():
    regions = regions_of(LOOP)
    plain = qualrl.plan(qualrl.build(regions, "room B"), "room A")
    door = regions.doorways[0].name
    names = {"room A": "kitchen", "room B": "lab", door: "the red door"}
    model = qualrl.build(regions, "lab", names=names)
    renamed = qualrl.plan(model, "kitchen")
    assert renamed.path == plain.path
    assert renamed.value == plain.value
    assert renamed.places == tuple(names.get(place, place) for place in plain.places)
    text = plain.explain()
    for old, new in names.items():
        text = text.replace(old, new)
    assert renamed.explain() == text
    assert "kitchen" in model.graph
    assert "the red door" in [key for _, _, key in model.graph.edges(keys=True)]
    assert not any("room A" in str(data) for _, _, data in model.graph.edges(data=True))


def test_errors_name_the_place_and_what_to_do():
    regions = regions_of(TWO_ROOMS)
    with pytest.raises(UnknownNameError, match="did you mean 'room A'"):
        qualrl.build(regions, "romo A")
    with pytest.raises(PlaceError, match="in a wall; the nearest free cell is 1,1"):
        qualrl.build(regions, [0, 0])
    with pytest.raises(PlaceError, match="outside the map of 9 x 19"):
        qualrl.build(regions, "90,0")
    model = qualrl.build(regions, "room A")
    with pytest.raises(SettingError, match="say where to start"):
        qualrl.plan(model)
    islands = qualrl.segment(grid_of("#######\n#..#..#\n#..#..#\n#######"))
    cut_off = qualrl.build(islands, [1, 5])
    with pytest.raises(NoPlanError, match="no way leads from"):
        qualrl.plan(cut_off, [1, 1])


def test_a_goal_too_far_for_gamma_is_told():
    free = np.ones((1, 9000), bool)
    model = qualrl.build(qualrl.segment(qualrl.OccupancyGrid.from_free(free)), [0, 0], gamma=0.9)
    with pytest.raises(NoPlanError, match="choose gamma nearer to 1"):
        qualrl.plan(model, [0, 8999])


def test_plan_at_the_goal_is_to_stay():
    model = qualrl.build(regions_of(TWO_ROOMS), [4, 4], start=[4, 4])
    plan = qualrl.plan(model)
    assert plan.length_steps == 0
    assert plan.path == ((4, 4),)
    assert plan.value == 0
    assert plan.steps[0].reason == "this is the goal"


@pytest.mark.parametrize("slip", [0.75, 0.8, 0.9])
def test_where_moves_mostly_slip_a_plan_still_leads_to_the_goal(slip):
    model = qualrl.build(regions_of(PUZZLE), [6, 6], start=[11, 1], gamma=0.99, slip=slip)
    plan = qualrl.plan(model)
    assert plan.path[-1] == (6, 6)
    assert plan.value == pytest.approx(oracles.GridTwin(model.grid.free, (6, 6), 4, slip).values(0.99)[11, 1], abs=1e-6)


def test_a_diagonal_between_regions_that_touch_at_a_corner_only_is_told_by_a_doorway_beside_it():
    regions = regions_of(CORNER_TOUCH)
    pair = {int(regions.label[cell]) for cell in ((5, 2), (6, 3))}
    assert pair not in [set(door.pair) for door in regions.doorways]
    model = qualrl.build(regions, [6, 3], start=[5, 2], directions=8)
    first, _ = qualrl.plan(model).steps
    near = next(door for door in regions.doorways if f"go through {door.name} to" in first.action)
    assert int(regions.label[5, 2]) in near.pair
    assert np.abs(near.cells - [5.5, 2.5]).sum(axis=1).min() <= 1


@settings(deadline=None, max_examples=25)
@given(
    st.sampled_from([tuple(cell) for cell in np.argwhere(grid_of(LOOP).free).tolist()]),
    st.sampled_from([tuple(cell) for cell in np.argwhere(grid_of(LOOP).free).tolist()]),
    st.sampled_from([4, 8]),
)
def test_a_plan_tells_where_to_turn_and_a_mirror_swaps_left_and_right(start, goal, directions):
    assume(start != goal)
    regions = qualrl.segment(grid_of(LOOP))
    mirrored = qualrl.segment(grid_of("\n".join(line[::-1] for line in LOOP.strip().splitlines())))
    width = regions.label.shape[1]
    plan = qualrl.plan(qualrl.build(regions, list(goal), start=list(start), directions=directions, gamma=0.97))
    for number, step in enumerate(plan.steps):
        assert (step.side is None) == (number == 0 or step.steps == 0)
        if step.side:
            assert SIDES[step.side] in plan.explain().splitlines()[number + 1]
    swap = {"left": "right", "right": "left", "straight": "straight", "back": "back", None: None}
    path = [(row, width - 1 - column) for row, column in plan.path]
    told = [of.side for of in passages(mirrored, path)]
    assert told == [swap[step.side] for step in plan.steps]
    (row, column), (to_row, to_column) = plan.path[0], plan.path[plan.steps[0].steps]
    angle = math.degrees(math.atan2(row - to_row, to_column - column))
    middles = {"east": 0, "north-east": 45, "north": 90, "north-west": 135, "west": 180, "south-west": -135,
               "south": -90, "south-east": -45}  # fmt: skip
    assert abs((angle - middles[plan.steps[0].compass] + 180) % 360 - 180) <= 22.5
    assert f"to the {plan.steps[0].compass}, " in plan.explain().splitlines()[1]
    assert all(step.compass is None for step in plan.steps[1:])


@pytest.mark.parametrize("directions", [4, 8])
def test_landmarks_on_a_plan_are_as_near_as_it_says(directions):
    regions = qualrl.load_scenario("office").build().regions
    model = qualrl.build(regions, "room D", start="room A", gamma=0.999, directions=directions)
    plan = qualrl.plan(model)
    marks = {mark.name: mark for mark in regions.landmarks}
    reach = REACH_M / regions.grid.resolution_m
    first = 0
    for step in plan.steps:
        leg = plan.path[first : first + step.steps + 1]
        for name in step.passes:
            away = min(math.dist(cell, at) for cell in leg for at in marks[name].cells.tolist())
            assert away <= reach
            assert name not in step.action
        first += step.steps
    passed = [name for step in plan.steps for name in step.passes]
    assert len(passed) == len(set(passed)) > 2
    nearest = [
        min(range(len(plan.path)), key=lambda at: min(math.dist(plan.path[at], c) for c in marks[name].cells.tolist()))
        for name in passed
    ]
    assert nearest == sorted(nearest)


def test_many_landmarks_are_cut_short_in_words():
    step = Step("room A", "walk to the goal", "room A", 1.0, "why", None, None, None, 9, 9.0, "left", tuple("abcdefg"))
    assert step.in_words() == "In room A, to the left, walk to the goal (9.00 m, past a, b, c, d, e, 2 more): why."
    assert step.to_dict()["passes"] == list("abcdefg")
