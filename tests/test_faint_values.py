"""Where the goal is so far off for gamma that values are alike in all their digits: by lengths from networkx."""

from fractions import Fraction

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import NoPlanError, SettingError
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_reconcile import length
from tests.test_what_if import steps_graph
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
GAMMA = Fraction(1, 8)
"""To the power of 18 it is less than the last digit of 1."""


def ahead(steps, other):
    """By how much a way of so many steps is worth more than another: a goal of 100, steps of -1."""
    rest = -1 / (1 - GAMMA)
    return float((100 - rest) * (GAMMA ** (steps - 1) - GAMMA ** (other - 1)))


def model_of(start, goal, **given):
    return qualrl.build(REGIONS, list(goal), start=list(start), gamma=float(GAMMA), **given)


@settings(deadline=None, max_examples=25)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS), st.sampled_from(REGIONS.region_names))
def test_what_a_longer_way_costs_is_told_however_little(start, goal, via):
    assume(start != goal)
    model = model_of(start, goal)
    try:
        answer = qualrl.questions.why_not(model, via)
    except NoPlanError:
        return
    graph = steps_graph(model)
    shortest = nx.shortest_path_length(graph, model.start, model.grid.goal)
    assert answer.costs == pytest.approx(ahead(shortest, answer.by.steps), rel=1e-9)
    assert answer.is_by_itself == (shortest == answer.by.steps)
    assert ("costs nothing" in answer.explain()) == answer.is_by_itself


@settings(deadline=None, max_examples=15)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS))
def test_what_is_lost_without_a_doorway_is_told_however_little(start, goal):
    assume(start != goal)
    model = model_of(start, goal)
    whole = length(model, [])
    for loss in qualrl.questions.which_matters(model).losses:
        if loss.kind == "doorway" and loss.loss is not None:
            assert loss.loss == pytest.approx(ahead(whole, length(model, [loss.name])), rel=1e-9)
            assert loss.loss > 0


def test_a_far_choice_is_no_tie():
    model = model_of((1, 7), (8, 24))
    answer = qualrl.questions.why(model)
    assert answer.best.value == answer.other.value
    assert answer.margin == pytest.approx(ahead(answer.best.steps, answer.other.steps), rel=1e-9)
    assert f", {answer.margin:.3g} less." in answer.explain()
    assert ", worth less; it is longer" in answer.explain("signs")
    assert "made up of" not in answer.explain()
    longest = qualrl.questions.reconcile(model, answer.other.places)
    assert longest.closed
    closed = qualrl.questions.what_if(model, close=answer.best.doors[0])
    assert f", {ahead(answer.best.steps, closed.after.steps):.3g} less; " in closed.explain()


def test_a_gamma_too_near_1_is_told_to_be_that():
    with pytest.raises(NoPlanError, match="choose gamma farther from 1"):
        qualrl.questions.why(qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=1 - 1e-12))


def test_a_change_that_is_found_is_not_called_the_first():
    """Diagonal steps: at gamma 0.5 another way is best, and the two gammas told are on either side of such a change."""
    model = qualrl.build(REGIONS, [2, 24], start=[9, 3], gamma=0.95, directions=8)
    answer = qualrl.questions.what_if(model, gamma=0.5)
    ends = answer.switch.same, answer.switch.other
    assert "first" not in answer.explain()
    ways = [qualrl.plan(qualrl.build(REGIONS, [2, 24], start=[9, 3], gamma=of, directions=8)) for of in ends]
    assert ways[0].places != ways[1].places or ways[0].doors != ways[1].doors


def test_whether_to_go_and_see_is_asked_of_what_else_is_changed(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {gamma: 0.97}\n")
    first = (
        qualrl.plan(qualrl.build(REGIONS, [2, 24], start=[2, 2])).steps[0].action.split(" to ")[0].split("through ")[1]
    )
    asked = "what-if", "loop.scenario.yaml", "--close", first, "--chance", "0.4"
    both = qualrl_command(*asked, "--set", "learn.gamma=0.9", cwd=tmp_path)[0]
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.9)
    alone = qualrl.questions.what_if(model, close=first, chance=0.4).explain()
    assert both.splitlines()[-3:] == alone.splitlines()[-3:]
    assert "go and see" not in both
    for more, told in (
        (("--slip", "0.1"), "only where no move slips"),
        (("--set", "motion.slip=0.1", "--slip", "0.2"), "give it once"),
        (("--open", "room A,room B"), "open no wall in the same question"),
    ):  # fmt: skip
        assert told in qualrl_command(*asked, *more, cwd=tmp_path, expect=2)[1]
    with pytest.raises(SettingError, match="from 0 to 1"):
        qualrl.questions.what_if(model, close=first, chance=1.5)


PARTED = """
#############
#.....#.....#
#.....#.....#
#.....#.....#
#############
"""


def test_a_wall_may_be_opened_where_no_way_leads():
    regions = qualrl.segment(grid_of(PARTED))
    model = qualrl.build(regions, [2, 9], start=[2, 2], gamma=0.9)
    names = regions.region_names
    opened = qualrl.questions.what_if(model, open=(names[0], names[1]))
    assert opened.before is None
    assert opened.after.steps == 7
    assert opened.explain().splitlines()[0].endswith("no way leads there.")
    expected = qualrl.questions.reconcile(model, [names[regions.label[2, 2]], names[regions.label[2, 9]]])
    assert expected.best is None
    assert expected.own.steps == 7
    assert len(expected.opened) == 1
    for answer in (opened, expected):
        assert answer.to_dict()["before" if answer is opened else "best"] is None
        assert "no way leads there" in answer.explain("names")
    still = qualrl.questions.what_if(model, gamma=0.5)
    assert (still.before, still.after) == (None, None)
    assert "no way leads from" in still.explain()


def test_in_the_region_of_the_goal_no_doorway_is_chosen():
    answer = qualrl.questions.why(qualrl.build(REGIONS, [2, 24], start=[2, 22]))
    assert "The goal is in it, so there is nothing to choose." in answer.explain()
