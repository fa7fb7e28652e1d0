"""The policy in brief: each number against the plans from every cell, and against doors taken one by one by hand."""

import json
import math
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

import qualrl
from qualrl.errors import SettingError
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.planning.planner import plan_exactly
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import exact_values
from tests import oracles
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import TWO_ROOMS, grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]


def told(model):
    """{region: {what the plan from a cell does first: cells}}, by a plan from every cell."""
    solved, found = exact_values(model.world), {}
    for cell in CELLS:
        state = int(model.grid.state_of[cell])
        plan = plan_exactly(model, state, ("here", "there"), exact=solved)
        action = plan.steps[0].action if len(plan.steps) > 1 else "walk to the goal, which is here"
        found.setdefault(plan.places[0], {}).setdefault(action, []).append(cell)
    return found


@pytest.mark.parametrize(
    ("goal", "slip", "directions"), [([2, 24], 0, 4), ([8, 12], 0, 4), ([2, 2], 0.2, 4), ([6, 12], 0, 8)]
)
def test_rules_and_exceptions_are_what_the_plans_from_all_cells_do(goal, slip, directions):
    model = qualrl.build(REGIONS, goal, gamma=0.97, slip=slip, directions=directions)
    answer = qualrl.questions.summary(model)
    expected = told(model)
    assert {rule.name: rule.cells for rule in answer.rules} == {
        name: sum(map(len, cells.values())) for name, cells in expected.items()
    }
    for rule in answer.rules:
        assert {found.words for found in rule.exits} == set(expected[rule.name])
        counts = [found.cells for found in rule.exits]
        assert counts == sorted(counts, reverse=True)
        for found in rule.exits:
            cells = np.array(expected[rule.name][found.words])
            assert found.cells == len(cells)
            assert found.share == pytest.approx(len(cells) / rule.cells)
            assert (found.rows, found.columns) == tuple(zip(cells.min(axis=0), cells.max(axis=0), strict=True))
    nearest = [rule.steps_to_goal for rule in answer.rules]
    assert nearest == sorted(nearest)
    assert nearest[0] == 0


def values_by(model, door, region):
    """{cell: value} of all cells of a region of leaving it by one door only, by shortest paths on the grid."""
    graph = oracles.GridTwin(REGIONS.grid.free, model.grid.goal_cell).graph()
    to_goal = nx.single_source_shortest_path_length(graph.reverse(), model.grid.goal_cell)
    inside = nx.DiGraph(graph.subgraph([cell for cell in CELLS if REGIONS.label[cell] == region]).reverse())
    for pair in crossings_of(REGIONS, door):
        near, far = sorted(pair, key=lambda cell: REGIONS.label[cell] != region)
        least = inside.get_edge_data("out", near, {"steps": math.inf})["steps"]
        inside.add_edge("out", near, steps=min(1 + to_goal[far], least))
    steps = nx.single_source_dijkstra_path_length(inside, "out", weight=lambda a, b, data: data.get("steps", 1))
    return {cell: float(oracles.deterministic_value(far, "0.97")) for cell, far in steps.items() if cell != "out"}


@pytest.mark.parametrize("goal", [[2, 24], [8, 12]])
def test_gaps_are_those_of_going_by_each_door_by_hand(goal):
    model = qualrl.build(REGIONS, goal, gamma=0.97)
    compared = 0
    for rule in qualrl.questions.summary(model).rules:
        region = model.region_names.index(rule.name)
        doors = [door for door in REGIONS.doorways if region in door.pair]
        if rule.gap is None:
            assert rule.steps_to_goal == 0 or len(doors) == 1
            continue
        worth = [values_by(model, door, region) for door in doors]
        gap = {}
        for cell in worth[0]:
            *_, second, best = sorted(values[cell] for values in worth)
            gap[cell] = best - second
        assert len(gap) == rule.cells
        assert rule.gap.mean == pytest.approx(sum(gap.values()) / len(gap))
        assert rule.gap.largest == pytest.approx(max(gap.values()))
        assert gap[rule.gap.at] == pytest.approx(max(gap.values()))
        compared += len(gap)
    assert compared > 50


