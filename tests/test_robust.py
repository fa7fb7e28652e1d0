"""Ways with uncertain doorways and times: against a robot of networkx's that walks them, and the command's answers."""

import itertools
import json
import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.known import between
from qualrl.answers.rivals import rivals
from qualrl.answers.uncertain import Uncertain
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.qualitative.from_counts import Counts, Samples
from tests.command_here import qualrl as qualrl_command
from tests.oracles_robust import Robot
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import TWO_ROOMS, grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
DOORS = [door.name for door in REGIONS.doorways]
GAMMA = 0.95


def model_of(start, goal, **settings):
    return qualrl.build(REGIONS, list(goal), start=list(start), gamma=GAMMA, **settings)


def spans(ends):
    return st.tuples(ends, ends).map(lambda pair: tuple(sorted(pair)))


CASES = st.fixed_dictionaries(
    {
        "start": st.sampled_from(CELLS),
        "goal": st.sampled_from(CELLS),
        "doors": st.dictionaries(st.sampled_from(DOORS), spans(st.integers(0, 4).map(lambda n: n / 4)), max_size=3),
        "times": st.dictionaries(
            st.sampled_from(REGIONS.region_names), spans(st.integers(2, 8).map(lambda n: n / 4)), max_size=2
        ),
    }
)


def points(case, n):
    """Some numbers of the intervals, the corners among them."""
    names = [*case["doors"], *case["times"]]
    ends = [
        np.linspace(*span, n if span[0] < span[1] else 1) for span in [*case["doors"].values(), *case["times"].values()]
    ]
    for chosen in itertools.product(*ends):
        told = dict(zip(names, map(float, chosen), strict=True))
        yield {name: told[name] for name in case["doors"]}, {name: told[name] for name in case["times"]}


def ask(case, **settings):
    assume(case["start"] != case["goal"])
    assume(case["doors"] or case["times"])
    never = [name for name, (_, most) in case["doors"].items() if most == 0]
    robot = Robot(REGIONS, case["start"], case["goal"], GAMMA, never=never)
    answer = qualrl.questions.robust(
        model_of(case["start"], case["goal"]), doors=case["doors"], times=case["times"], **settings
    )
    for rival in answer.rivals:
        assume(robot.worth(rival.way.doors, *next(points(case, 1))) is not None)
    return robot, answer


@settings(deadline=None, max_examples=40)
@given(CASES)
def test_with_numbers_that_are_known_a_way_is_worth_what_the_robot_gets(case):
    known = {
        **case, "doors": {name: (low, low) for name, (low, _) in case["doors"].items()},
        "times": {name: (high, high) for name, (_, high) in case["times"].items()},
    }  # fmt: skip
    robot, answer = ask(known)
    for rival in answer.rivals:
        expected = robot.worth(rival.way.doors, *next(points(known, 1)))
        assert rival.least == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert rival.most == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert rival.way.steps == robot.steps(case["start"], rival.way.doors)


@settings(deadline=None, max_examples=40)
@given(CASES)
def test_nothing_in_the_intervals_contradicts_the_answer(case):
    robot, answer = ask(case)
    ways = [rival.way.doors for rival in answer.rivals]
    best_somewhere = set()
    for point in points(case, 3):
        worths = [robot.worth(way, *point) for way in ways]
        for rival, worth in zip(answer.rivals, worths, strict=True):
            assert rival.least - 1e-7 <= worth <= rival.most + 1e-7
        best_somewhere |= {at for at, worth in enumerate(worths) if worth >= max(worths) - 1e-9}
        for (one, other), order in answer.orders.items():
            ahead = worths[one] - worths[other]
            assert ahead >= -1e-9 or order.relation not in ("never worse", "equal")
            assert ahead <= 1e-9 or order.relation not in ("never better", "equal")
            assert ahead > 1e-9 or order.relation != "better"
            assert ahead < -1e-9 or order.relation != "worse"
        if answer.others is not None:
            told = {*ways}
            for way in robot.ways(case["start"]):
                if way not in told:
                    worth = robot.worth(way, *point)
                    assert worth is None or worth <= answer.others + 1e-7
    for at, rival in enumerate(answer.rivals):
        assert at not in best_somewhere or rival.best != "never"
        assert rival.best != "tied" or not is_alone_best(robot, ways, at, case)
        if rival.best == "certain":
            assert all(
                robot.worth(ways[at], *point) >= max(robot.worth(way, *point) for way in ways) - 1e-7
                for point in points(case, 3)
            )


