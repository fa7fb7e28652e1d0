"""Doorways while slips are known as an interval only: against value iteration in numpy, state by state."""

import json

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import robust_slip
from qualrl.errors import NoPlanError, SettingError
from qualrl.models.grid_world import GridWorld
from qualrl.qualitative.from_counts import Counts
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import exact_values
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import free_masks, grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
GAMMA = 0.9


def iterated(successor, reward, goal, goal_reward, gamma, slips, pick, fixed=None):
    """Values by plain iteration; pick: np.min or np.max over the slips; fixed: values of states that keep them."""
    n, moves = successor.shape
    value = np.zeros(n) if fixed is None else np.where(np.isfinite(fixed), fixed, 0.0)
    stays = np.zeros(n, bool) if fixed is None else np.isfinite(fixed)
    stays[goal] = True
    value[goal] = 0.0
    for _ in range(10_000):
        worth = np.where(successor == goal, goal_reward, reward + gamma * value[successor])
        others = (worth.sum(axis=1, keepdims=True) - worth) / (moves - 1)
        q = pick([(1 - slip) * worth + slip * others for slip in slips], axis=0)
        new = np.where(stays, value, q.max(axis=1))
        if np.abs(new - value).max() < 1e-13:
            break
        value = new
    return new


def values_of(world, slips, pick):
    return iterated(
        world.successor.astype(int), world.move_reward, world.goal, world.goal_reward, world.gamma, slips, pick
    )


SPANS = st.tuples(st.integers(0, 75), st.integers(0, 75)).map(lambda ends: tuple(end / 100 for end in sorted(ends)))


@settings(deadline=None, max_examples=50)
@given(free_masks(7), st.randoms(use_true_random=False), SPANS, st.sampled_from([4, 8]))
def test_the_ends_of_a_span_are_the_values_of_an_interval_mdp(free, random, span, directions):
    """Of one in which each step slips with whatever probability of the span is worst for the robot, or best."""
    cell = tuple(map(int, random.choice(np.argwhere(free).tolist())))
    for slip, pick in ((span[1], np.min), (span[0], np.max)):
        world = GridWorld(free, cell, GAMMA, slip, directions)
        reaches = world.steps_to_goal >= 0
        found, expected = exact_values(world).value[reaches], values_of(world, span, pick)[reaches]
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-8)


def worth_through(model, door, slip):
    """Of leaving the start's region by a doorway, its others shut, and the best way from there on."""
    world, regions = model.grid, model.regions
    onward = world.successor.astype(int)
    whole = iterated(onward, world.move_reward, world.goal, world.goal_reward, world.gamma, [slip], np.min)
    region = model.region_of[model.start]
    own = {tuple(sorted(world.state_of[cell] for cell in ends)) for ends in crossings_of(regions, door)}
    shut = onward.copy()
    for state in np.flatnonzero(model.region_of == region):
        for move, to in enumerate(onward[state]):
            if model.region_of[to] != region and tuple(sorted((state, to))) not in own:
                shut[state, move] = state
    fixed = np.where(model.region_of == region, np.nan, whole)
    inside = iterated(shut, world.move_reward, world.goal, world.goal_reward, world.gamma, [slip], np.min, fixed)
    return inside[model.start]


@settings(deadline=None, max_examples=15)
@given(
    st.sampled_from([tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]),
    st.sampled_from([tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]),
    SPANS,
)
def test_verdicts_hold_for_every_slip_of_their_span(start, goal, span):
    assume(REGIONS.label[start] != REGIONS.label[goal])
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=GAMMA)
    answer = qualrl.questions.robust(model, slip=span)
    door_named = {door.name: door for door in REGIONS.doorways}
    for slip in np.linspace(*span, 4).tolist():
        worth = {name: worth_through(model, door_named[name], slip) for name in answer.worth}
        for name, (least, most) in answer.worth.items():
            assert least - 1e-7 <= worth[name] <= most + 1e-7
        for (one, other), verdicts in answer.verdicts.items():
            assert [of.low for of in verdicts[1:]] == [of.high for of in verdicts[:-1]]
            assert (verdicts[0].low, verdicts[-1].high) == span
            for of in verdicts:
                if of.low <= slip <= of.high and of.relation != "undecided":
                    assert (worth[one] > worth[other]) == (of.relation == "better")
                tried, *better = of.tried
                assert 1 <= tried <= robust_slip.MOST_SLIPS
                if of.relation != "undecided":
                    assert better == ([tried, 0] if of.relation == "better" else [0, tried])


ALONG_OR_ROUND = """
###############################
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.............................#
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.....#.................#.....#
#.....###################.....#
#.....###################.....#
#.............................#
#.....###################.....#
###############################
"""


def test_where_two_doorways_change_places_both_verdicts_are_found():
    """Slips to the side cost steps in the hall, none in the passage, which is a little longer."""
    model = qualrl.build(qualrl.segment(grid_of(ALONG_OR_ROUND)), [13, 25], start=[6, 2], gamma=0.95)
    answer = qualrl.questions.robust(model, slip=(0.0, 0.5))
    ((pair, verdicts),) = answer.verdicts.items()
    assert [of.relation for of in verdicts] == ["worse", "undecided", "better"]
    for slip, sign in ((verdicts[0].high, -1), (verdicts[2].low, 1)):
        worth = [
            worth_through(model, door, slip) for name in pair for door in model.regions.doorways if door.name == name
        ]
        assert sign * (worth[0] - worth[1]) > 0
    assert "Possible: " in answer.explain()
    assert "; undecided from " in answer.explain()


