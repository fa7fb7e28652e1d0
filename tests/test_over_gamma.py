"""Which way is better at which gamma while moves slip: against sums over laws of times, and value iteration."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import over_gamma
from qualrl.answers.stops import states_at
from qualrl.errors import SettingError
from qualrl.qualitative.arrivals import Solved, left_open, sign_between
from qualrl.solving.exact import exact_values
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_robust_slip import ALONG_OR_ROUND, iterated, worth_through
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
ALIKE = 1e-10
"""Iterated values that differ by less may be the same."""
LAWS = st.lists(
    st.dictionaries(st.integers(0, 40), st.integers(1, 9), min_size=1, max_size=4), min_size=1, max_size=3
)  # fmt: skip
GAMMAS = st.lists(st.integers(1, 999), min_size=2, max_size=7, unique=True).map(
    lambda found: [of / 1000 for of in sorted(found)]
)


def logarithm(policies, gamma):
    """Of the largest E[gamma ** n] of some policies, each the weights of its numbers of steps."""
    means = (math.fsum(weight * gamma**steps for steps, weight in law.items()) / sum(law.values()) for law in policies)
    return math.log(max(means))


@settings(deadline=None, max_examples=200)
@given(LAWS, LAWS, GAMMAS)
def test_what_a_few_points_tell_holds_between_them(first, second, gammas):
    points = [Solved(gamma, (logarithm(first, gamma), logarithm(second, gamma))) for gamma in gammas]
    for at in range(len(points) - 1):
        sign = sign_between(points, at)
        low, high = gammas[at : at + 2]
        for gamma in np.linspace(low, high, 9).tolist():
            ahead = logarithm(first, gamma) - logarithm(second, gamma)
            assert sign * ahead >= 0
            assert ahead != 0 or sign == 0


WAYS = st.lists(st.lists(st.booleans(), max_size=30), min_size=1, max_size=3)
"""Policies without chance: whether each step but the last is a diagonal one."""


@settings(deadline=None, max_examples=200)
@given(WAYS, WAYS, GAMMAS, st.sampled_from([-1.0, 0.0, 30.0]))
def test_what_a_few_points_tell_of_dearer_diagonals_holds_between_them(first, second, gammas, last):
    dearest = math.sqrt(2)

    def total(policies, gamma):
        """The largest value of some policies, and what the dearest step costs for ever."""
        worth = (
            math.fsum(-(dearest if of else 1.0) * gamma**t for t, of in enumerate(steps)) + last * gamma ** len(steps)
            for steps in policies
        )
        return max(worth) + dearest / (1 - gamma)

    def most(gamma):
        halfway = math.sqrt(gamma)
        return math.log(halfway), math.log(dearest / (1 - halfway) + max(last, 0.0))

    # What is left of the goal is more than rounding errors, as it is where values are asked for
    assume(all(total(ways, gamma) > 1e-9 * dearest / (1 - gamma) for ways in (first, second) for gamma in gammas))
    points = [
        Solved(gamma, (math.log(total(first, gamma)), math.log(total(second, gamma))), most(gamma)) for gamma in gammas
    ]
    for at in range(len(points) - 1):
        sign = sign_between(points, at)
        for gamma in np.linspace(*gammas[at : at + 2], 9).tolist():
            ahead = total(first, gamma) - total(second, gamma)
            assert sign * ahead >= 0
            assert ahead != 0 or sign == 0
        assert sign == 0 or left_open(points, at) < 0


def test_diagonal_steps_are_told_about_near_1():
    """Where the goal is not out of sight; which way it is that is better there is told for certain."""
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.9, slip=0.1, directions=8)
    found = qualrl.questions.why_not(model, "corridor 1", gammas=(0.95, 0.99)).over_gamma
    assert [of.sign for of in found.verdicts] == [1]
    for of in found.solved:
        exact = exact_values(at_gamma(model, of.gamma).world)
        assert of.logs[0] == pytest.approx(math.log(exact.shifted[model.start]), abs=1e-12)
        for gamma in np.linspace(of.gamma, 0.9999, 5).tolist():
            assert of.most[1] >= math.log(exact_values(at_gamma(model, gamma).world).shifted.max()) or (
                math.log(gamma) > of.most[0]
            )


def test_two_close_points_tell_of_ways_without_chance():
    """One step less is worth more at each gamma; the points need not be close for curves that are lines."""
    points = [Solved(gamma, (7 * math.log(gamma), 8 * math.log(gamma))) for gamma in (0.1, 0.99)]
    assert sign_between(points, 0) == 1
    assert sign_between([replace(of, logs=of.logs[::-1]) for of in points], 0) == -1
    assert sign_between([replace(of, logs=(of.logs[0],) * 2) for of in points], 0) == 0
    assert [of.sign for of in points] == [1, 1]


def at_gamma(model, gamma):
    return replace(model, world=replace(model.grid, gamma=gamma))


def check(found, signs_at):
    """The verdicts against values recomputed; the decided share of the range."""
    assert [of.low for of in found.verdicts[1:]] == [of.high for of in found.verdicts[:-1]]
    for of in found.verdicts:
        for gamma in np.linspace(of.low, of.high, 4).tolist():
            assert of.sign * signs_at(gamma) >= 0
    return {of.sign for of in found.verdicts}


@pytest.mark.no_cover
@settings(deadline=None, max_examples=15)
@given(st.sampled_from(CELLS), st.sampled_from(CELLS), st.sampled_from([0.1, 0.4]))
def test_verdicts_on_doorways_hold_for_each_gamma(start, goal, slip):
    assume(REGIONS.label[start] != REGIONS.label[goal])
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.9, slip=slip, goal_reward=30.0)
    answer = qualrl.questions.why(model, gammas=(0.6, 0.99))
    assume(answer.other is not None)
    doors = [next(of for of in REGIONS.doorways if of.name == way.doors[0]) for way in (answer.best, answer.other)]

    def sign(gamma):
        one, other = (worth_through(at_gamma(model, gamma), door, slip) for door in doors)
        return int(one > other + ALIKE) - int(one < other - ALIKE)

    assert check(answer.over_gamma, sign) & {1, -1}


@pytest.mark.no_cover
@settings(deadline=None, max_examples=10)
@given(
    st.sampled_from(CELLS), st.sampled_from(CELLS), st.sampled_from(REGIONS.region_names), st.sampled_from([4, 8]),
    st.sampled_from([100.0, 0.0]),
)  # fmt: skip
def test_verdicts_on_stops_hold_for_each_gamma(start, goal, stop, directions, paid):
    assume(start != goal)
    model = qualrl.build(
        REGIONS, list(goal), start=list(start), gamma=0.9, slip=0.2, directions=directions, goal_reward=paid
    )
    world, states = model.grid, states_at(model, stop)
    onward = world.successor.astype(int)
    before_goal = np.where(onward == world.goal, np.arange(len(world))[:, None], onward)
    assume(len(states))

    def sign(gamma):
        paid = world.move_reward, world.goal, world.goal_reward, gamma, [world.slip], np.min
        best = iterated(onward, *paid)
        fixed = np.full(len(world), np.nan)
        fixed[states] = best[states]
        ahead = best[model.start] - iterated(before_goal, *paid, fixed)[model.start]
        return int(ahead > ALIKE) - int(ahead < -ALIKE)

    answer = qualrl.questions.why_not(model, stop, gammas=(0.5, 0.98))
    assert check(answer.over_gamma, sign) <= {0, 1}


def test_where_two_doorways_change_places_both_verdicts_are_found():
    """Slips to the side cost steps in the hall, none in the passage, which is longer: who is patient takes it."""
    model = qualrl.build(qualrl.segment(grid_of(ALONG_OR_ROUND)), [13, 25], start=[6, 2], gamma=0.97, slip=0.2)
    answer = qualrl.questions.why(model, gammas=(0.3, 0.99))
    found = answer.over_gamma
    assert [of.sign for of in found.verdicts] == [1, 0, -1]
    narrow = found.verdicts[1]
    assert 0.8 < narrow.low < narrow.high < narrow.low + 0.001
    doors = [
        next(of for of in model.regions.doorways if of.name == way.doors[0]) for way in (answer.best, answer.other)
    ]
    for gamma, sign in ((narrow.low, 1), (narrow.high, -1)):
        one, other = (worth_through(at_gamma(model, gamma), door, 0.2) for door in doors)
        assert sign * (one - other) > 0
    line = answer.explain().splitlines()[-1]
    one, other = (f"the way by {door.name}" for door in doors)
    ends = f"{narrow.low:.6g}", f"{narrow.high:.6g}"
    assert line == (
        f"If slips may not change which doorway it is, worth more is {one} for gamma from 0.3 to {ends[0]}, "
        f"{other} for gamma from {ends[1]} to 0.99: proved; undecided from {ends[0]} to {ends[1]}."
    )
    signs = answer.explain("signs").splitlines()[-1]
    assert not re.search(r"\d", signs.replace(doors[0].name, "").replace(doors[1].name, "").replace(answer.at, ""))
    assert "undecided" in signs
    assert "gamma" not in answer.explain("names")


def test_the_plan_s_own_doorway_is_told_what_it_is_worth_if_slips_may_not_change_it():
    model = qualrl.build(qualrl.segment(grid_of(ALONG_OR_ROUND)), [13, 25], start=[6, 2], gamma=0.97, slip=0.2)
    answer, regions = qualrl.questions.why(model), model.regions
    one, other = (
        worth_through(model, next(of for of in regions.doorways if of.name == way.doors[0]), 0.2)
        for way in (answer.best, answer.other)
    )
    assert answer.bound.value == pytest.approx(one, abs=1e-8)
    assert one < other == pytest.approx(answer.other.value, abs=1e-8)
    told = (
        f"bound to {answer.best.doors[0]}, the others shut to slips, too, it would be worth {answer.bound.value:.6g}."
    )
    assert told in answer.explain()
    assert "it would be worth less." in answer.explain("signs")
    assert "bound to" not in answer.explain("names")
    step = qualrl.plan(model).steps[0]
    assert step.margin < 0
    assert step.free_value == pytest.approx(answer.best.value)
    assert f"worth {step.free_value:.6g}; bound to {answer.best.doors[0]}, the others shut" in step.reason
    assert f"{-step.margin:.3g} less than bound to {answer.other.doors[0]}" in step.reason
    assert "learned" not in step.reason
    assert qualrl.questions.why(at_gamma(model, 0.97).with_closed([answer.other.doors[0]])).bound is None


def test_what_is_looked_for_too_long_is_undecided(monkeypatch):
    monkeypatch.setattr(over_gamma, "MOST_SOLVED", 6)
    model = qualrl.build(qualrl.segment(grid_of(ALONG_OR_ROUND)), [13, 25], start=[6, 2], gamma=0.97, slip=0.2)
    found = qualrl.questions.why(model, gammas=(0.3, 0.99)).over_gamma
    assert len(found.solved) == 6
    assert any(of.sign == 0 and of.high - of.low > 0.05 for of in found.verdicts)
    alike = found.in_words("a", "b", qualrl.answers.depth.Depth.NUMBERS)
    assert "; undecided from " in alike


def test_where_both_are_the_same_it_is_undecided():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95, slip=0.2)
    here = model.region_names[int(model.region_of[model.start])]
    answer = qualrl.questions.why_not(model, here, gammas=(0.5, 0.95))
    assert [of.sign for of in answer.over_gamma.verdicts] == [0]
    assert len(answer.over_gamma.solved) == over_gamma.FIRST_SOLVED
    assert f"which of the best of all and the best by {here} is worth more is undecided" in answer.explain()


@pytest.mark.parametrize(
    ("gammas", "motion", "message"),
    [
        ((0.5, 0.9), {}, "no move slips"),
        ((0.9, 0.5), {"slip": 0.1}, "the lower end first"), ((0.0, 0.5), {"slip": 0.1}, r"within \(0, 1\)"),
        ((0.5, 1.0), {"slip": 0.1}, r"within \(0, 1\)"), ((0.5, 0.5), {"slip": 0.1}, "from a smaller one"),
        ((1e-12, 0.5), {"slip": 0.1}, "gamma 1e-12 is too small"),
        ((0.9, 0.9000000000000002), {"slip": 0.1}, "is too narrow"),
    ],
)  # fmt: skip
def test_what_no_range_can_be_told_about_is_refused(gammas, motion, message):
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.9, **motion)
    with pytest.raises(SettingError, match=message):
        qualrl.questions.why(model, gammas=gammas)
    with pytest.raises(SettingError, match=message):
        qualrl.questions.why_not(model, REGIONS.region_names[-1], gammas=gammas)


def test_a_range_that_is_none_is_refused_where_there_is_nothing_to_choose_too():
    with pytest.raises(SettingError, match="the lower end first"):
        qualrl.questions.why(qualrl.build(REGIONS, [2, 24], start=[2, 22], slip=0.1), gammas=(0.9, 0.5))


def test_the_command_answers(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text(
        "map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {gamma: 0.9}\nmotion: {slip: 0.2}\n"
    )
    for asked, key in ((("why",), "other"), (("why-not", "--via", REGIONS.region_names[-1]), "by")):
        command = asked[0], "loop.scenario.yaml", *asked[1:], "--gamma", "0.5..0.99"
        document = json.loads(qualrl_command(*command, "--json", cwd=tmp_path)[0])
        assert qualrl_command(*command, cwd=tmp_path)[0].splitlines() == document["sentences"]
        found = document["over_gamma"]
        assert {of["better"] for of in found["verdicts"]} <= {"best", key, "undecided"}
        assert [found["solved"][at]["gamma"] for at in (0, -1)] == pytest.approx([0.5, 0.99])
        assert document["sentences"][-1].endswith("is worth more: proved.")
        _, error = qualrl_command(*command[:-1], "0.5..x", cwd=tmp_path, expect=2)
        assert "--gamma: 'x' is no number" in error
