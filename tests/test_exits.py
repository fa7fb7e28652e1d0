"""The doorway by which the best way leaves a region: against the planner, and against ways counted by hand."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import NoPlanError
from qualrl.planning.exits import ASTRAY, GOAL_HERE, NO_WAY, exits
from qualrl.planning.planner import plan_exactly
from qualrl.solving.exact import exact_values
from tests import oracles
from tests.test_planning import LOOP
from tests.worlds import free_masks, grid_of


def exits_of(model):
    found = exits(model, model.regions, exact_values(model.world))
    return {model.cell_of(state): int(door) for state, door in enumerate(found)}


def planned_exit(model, solved, cell):
    """What the planner's own plan from a cell does first."""
    try:
        plan = plan_exactly(model, int(model.grid.state_of[cell]), ("here", "there"), exact=solved)
    except NoPlanError as error:
        return ASTRAY if "fades" in str(error) else NO_WAY
    if len(plan.steps) == 1:
        return GOAL_HERE
    names = [door.name for door in model.regions.doorways]
    (door,) = [i for i, name in enumerate(names) if plan.steps[0].action.startswith(f"go through {name} to")]
    return door


def assert_exits_are_planned(model, cells):
    solved = exact_values(model.world)
    assert exits_of(model) == {cell: planned_exit(model, solved, cell) for cell in cells}


@given(
    st.data(), free_masks(side=9, connected=False), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.1, 0.4, 0.8]),
    st.sampled_from([0.5, 0.9, 0.99]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_exits_are_those_of_the_plans_from_each_cell(data, free, directions, slip, gamma):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    goal = data.draw(st.sampled_from(cells))
    model = qualrl.build(regions, list(goal), gamma=gamma, slip=slip, directions=directions)
    assert_exits_are_planned(model, cells)


@pytest.mark.parametrize(("slip", "directions"), [(0.0, 4), (0.0, 8), (0.2, 4), (0.9, 4), (0.2, 8)])
def test_exits_are_those_of_the_plans_on_a_map_with_a_loop(slip, directions):
    regions = qualrl.segment(grid_of(LOOP))
    model = qualrl.build(regions, [2, 24], gamma=0.97, slip=slip, directions=directions).with_closed(["door 1"])
    assert len(set(exits_of(model).values())) > 3
    assert_exits_are_planned(model, [tuple(cell) for cell in np.argwhere(regions.grid.free).tolist()])


def ways_out(regions, goal):
    """{cell: doors} by which some shortest way of fewest borders leaves a cell's region, by dictionaries alone.

    Excursions over a border are not looked at: maps where such a way comes back to a region are of no use here.
    """
    graph = oracles.GridTwin(regions.grid.free, goal).graph()
    label = {cell: int(regions.label[cell]) for cell in graph}
    door_at = {}
    for index, door in enumerate(regions.doorways):
        for cell in map(tuple, door.cells.tolist()):
            for other in graph[cell]:
                if {label[cell], label[other]} == set(door.pair):
                    door_at.setdefault(frozenset((cell, other)), set()).add(index)
    far, edge = {goal: 0}, [goal]
    while edge:
        edge = [to for cell in edge for to in graph[cell] if far.setdefault(to, far[cell] + 1) == far[cell] + 1]
    borders, doors, ahead = {goal: 0}, {goal: {GOAL_HERE}}, {goal: {label[goal]}}
    for cell in sorted(far, key=far.get)[1:]:
        nearer = [to for to in graph[cell] if far[to] == far[cell] - 1]
        cost = {to: borders[to] + (label[to] != label[cell]) for to in nearer}
        borders[cell] = min(cost.values())
        best = [to for to in nearer if borders[to] == min(borders[near] for near in nearer)]  # as the planner looks on
        assume(not any(label[to] != label[cell] and label[cell] in ahead[to] for to in best))
        ahead[cell] = {label[cell]}.union(*(ahead[to] for to in best))
        doors[cell] = {
            door for to in best for door in (doors[to] if label[to] == label[cell] else door_at[frozenset((cell, to))])
        }
    return doors


@given(st.data(), free_masks(side=10))
@settings(max_examples=60, deadline=None)
def test_exits_are_among_those_of_the_shortest_ways(data, free):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 1)
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    goal = data.draw(st.sampled_from(cells))
    model = qualrl.build(regions, list(goal), gamma=0.99)
    shortest = ways_out(regions, goal)
    for cell, door in exits_of(model).items():
        assert door in shortest[cell]