def is_alone_best(robot, ways, at, case):
    """Whether a way is better than all others somewhere, not only as good."""
    for point in points(case, 3):
        worths = [robot.worth(way, *point) for way in ways]
        if all(worths[at] > worth + 1e-9 for other, worth in enumerate(worths) if other != at):
            return True
    return False


@settings(deadline=None, max_examples=40)
@given(CASES)
def test_either_way_is_shown_to_be_better_somewhere(case):
    robot, answer = ask(case)
    base = {name: span[0] for name, span in {**case["doors"], **case["times"]}.items()}
    for (one, other), order in answer.orders.items():
        ways = answer.rivals[one].way.doors, answer.rivals[other].way.doors
        for point, sign in ((order.at_better, 1), (order.at_worse, -1), (order.at_equal, 0)):
            if point is not None:
                told = {**base, **point}
                chance = {name: told[name] for name in case["doors"]}
                worths = [robot.worth(way, chance, {name: told[name] for name in case["times"]}) for way in ways]
                ahead = worths[0] - worths[1]
                assert sign * ahead > 0 if sign else ahead == pytest.approx(0, abs=1e-9)
        assert order.relation != "either" or (order.at_better and order.at_worse)


@settings(deadline=None, max_examples=40)
@given(CASES)
def test_rivals_come_with_falling_bounds_and_none_is_left_out(case):
    assume(case["start"] != case["goal"])
    model = model_of(case["start"], case["goal"])
    never = [name for name, (_, most) in case["doors"].items() if most == 0]
    robot = Robot(REGIONS, case["start"], case["goal"], GAMMA, never=never)
    found = list(rivals(model, model.start, Uncertain(case["doors"], case["times"])))
    bounds = [bound for bound, _ in found]
    assert bounds == sorted(bounds, reverse=True)
    assert {way for _, way in found} == {*robot.ways(case["start"])}
    for bound, way in found:
        for point in points(case, 2):
            worth = robot.worth(way, *point)
            assert worth is None or worth + 1 / (1 - GAMMA) <= bound + 1e-9


def test_the_chance_at_which_two_ways_change_places_is_the_break_even_of_what_if():
    model = model_of((1, 1), (1, 24))
    door = qualrl.plan(model).steps[0].action.split(" to ")[0].removeprefix("go through ")
    even = qualrl.questions.what_if(model, close=door).trying
    answer = qualrl.questions.robust(model, doors={door: (0.0, 1.0)})
    ((key, number),) = {change for change in answer.changes.values() if change[0] == door}
    assert key == door
    assert number == pytest.approx(even.break_even.at(GAMMA))


NEAR_ONE = st.sampled_from([1 - 1e-5, 1 - 1e-7, 1 - 1e-9])


@settings(deadline=None, max_examples=40)
@given(CASES, NEAR_ONE)
def test_near_gamma_1_nothing_is_said_that_exact_arithmetic_denies(case, gamma):
    assume(case["start"] != case["goal"])
    assume(case["doors"])
    model = qualrl.build(REGIONS, list(case["goal"]), start=list(case["start"]), gamma=gamma)
    never = [name for name, (_, most) in case["doors"].items() if most == 0]
    robot = Robot(REGIONS, case["start"], case["goal"], Fraction(gamma), Fraction(100), never)
    answer = qualrl.questions.robust(model, doors=case["doors"])
    for chance, _ in points({**case, "times": {}}, 3):
        exactly = {name: Fraction(number) for name, number in chance.items()}
        worths = [robot.worth(rival.way.doors, exactly, {}) for rival in answer.rivals]
        assume(None not in worths)
        for (one, other), order in answer.orders.items():
            ahead = worths[one] - worths[other]
            assert ahead > 0 or order.relation != "better"
            assert ahead < 0 or order.relation != "worse"
            assert ahead == 0 or order.relation != "equal"
            assert ahead >= 0 or order.relation != "never worse"
            assert ahead <= 0 or order.relation != "never better"


TWO = """
###############################
#.........#.........#.........#
#.........#.........#.........#
#.........#.........#.........#
#.............................#
#.........#.........#.........#
#.........#.........#.........#
#.........#.........#.........#
####.####################.#####
#.............................#
###############################
"""