def test_where_it_is_settled_too_late_it_is_undecided(monkeypatch):
    monkeypatch.setattr(robust_slip, "MOST_SLIPS", 1)
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=GAMMA)
    answer = qualrl.questions.robust(model, slip=(0.0, 0.7))
    ((pair, (verdict,)),) = answer.verdicts.items()
    door_named = {door.name: door for door in REGIONS.doorways}
    worth = [[worth_through(model, door_named[name], slip) for name in pair] for slip in (0.0, 0.35, 0.7)]
    better, worse = sum(one > other for one, other in worth), sum(one < other for one, other in worth)
    assert verdict.tried == (3, better, worse)
    said = f"{pair[0]} is better at {better}, {pair[1]} at {worse}."
    assert f"Undecided: whether {' or '.join(pair)} is better; of 3 probabilities tried, {said}" in answer.explain()


def test_where_two_ways_are_always_as_good_nothing_is_halved():
    wall, gap = "#.....#.....#", "#...........#"
    mirrored = "\n".join(["#" * 13, wall, gap, wall, wall, wall, gap, wall, "#" * 13])
    model = qualrl.build(qualrl.segment(grid_of(mirrored)), [4, 10], start=[4, 2], gamma=GAMMA)
    ((verdict,),) = qualrl.questions.robust(model, slip=(0.1, 0.4)).verdicts.values()
    assert (verdict.relation, verdict.tried) == ("undecided", (3, 0, 0))


NEARLY_MIRRORED = """
#########
#.......#
#.......#
##.....##
#.......#
#.......#
#.......#
#.......#
#.#####.#
#.......#
#..#.#..#
#.......#
#.......#
#.......#
#.......#
#.......#
#########
"""


def test_a_span_that_has_no_middle_is_not_halved():
    """Its two ends are numbers next to each other; it once was halved for ever."""
    rooms = qualrl.segment(grid_of(NEARLY_MIRRORED))
    model = qualrl.build(rooms, [14, 4], start=[2, 4], gamma=0.9999, directions=8)
    ((verdict,),) = qualrl.questions.robust(model, slip=(0.1, np.nextafter(0.1, 1.0).item())).verdicts.values()
    assert (verdict.relation, verdict.tried) == ("undecided", (2, 0, 0))
    alone = qualrl.questions.robust(model, slip=(0.1, 0.1)).explain()
    assert "even if the probability is another" not in alone
    assert "of 1 probability tried" in alone


def test_a_count_of_slips_is_an_interval():
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=GAMMA)
    answer = qualrl.questions.robust(model, slip=Counts(3, 40), confidence=0.9)
    assert answer.slip == Counts(3, 40).interval(0.9)
    assert "(3 of 40 moves did; confidence 0.9)" in answer.explain()


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"slip": (0.2, 0.1)}, "the lower end first"),
        ({"slip": (0.2, 0.8)}, "from 0 to 0.75"),
        ({"slip": (0.2, 0.3), "confidence": 0.0}, "confidence must be"),
        ({"slip": (0.2, 0.3), "times": {"*": (1, 2)}}, "not both"),
    ],
)
def test_what_is_no_interval_of_slips_is_refused(asked, message):
    with pytest.raises(SettingError, match=message):
        qualrl.questions.robust(qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=GAMMA), **asked)


def test_where_there_is_only_staying_it_is_told_what_that_is_worth():
    one_room = qualrl.build(qualrl.segment(grid_of("#####\n#...#\n#...#\n#####")), [1, 1], start=[2, 3], gamma=GAMMA)
    answer = qualrl.questions.robust(one_room, slip=(0.1, 0.2))
    ((name, (least, most)),) = answer.worth.items()
    assert name == "staying in room A"
    assert answer.verdicts == {}
    for slip, expected in ((0.1, most), (0.2, least)):
        assert values_of(one_room.grid, [slip], np.max)[one_room.start] == pytest.approx(expected, abs=1e-6)
    assert f"Staying in room A is worth {least:.6g} to {most:.6g}." in answer.explain()


def test_where_no_doorway_is_to_be_chosen_it_says_so():
    with pytest.raises(SettingError, match="start and goal are the same"):
        qualrl.questions.robust(qualrl.build(REGIONS, [2, 24], start=[2, 24], gamma=GAMMA), slip=(0.1, 0.2))
    model = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=GAMMA).with_closed(
        [door.name for door in REGIONS.doorways]
    )
    with pytest.raises(NoPlanError, match="no way leads"):
        qualrl.questions.robust(model, slip=(0.1, 0.2))


def test_the_command_answers(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {gamma: 0.9}\n")
    asked = "robust", "loop.scenario.yaml", "--slip", "0.05..0.3"
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    said = qualrl_command(*asked, cwd=tmp_path)[0].splitlines()
    assert said == document["sentences"]
    assert document["slip"] == [0.05, 0.3]
    for door, (least, most) in document["ways"].items():
        assert f"Leaving {document['region']} by {door} is worth {least:.6g} to {most:.6g}." in said
    safest = max(document["ways"], key=lambda door: document["ways"][door][0])
    assert said[-1].startswith(f"Best in the worst case: {safest}, worth at least {document['ways'][safest][0]:.6g} ")
    _, error = qualrl_command("robust", "loop.scenario.yaml", "--slip", "3/x", cwd=tmp_path, expect=2)
    assert "--slip '3/x': write a count in whole numbers" in error