def test_the_most_important_regions_come_first_and_are_told():
    answer = qualrl.questions.summary(qualrl.build(REGIONS, [2, 24], gamma=0.97))
    means = [rule.gap.mean for rule in answer.important]
    assert means == sorted(means, reverse=True)
    assert means[-1] > 0
    last = answer.explain().splitlines()[-1]
    assert all(f"{rule.name} ({rule.gap.mean:.3g} on average" in last for rule in answer.important[:3])


@pytest.mark.parametrize(
    ("yaw", "below", "right"),
    [(0.0, "south", "east"), (math.pi / 2, "east", "north"), (-math.pi / 4, "south-west", "south-east")],
)
def test_sides_are_those_of_the_world_however_the_map_is_turned(yaw, below, right):
    grid = replace(grid_of(LOOP, 0.5), origin=(3.0, 4.0, yaw))
    rules = {
        rule.name: rule
        for rule in qualrl.questions.summary(qualrl.build(qualrl.segment(grid), [2, 24], gamma=0.97)).rules
    }
    sides = {name: [(found.rows, found.side) for found in rules[name].exits[1:]] for name in rules}
    assert sides == {"room A": [], "room B": [((7, 7), below)], "room C": [], "corridor 1": [((8, 9), right)]}


def test_the_answer_says_what_its_fields_hold(tmp_path):
    draw(tmp_path, "loop", LOOP + "#.#########################\n###########################\n")
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {gamma: 0.97}\n")
    document = json.loads(qualrl_command("summary", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])
    sentences = document["sentences"]
    assert qualrl_command("summary", "loop.scenario.yaml", cwd=tmp_path)[0].splitlines() == sentences
    assert sentences[0].startswith("Best at gamma 0.97, wherever one is")
    open_rules = [rule for rule in document["regions"] if rule["steps_to_goal"] is not None]
    exceptions = 0
    for rule, line in zip(open_rules, sentences[1:], strict=False):
        assert line.startswith(f"{rule['region']} ({rule['cells']} cells): {rule['exits'][0]['words']}")
        assert line.count("; except ") == len(rule["exits"]) - 1
        for found in rule["exits"][1:]:
            exceptions += 1
            assert f"except {found['cells']} cell" in line
            assert f"({100 * found['share']:.2g} %)" in line
            assert (f"in its {found['side']} (" in line) == (found["side"] is not None)
            for what in ("row", "column"):
                first, last = found[f"{what}s"]
                assert (f"{what} {first}" if first == last else f"{what}s {first} to {last}") in line
    assert exceptions
    assert sentences[-2] == "No way leads to the goal from pocket 1 (1 cell)."
    important = {rule["region"]: rule["gap"] for rule in document["regions"] if rule["gap"]}
    for name in document["important"][:3]:
        gap = important[name]
        assert f"{name} ({gap['mean']:.3g} on average, {gap['largest']:.3g} at most)" in sentences[-1]


def test_where_values_fade_the_answer_says_so():
    model = qualrl.build(
        qualrl.segment(grid_of("#" * 3002 + "\n#" + "." * 3000 + "#\n" + "#" * 3002)), [1, 1], gamma=0.5
    )
    (rule,) = qualrl.questions.summary(model).rules
    assert [found.words.split(",")[0] for found in rule.exits] == ["values fade before the goal", "walk to the goal"]


def test_a_region_without_a_second_door_has_no_gap():
    answer = qualrl.questions.summary(qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B"))
    assert [rule.gap for rule in answer.rules] == [None, None]
    assert answer.explain().splitlines()[1:] == [
        f"room B ({answer.rules[0].cells} cells): walk to the goal, which is here",
        f"room A ({answer.rules[1].cells} cells): go through door 1 to room B",
    ]


def test_models_without_a_map_are_refused():
    table = TabularMDP.from_outcomes({0: {0: [(1.0, 1, 1.0, True)]}, 1: {0: [(1.0, 1, 0.0, True)]}}, gamma=0.9)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.summary(qualrl.HybridMDP.from_table(table, ["a", "b"], start=0))


def test_a_map_is_refused_in_one_line(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (line,) = qualrl_command("summary", "loop.yaml", cwd=tmp_path, expect=2)[1].splitlines()
    assert "is a map, not a scenario" in line
