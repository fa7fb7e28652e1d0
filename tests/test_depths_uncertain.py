"""Answers at three depths about what is uncertain or learned; see ``test_depths``."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.robust import EITHER
from qualrl.errors import NoPlanError, SettingError
from qualrl.qualitative.from_counts import Counts, Samples
from tests.test_depths import DOORS, ENDS, REGIONS, check_depths, less_or_more, model_of

UNCERTAIN = st.fixed_dictionaries(
    {
        "doors": st.dictionaries(
            st.sampled_from(DOORS), st.sampled_from([(0.0, 0.0), (0.2, 0.7), (0.6, 1.0), (1.0, 1.0), Counts(7, 10)]),
            min_size=1, max_size=2,
        ),
        "times": st.dictionaries(
            st.sampled_from([*REGIONS.region_names, "*"]),
            st.sampled_from([(1.0, 1.0), (1.0, 1.5), (0.5, 1.5), (2.0, 3.0), Samples((1.1, 0.9, 1.4))]), max_size=2,
        ),
    }
)  # fmt: skip


@settings(deadline=None, max_examples=30)
@given(ENDS, UNCERTAIN)
def test_robust(ends, uncertain):
    model = model_of(ends, {"gamma": 0.95})
    answer = qualrl.questions.robust(model, **uncertain)
    signs, document = check_depths(answer), answer.to_dict()
    for name, (least, most) in document["doors"].items():
        (kind,) = re.findall(rf"chance that {name} is open (?:is given|was counted): that it is open is (\w+)", signs)
        expected = "certain" if least == 1 else "likely" if least > 0.5 else "possible" if most > 0 else "impossible"
        assert kind == expected
    for order in document["orders"]:
        one, other = (f"way {at}" for at in order["ways"])
        words = {
            "better": f"Certain: {one} is better than {other},", "worse": f"Certain: {other} is better than {one},",
            "never worse": f"Certain: {one} is never worse than {other}",
            "never better": f"Certain: {other} is never worse than {one}",
            "equal": f"Certain: {one} and {other} are worth the same,",
            "either": f"Possible: {one} is better than {other} ",
            "undecided": f"Undecided: whether {one} or {other} is better.",
        }  # fmt: skip
        assert words[order["relation"]] in signs
        if order["change"] is not None:
            assert order["relation"] == EITHER
            key, _ = order["change"]
            is_larger = order["better_at"][key] > order["worse_at"][key]
            (line,) = [line for line in signs.splitlines() if line.startswith(words["either"])]
            asks_for_more = "more likely" in line or "more time" in line
            assert asks_for_more == (is_larger != (" steps in " in key))
    for name in ("names", "signs"):
        assert f"Best in the worst case: way {document['safest']}." in answer.explain(name)


@pytest.mark.parametrize(
    ("known", "ways", "words"),
    [
        ({"doors": {"door 1": (0.3, 0.8)}}, (1, 2), "door 1 more likely open"),
        ({"times": {"room A": (0.5, 1.6)}}, (2, 3), "room A taking less time"),
        ({"times": {"room A": Samples((1.1, 0.9, 1.4))}}, (1, 4), "steps in room A taking less time"),
    ],
)
def test_which_way_a_number_that_decides_must_go(known, ways, words):
    answer = qualrl.questions.robust(model_of(((2, 2), (2, 24)), {"gamma": 0.95}), **known)
    line = f"Possible: way {ways[0]} is better than way {ways[1]} with {words}, for others worse."
    assert line in check_depths(answer).splitlines()


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ((1.0, 1.0), "as long"),
        ((1.0, 1.5), "as long or longer"),
        ((0.5, 1.5), "shorter or longer"),
        (Samples((1.2, 1.5)), "longer"),
    ],
)
def test_times_known_as_intervals(times, words):
    answer = qualrl.questions.robust(model_of(((2, 2), (2, 24)), {"gamma": 0.95}), times={"room A": times})
    how = "was measured" if isinstance(times, Samples) else "is given"
    assert f"  the time of room A {how}: {words}, compared with the map" in answer.explain("signs").splitlines()
    assert f"  the time of room A {how}" in answer.explain("names").splitlines()


@settings(deadline=None, max_examples=10)
@given(ENDS, st.sampled_from([(0.0, 0.4), (0.05, 0.3), (0.1, 0.1), Counts(3, 40)]), st.sampled_from([0.5, 0.95]))
def test_robust_against_slips(ends, slip, gamma):
    model = model_of(ends, {"gamma": gamma})
    try:
        answer = qualrl.questions.robust(model, slip=slip)
    except (NoPlanError, SettingError):  # both in one region
        return
    signs, document = check_depths(answer), answer.to_dict()
    of_pair = {}
    for verdict in document["verdicts"]:
        of_pair.setdefault(tuple(verdict["ways"]), []).append(verdict["relation"])
    lines = [line for line in signs.splitlines() if line.startswith(("Certain", "Possible", "Undecided"))]
    for ((one, other), relations), line in zip(of_pair.items(), lines, strict=True):
        better = {"better": f"{one} is better than {other}", "worse": f"{other} is better than {one}"}
        told = [better.get(relation, "undecided") for relation in relations]
        if len(told) > 1:
            spans = [f"{told[0]} for small probabilities", *told[1:-1], f"{told[-1]} for large probabilities"]
            assert line.endswith(f": {', then '.join(spans)}.")
        elif told == ["undecided"]:
            assert line == f"Undecided: whether {one} or {other} is better."
        else:
            assert line == f"Certain: {told[0]}, whatever the probability is."


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        ("q-learning", {"episodes": 3}),
        ("hql-replay", {"episodes": 20}),
        ("td", {"episodes": 5}),
        ("sarsa", {"episodes": 9}),
    ],
)
@pytest.mark.parametrize("slip", [0.0, 0.2])
def test_how_sure(algorithm, settings, slip):
    run = qualrl.train(model_of(((2, 2), (2, 24)), {"gamma": 0.95, "slip": slip}), algorithm, seed=2, **settings)
    answer = run.how_sure()
    signs, document = check_depths(answer), answer.to_dict()
    wrong = less_or_more(document["learned"] - document["exact"], document["exact"])
    assert f": learned {({-1: 'too low', 0: 'right', 1: 'too high'})[wrong]}." in signs
    for part in document["regions"]:
        line = next(line for line in signs.splitlines() if line.startswith(f"{part['name']}: "))
        some = "all" if part["visited"] == part["states"] else "some" if part["visited"] else "none"
        assert f": {some} of the states visited" in line
        if part["visited"] and part["optimal"] is not None:
            kinds = ("settled", "unsettled", "wrong", "equal", "untried")
            frequent = sorted((kind for kind in kinds if part[kind]), key=lambda kind: -part[kind])
            words = {"unsettled": "not settled", "untried": "not both known"}
            assert line.endswith(f": {', '.join(words.get(kind, kind) for kind in frequent)}")
    wrong = [part for part in document["regions"] if part["mean_error"]]
    worst = [part["name"] for part in sorted(wrong, key=lambda part: -part["mean_error"])]
    assert (f"the largest first: {', '.join(worst)}." in signs) == (len(worst) > 1)