def test_near_gamma_1_ways_are_told_apart_by_what_they_pay():
    """Worths are shifted by 10^9, beside which a difference of 0.1 is small."""
    model = qualrl.build(qualrl.segment(grid_of(TWO)), [4, 29], start=[4, 1], gamma=1 - 1e-9)
    answer = qualrl.questions.robust(model, doors={"door 1": (0.54, 0.55)})
    (order,) = answer.orders.values()
    assert order.relation == "either"
    ((_, number),) = answer.changes.values()
    assert number == pytest.approx(6 / 11, abs=1e-6)
    assert [rival.best for rival in answer.rivals] == ["possible", "possible"]
    for span, relation in (((0.5, 0.545), "worse"), ((0.546, 0.6), "better")):
        (order,) = qualrl.questions.robust(model, doors={"door 1": span}).orders.values()
        assert order.relation == relation


def test_near_gamma_1_what_rounding_may_hide_is_undecided():
    model = qualrl.build(qualrl.segment(grid_of(RING)), [9, 19], start=[1, 1], gamma=1 - 1e-9)
    answer = qualrl.questions.robust(model, doors={"door 1": (0.5, 1)})
    assert [order.relation for order in answer.orders.values()] == ["undecided"]
    assert {rival.best for rival in answer.rivals} == {"possible", "undecided"}


RING = """
#####################
#.........#.........#
#.........#.........#
#...................#
#.........#.........#
#####.########.######
#.........#.........#
#.........#.........#
#...................#
#.........#.........#
#####################
"""


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ({"doors": {"door 1": (0.5, 1)}}, "better with door 1 open with 0.5; as good with door 1 open with 1"),
        ({"times": {"room B": (1, 2)}}, "better with room B 2 times as long; as good with room B 1 times as long"),
    ],
)
def test_two_ways_that_are_as_good_at_one_end_are_not_told_apart_there(known, told):
    regions = qualrl.segment(grid_of(RING))
    model = qualrl.build(regions, [9, 19], start=[1, 1], gamma=GAMMA)
    answer = qualrl.questions.robust(model, **known)
    document = answer.to_dict()
    first, second = (way["steps"] for way in document["ways"])
    assert first == second
    (order,) = document["orders"]
    ahead, behind = (1, 2) if order["relation"] == "never worse" else (2, 1)
    assert order["relation"] in ("never worse", "never better")
    assert f"Certain: way {ahead} is never worse than way {behind}: {told}." in answer.explain()
    shown = f"Certain: way {ahead} is never worse than way {behind}: better for some numbers, for others as good."
    assert shown in answer.explain("signs").splitlines()
    best = [way["best"] for way in document["ways"]]
    assert (best[ahead - 1], best[behind - 1]) == ("certain", "tied")
    for depth in ("names", "signs", "numbers"):
        assert f"Certainly best: way {ahead}.\nAmong the best for some numbers: way {behind}." in answer.explain(depth)


def test_counts_and_measured_times_are_told_with_their_confidence():
    model = model_of((1, 1), (1, 24))
    answer = qualrl.questions.robust(
        model, doors={DOORS[0]: Counts(7, 10)}, times={"*": Samples((1.0, 1.5, 0.8)), "room A": (1, 2)}, confidence=0.9
    )
    said = answer.explain()
    low, high = Counts(7, 10).interval(0.95)  # two are counted, so each may be missed half as often
    assert f"{DOORS[0]} is open with a probability of {low:.6g} to {high:.6g}, as it was in 7 of 10 cases" in said
    assert "every other region took 0.8 to 1.5 times as long in 3 cases" in said
    assert "what was counted holds with a confidence of 0.9, all of it at once" in said
    assert all(name in REGIONS.region_names or name in DOORS or " steps in " in name for name in answer.box)
    for key, steps in answer.measured.items():
        assert answer.box[key] == Samples((1.0, 1.5, 0.8)).interval(GAMMA**steps, 0.95)


@pytest.mark.parametrize(
    ("ends", "told"),
    [((-4.595251, -4.5952506), "-4.59525"), ((0.5, 0.5), "0.5"), ((0.25, 1), "0.25 to 1"), ((-1e-9, 0), "-1e-09 to 0")],
)
def test_an_interval_whose_ends_read_the_same_is_told_as_one_number(ends, told):
    assert between(*ends) == told


