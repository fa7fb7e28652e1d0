"""What a plan hangs on: against closing every doorway by hand, and every set of doorways."""

import json
from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import which_matters
from qualrl.errors import NoPlanError, SettingError
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.solving.exact import exact_values
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests.command_here import qualrl as qualrl_command
from tests.room_grids import room_grid
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import grid_of

GRID = grid_of(LOOP)
CELLS = [tuple(cell) for cell in np.argwhere(GRID.free).tolist()]


@pytest.fixture(scope="module")
def regions():
    """Found when a test runs, not when it is collected: that would compile in every worker."""
    return qualrl.segment(GRID)


def value_of(model, start):
    """The value of a start by the length of the shortest way, or None; for moves that do not slip."""
    if model.grid.steps_to_goal[start] < 0:
        return None
    steps, gamma = int(model.grid.steps_to_goal[start]), model.gamma
    return -(1 - gamma ** (steps - 1)) / (1 - gamma) + 100 * gamma ** (steps - 1)


def by_hand(model, regions):
    """(name, kind) -> loss, of everything whose closing loses something."""
    now, found = value_of(model, model.start), {}
    ends = {model.region_names[model.region_of[state]] for state in (model.start, model.grid.goal)}
    for door in regions.doorways:
        found[door.name, "doorway"] = value_of(model.with_closed([door.name]), model.start)
    for index, name in enumerate(model.region_names):
        if name not in ends:
            doors = [door.name for door in regions.doorways if index in door.pair]
            found[name, "region"] = value_of(model.with_closed(doors), model.start)
    lost = {key: None if value is None else now - value for key, value in found.items()}
    return {key: loss for key, loss in lost.items() if loss is None or loss > 1e-9}


@settings(deadline=None, max_examples=25)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS))
def test_losses_are_those_of_closing_each_by_hand(regions, start, goal):
    assume(start != goal)
    model = qualrl.build(regions, list(goal), start=list(start), gamma=0.97)
    answer = qualrl.questions.which_matters(model)
    expected = by_hand(model, regions)
    assert {(loss.name, loss.kind) for loss in answer.losses} == set(expected)
    for loss in answer.losses:
        assert loss.loss == (
            None if expected[loss.name, loss.kind] is None else pytest.approx(expected[loss.name, loss.kind])
        )
    finite = [loss.loss for loss in answer.losses if loss.loss is not None]
    assert finite == sorted(finite, reverse=True)


@settings(deadline=None, max_examples=25)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS))
def test_the_cut_parts_start_and_goal_and_no_smaller_one_does(regions, start, goal):
    assume(start != goal)
    model = qualrl.build(regions, list(goal), start=list(start))
    cut = qualrl.questions.which_matters(model).cut
    ends = [int(model.region_of[state]) for state in (model.start, model.grid.goal)]
    if ends[0] == ends[1]:
        assert cut == ()
        return

    def parts(closed):
        graph = nx.Graph(door.pair for door in regions.doorways if door.name not in closed)
        graph.add_nodes_from(ends)
        return not nx.has_path(graph, *ends)

    assert parts(cut)
    smaller = combinations([door.name for door in regions.doorways], len(cut) - 1)
    assert not any(parts(closed) for closed in smaller)
    assert model.with_closed(cut).grid.steps_to_goal[model.start] < 0


@pytest.mark.parametrize(("slip", "directions"), [(0.2, 4), (0.0, 8), (0.1, 8)])
def test_slips_and_diagonals_are_reckoned_with(regions, slip, directions):
    model = qualrl.build(regions, [2, 24], start=[2, 2], gamma=0.95, slip=slip, directions=directions)
    now = qualrl.plan(model).value
    answer = qualrl.questions.which_matters(model)
    told = {loss.name: loss.loss for loss in answer.losses if loss.kind == "doorway"}
    for door in regions.doorways:
        try:
            left = qualrl.plan(model.with_closed([door.name])).value
        except NoPlanError:
            assert told[door.name] is None
            continue
        assert told.get(door.name, 0.0) == pytest.approx(max(now - left, 0.0), abs=1e-6)


def solved_and_told(model, most_steps):
    """How many worlds are solved for an answer, and the answer; most_steps: that are looked at beforehand."""
    solved = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(which_matters, "exact_values", lambda world: solved.append(world) or exact_values(world))
        patch.setattr(which_matters, "MOST_STEPS", most_steps)
        told = qualrl.questions.which_matters(model).to_dict()
    return len(solved), told


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 50), st.sampled_from([0.05, 0.3, 0.6]), st.sampled_from([4, 8]), st.sampled_from([0.9, 0.99]))
def test_the_same_is_told_as_where_each_changed_world_is_solved(seed, slip, directions, gamma):
    free, _ = room_grid(seed, 4, 7)
    rooms = qualrl.segment(OccupancyGrid.from_free(free))
    start, goal = np.random.default_rng(seed).choice(np.argwhere(rooms.label >= 0), 2, replace=False).tolist()
    model = qualrl.build(rooms, goal, start=start, gamma=gamma, slip=slip, directions=directions)
    assume(model.can_reach[model.start])
    fewer, told = solved_and_told(model, 5000)
    every, expected = solved_and_told(model, 0)
    assert fewer <= every
    assert told == expected


def test_what_hardly_ever_happens_is_not_solved():
    free, _ = room_grid(0, 4, 12)
    rooms = qualrl.segment(OccupancyGrid.from_free(free))
    model = qualrl.build(rooms, [2, 2], start=[2, 15], gamma=0.99, slip=0.05)
    fewer, told = solved_and_told(model, 5000)
    every, expected = solved_and_told(model, 0)
    assert told == expected
    assert fewer < every / 3


def test_the_answer_says_what_its_fields_hold(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    document = json.loads(qualrl_command("which-matters", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])
    sentences = document["sentences"]
    assert qualrl_command("which-matters", "loop.scenario.yaml", cwd=tmp_path)[0].splitlines() == sentences
    assert sentences[0].endswith(f"worth {document['value']:.6g} at gamma {document['gamma']:g}:")
    for loss, line in zip(document["losses"], sentences[1:-1], strict=True):
        if loss["loss"] is None:
            assert line == f"{loss['name']}: every way to the goal passes it"
        else:
            assert line.startswith(f"{loss['name']}: {loss['loss']:.3g} is lost without it")
            assert (f"{loss['longer_steps']} step{'s' * (loss['longer_steps'] != 1)} longer" in line) == (
                loss["longer_steps"] > 0
            )
    assert sentences[-1].endswith(": " + ", ".join(document["cut"]) + ".")
    assert any(loss["loss"] for loss in document["losses"])


def test_in_one_room_nothing_matters(regions):
    model = qualrl.build(regions, [2, 4], start=[2, 2])
    assert qualrl.questions.which_matters(model).explain().splitlines()[1:] == [
        "no single doorway or region matters",
        "Start and goal are in the same region, so no doorway parts them.",
    ]


def test_models_without_a_map_are_refused():
    table = TabularMDP.from_outcomes({0: {0: [(1.0, 1, 1.0, True)]}, 1: {0: [(1.0, 1, 0.0, True)]}}, gamma=0.9)
    model = qualrl.HybridMDP.from_table(table, ["a", "b"], start=0)
    for ask in (qualrl.questions.which_matters, lambda model: qualrl.questions.why_not(model, "b")):
        with pytest.raises(SettingError, match="without a map"):
            ask(model)