def test_more_ways_than_are_told_are_bounded():
    model = model_of((1, 1), (1, 24))
    every = qualrl.questions.robust(model, times={"*": (1, 2)})
    few = qualrl.questions.robust(model, times={"*": (1, 2)}, most=1)
    assert len(every.rivals) > len(few.rivals) == 1
    assert few.others >= max(rival.most for rival in every.rivals if rival.way != few.rivals[0].way)
    assert "Other ways were not compared" in few.explain()


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({}, "say what is uncertain"),
        ({"doors": {DOORS[0]: (0.5, 1.5)}}, "must be an interval from 0 to 1"),
        ({"doors": {DOORS[0]: (0.5, 0.4)}}, "the lower end first"),
        ({"times": {"*": (0.0, 1.0)}}, "of at least 0.01"),
        ({"times": {"*": (1.0, float("inf"))}}, "must be an interval"),
        ({"times": {"*": (1.0, 1e6)}}, "gamma 0.95 fades to nothing"),
        ({"times": {"*": (1.0, 2.0)}, "confidence": 1.0}, "confidence must be"),
        ({"doors": dict.fromkeys("abcdefg", (0.5, 1))}, "at most 6"),
    ],
)
def test_what_is_no_interval_is_refused(asked, message):
    with pytest.raises(SettingError, match=message):
        qualrl.questions.robust(model_of((1, 1), (1, 24)), **asked)


def test_what_is_not_on_the_map_is_refused():
    model = model_of((1, 1), (1, 24))
    with pytest.raises(UnknownNameError, match="no doorway is called 'door 99'"):
        qualrl.questions.robust(model, doors={"door 99": (0, 1)})
    with pytest.raises(UnknownNameError, match="no region is called"):
        qualrl.questions.robust(model, times={"kitchen": (1, 2)})
    with pytest.raises(SettingError, match=r"set motion\.slip to 0"):
        qualrl.questions.robust(model_of((1, 1), (1, 24), slip=0.1), times={"*": (1, 2)})
    cut = model.with_closed(DOORS)
    with pytest.raises(NoPlanError):
        qualrl.questions.robust(cut, times={"*": (1, 2)})


def test_a_shut_doorway_that_leaves_no_way_is_told():
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    (door,) = [door.name for door in regions.doorways]
    answer = qualrl.questions.robust(qualrl.build(regions, [2, 16], start=[2, 2], gamma=0.95), doors={door: (0.5, 1)})
    assert answer.stranded == ((door,),)
    assert answer.stuck == pytest.approx(-20)
    assert f"Where {door} is shut, no way is left, which is worth -20." in answer.explain()
    assert f"Where {door} is shut, no way is left." in answer.explain("names")
    certain = qualrl.questions.robust(qualrl.build(regions, [2, 16], start=[2, 2], gamma=0.95), times={"*": (1, 2)})
    assert not certain.stranded


def test_a_way_round_does_not_count_on_a_doorway_that_is_never_open():
    model = model_of((1, 1), (1, 24))
    door = qualrl.plan(model).steps[0].action.split(" to ")[0].removeprefix("go through ")
    others = [name for name in DOORS if name != door]
    for never in others:
        told = qualrl.questions.robust(model, doors={door: (0.3, 0.3), never: (0, 0)}).rivals
        gone = qualrl.questions.robust(model.with_closed([never]), doors={door: (0.3, 0.3)}).rivals
        same = {rival.way.doors: rival.least for rival in told}
        for rival in gone:
            assert same.get(rival.way.doors, rival.least) == pytest.approx(rival.least)


def test_measured_legs_of_one_region_are_told_by_numbers_that_one_law_may_have():
    """All of them as far along in their intervals, as a mixture of the fastest law and the slowest is."""
    model = model_of((1, 1), (1, 24))
    answer = qualrl.questions.robust(model, times={"*": Samples((1.0, 1.5, 0.8, 1.1, 1.0, 0.9, 1.3, 1.2))})
    assert any(order.relation == "either" for order in answer.orders.values())
    for order in answer.orders.values():
        for point in (order.at_better, order.at_worse):
            along = {}
            for key, number in (point or {}).items():
                low, high = answer.box[key]
                along.setdefault(key.partition(" steps in ")[2], []).append((number - low) / (high - low))
            for shares in along.values():
                assert shares == pytest.approx([shares[0]] * len(shares))


def test_of_ways_that_are_not_all_compared_none_is_called_best_of_all():
    answer = qualrl.questions.robust(model_of((1, 1), (1, 24)), times={"*": (1, 2)}, most=1)
    assert "Certainly best of these ways: way 1." in answer.explain()
    assert "Best of these ways in the worst case" in answer.explain()


@pytest.mark.parametrize(
    "asked",
    [
        {"doors": {DOORS[0]: 0.5}}, {"doors": {DOORS[0]: "0.5..0.6"}}, {"doors": {DOORS[0]: (0.1, 0.2, 0.3)}},
        {"doors": {DOORS[0]: None}}, {"doors": {DOORS[0]: Samples((1.0,))}},
        {"doors": [DOORS[0]]}, {"doors": {8: (0, 1)}},
        {"times": {"*": Counts(1, 2)}}, {"times": {"*": (1, 2)}, "confidence": "0.9"},
        {"times": {"*": (1, 2)}, "most": 0},
        {"times": {"*": (1, 2)}, "most": 1.5}, {"slip": 0.1}, {"slip": "0.1"},
    ],
)  # fmt: skip
def test_what_is_of_the_wrong_kind_is_refused(asked):
    with pytest.raises(SettingError):
        qualrl.questions.robust(model_of((1, 1), (1, 24)), **asked)


def test_the_command_answers_and_refuses(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {gamma: 0.95}\n")
    door = json.loads(qualrl_command("plan", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])["steps"][0]["action"]
    door = door.split(" to ")[0].removeprefix("go through ")
    asked = "robust", "loop.scenario.yaml", "--chance", f"{door}=0.2..0.9", "--time", "*=1..1.25"
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    said = qualrl_command(*asked, cwd=tmp_path)[0].splitlines()
    assert said == document["sentences"]
    assert document["doors"] == {door: [0.2, 0.9]}
    ways = document["ways"]
    for number, way in enumerate(ways, 1):
        line = next(line for line in said if line.startswith(f"Way {number}: "))
        assert f"{' -> '.join(way['places'])} ({way['steps']} step{'s' * (way['steps'] != 1)}," in line
        assert f"worth {between(way['least'], way['most'])}" in line
    assert (
        f"Best in the worst case: way {document['safest']}, worth at least {max(way['least'] for way in ways):.6g}."
        in said
    )
    told = [(int(a), int(b)) for a, b in re.findall(r"way (\d) is better than way (\d), whatever", "\n".join(said))]
    certain = [
        order["ways"] if order["relation"] == "better" else order["ways"][::-1]
        for order in document["orders"] if order["relation"] in ("better", "worse")
    ]  # fmt: skip
    assert told == [tuple(pair) for pair in certain]
    for wrong, message in (
        (("--chance", door), "write a name, = and what is known"),
        (("--chance", f"{door}=7/x"), "write a count in whole numbers"),
        (("--chance", f"{door}=much"), "'much' is no number"),
        (("--time", "*=1,2,x"), "'x' is no number"),
        (("--chance", f"{door}=0.9..0.2"), "the lower end first"),
        (("--chance", "door 99=0.1..0.2"), "no doorway is called 'door 99'"),
        ((), "say what is uncertain"),
        (("--chance", f"{door}=0.5", "--chance", f"{door}=0.6"), "was given before"),
        (("--chance", f"{door}=1/99999999999999"), "no count"),
        (("--time", "*=1..2", "--set", "start=[2, 24]"), "start and goal are the same"),
    ):
        _, error = qualrl_command("robust", "loop.scenario.yaml", *wrong, cwd=tmp_path, expect=2)
        assert message in error
        assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [("--confidence", "foo", "write a number"), ("--ways", "foo", "write a whole number"), ("--ways", "0", "must be")],
)
def test_wrong_numbers_of_options_are_told_in_plain_words(tmp_path, option, value, told):
    error = qualrl_command("robust", "loop.scenario.yaml", option, value, cwd=tmp_path, expect=2)[1]
    assert told in error
    assert option in error
    assert "nput should" not in error
    assert error.count("\n") == 1
