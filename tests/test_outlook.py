"""Plans with numbers known as intervals: bounds against brute force, orders against corners and samples, and counts."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.stats import binom

from qualrl.errors import SettingError
from qualrl.qualitative import robust_order
from qualrl.qualitative.from_counts import Counts, Samples
from qualrl.qualitative.outlook import Number, Outlook
from qualrl.qualitative.outlook_difference import difference
from qualrl.qualitative.robust_order import (
    BETTER,
    EITHER,
    EQUAL,
    NEVER_BETTER,
    NEVER_WORSE,
    UNDECIDED,
    WORSE,
    change,
    compare,
)

KEYS = ("door 1", "door 2", "hall", "lab")
ROUNDING = 1e-7


def number(leg_of):
    """A chance for a door; for a region, times f of a leg."""
    legs = st.sampled_from([0.9, 0.7, 0.99]) if leg_of == "any" else st.just(None)
    return st.sampled_from(KEYS).flatmap(
        lambda key: st.just(Number(key)) if key.startswith("door") else legs.map(lambda leg: Number(key, leg))
    )


@st.composite
def trees(draw, depth=3, leg_of="any"):
    if depth == 0 or draw(st.integers(0, 4)) == 0:
        return draw(st.sampled_from([None, Outlook(reward=float(draw(st.integers(0, 8))))]))
    then = draw(trees(depth=depth - 1, leg_of=leg_of))
    of = draw(st.none() | number(leg_of))
    fork = of is not None and of.leg is None
    instead = draw(trees(depth=depth - 1, leg_of=leg_of)) if fork else None
    return Outlook(float(draw(st.integers(-2, 6))), draw(st.sampled_from([1.0, 0.9, 0.5])), then, of, instead)


def worth(tree, point):
    """The same sum, the branches of each chance written out."""
    if tree is None:
        return 0.0
    total = tree.reward + tree.discount * worth(tree.then, point)
    if tree.number is None:
        return total
    x = point[tree.number.key]
    if tree.number.leg is not None:
        return total * tree.number.leg**x / tree.number.leg
    return x * total + (1 - x) * worth(tree.instead, point)


BOXES = st.fixed_dictionaries(
    {
        key: st.tuples(st.integers(0, 4), st.integers(0, 4)).map(
            lambda ends, key=key: tuple(sorted(end / 4 if key.startswith("door") else 0.5 + end / 2 for end in ends))
        )
        for key in KEYS
    }
)


def grid(box, n=3):
    ends = [np.linspace(*box[key], n if box[key][0] < box[key][1] else 1).tolist() for key in KEYS]
    return [dict(zip(KEYS, point, strict=True)) for point in itertools.product(*ends)]


@settings(deadline=None, max_examples=60)
@given(trees(), BOXES)
def test_bounds_hold_for_every_number_of_the_box(tree, box):
    assume(tree is not None)
    low, high, at_low, at_high = tree.bounds(box)
    for point in grid(box):
        assert low - ROUNDING <= worth(tree, point) <= high + ROUNDING
        assert tree.value(point) == pytest.approx(worth(tree, point), rel=1e-12, abs=1e-12)
    start = {key: ends[0] for key, ends in box.items()}
    found = list(keys_of(tree))
    assert tree.places == Counter(found)
    if len(found) == len(set(found)):
        assert worth(tree, {**start, **at_low}) == pytest.approx(low, rel=1e-9, abs=1e-9)
        assert worth(tree, {**start, **at_high}) == pytest.approx(high, rel=1e-9, abs=1e-9)


def keys_of(tree):
    if tree is not None:
        yield from [tree.number.key] if tree.number else []
        yield from keys_of(tree.then)
        yield from keys_of(tree.instead)


@settings(deadline=None, max_examples=60)
@given(trees(), trees(), trees(depth=2), BOXES)
def test_a_difference_is_bounded_and_a_common_beginning_cancels(one, other, first, box):
    low, high, _, _ = difference(one, other, box)
    for point in grid(box):
        assert low - ROUNDING <= worth(one, point) - worth(other, point) <= high + ROUNDING
    assert difference(first, first, box)[:2] == (0, 0)


@settings(deadline=None, max_examples=80)
@given(trees(), trees(), BOXES)
def test_an_order_holds_for_every_number_of_the_box(one, other, box):
    assume(one is not None and other is not None)
    order = compare(one, other, box)
    signs = [sign(one, other, point) for point in grid(box)]
    if order.relation in (BETTER, NEVER_WORSE, EQUAL):
        assert min(signs) >= 0
    if order.relation in (WORSE, NEVER_BETTER, EQUAL):
        assert max(signs) <= 0
    if order.relation in (BETTER, WORSE):
        assert 0 not in signs
    start = {key: ends[0] for key, ends in box.items()}
    for point, expected in ((order.at_better, 1), (order.at_worse, -1), (order.at_equal, 0)):
        if point is not None:
            assert all(box[key][0] <= value <= box[key][1] for key, value in point.items())
            assert sign(one, other, {**start, **point}) == expected
    if order.relation == EITHER:
        assert order.at_better
        assert order.at_worse
    assert compare(other, one, box).relation == order.turned().relation


def sign(one, other, point):
    a, b = worth(one, point), worth(other, point)
    return 0 if abs(a - b) <= 1e-8 * max(abs(a), abs(b), 1e-12) else 1 if a > b else -1


@settings(deadline=None, max_examples=60)
@given(trees(leg_of="none"), trees(leg_of="none"), BOXES)
def test_where_the_difference_is_linear_in_each_number_the_corners_decide(one, other, box):
    assume(one is not None and other is not None)
    doors = {key: ends if key.startswith("door") else (1.0, 1.0) for key, ends in box.items()}
    assume(all(tree.times.get(key, 0) <= 1 for tree in (one, other) for key in KEYS))
    signs = {sign(one, other, point) for point in grid(doors, n=2)}
    relation = compare(one, other, doors).relation
    expected = {
        (1,): BETTER, (0, 1): NEVER_WORSE, (0,): EQUAL, (-1, 0): NEVER_BETTER, (-1,): WORSE,
    }.get(tuple(sorted(signs)), EITHER)  # fmt: skip
    assert relation == expected


def test_two_plans_that_change_places_do_so_where_they_are_worth_the_same():
    gate = Outlook(then=Outlook(9.0), number=Number("door 1"), instead=Outlook(1.0))
    sure = Outlook(5.0)
    order = compare(gate, sure, {"door 1": (0.2, 0.9)})
    assert order.relation == EITHER
    assert change(gate, sure, order.at_better, order.at_worse)["door 1"] == pytest.approx(0.5)  # 9 p + 1 - p = 5
    assert compare(gate, sure, {"door 1": (0.51, 0.9)}).relation == BETTER
    assert compare(gate, sure, {"door 1": (0.0, 0.49)}).relation == WORSE
    never_worse = compare(gate, sure, {"door 1": (0.5, 0.9)})
    assert (never_worse.relation, never_worse.at_equal) == (NEVER_WORSE, {"door 1": 0.5})
    never_better = compare(gate, sure, {"door 1": (0.0, 0.5)})
    assert (never_better.relation, never_better.at_equal) == (NEVER_BETTER, {"door 1": 0.5})
    assert compare(gate, gate, {"door 1": (0.0, 0.5)}).relation == EQUAL


def test_what_is_settled_too_late_is_left_undecided():
    """P (1 - p) against 1/4, which it only touches, and against a little more."""
    inner = Outlook(then=None, number=Number("door 1"), instead=Outlook(1.0))
    one, box = Outlook(then=inner, number=Number("door 1")), {"door 1": (0.1, 0.8)}
    assert compare(one, Outlook(0.25), box).relation == UNDECIDED
    assert compare(one, Outlook(0.26), box).relation == WORSE
    assert compare(Outlook(0.26), one, box).relation == BETTER


def test_what_is_left_of_larger_amounts_by_rounding_is_nothing():
    rest = Outlook(0.1 + 0.2 - 0.3, amounts=0.6)
    assert rest.reward > 0
    assert compare(rest, Outlook(), {}).relation == EQUAL
    assert compare(Outlook(1e-14), Outlook(), {}).relation == BETTER
    assert compare(rest, Outlook(), {}, paid=1e-12).relation == UNDECIDED


def test_where_bounds_touch_but_the_plans_do_not_they_are_narrowed(monkeypatch):
    """P p + (1 - p) (1 - p) is 1/2 at least, but bounded by 0 on all of [0, 1]."""
    open_twice = Outlook(then=Outlook(1.0), number=Number("door 1"))
    shut_twice = Outlook(number=Number("door 1"), instead=Outlook(1.0))
    one, box = Outlook(then=open_twice, number=Number("door 1"), instead=shut_twice), {"door 1": (0.0, 1.0)}
    assert difference(one, Outlook(), box)[0] == 0
    assert compare(one, Outlook(), box).relation == BETTER
    assert compare(Outlook(), one, box).relation == WORSE
    monkeypatch.setattr(robust_order, "MOST_BOXES", 1)
    order = compare(one, Outlook(), box)
    assert (order.relation, order.at_equal) == (NEVER_WORSE, None)


def test_legs_that_two_plans_have_in_common_cancel():
    """Whatever the hall takes, 3 steps more there are 3 steps more."""
    one = Outlook(discount=0.9**50, number=Number("hall", 0.9**50), then=Outlook(5.0))
    other = Outlook(discount=0.9**53, number=Number("hall", 0.9**53), then=Outlook(5.0))
    low, high, _, _ = difference(one, other, {"hall": (1.0, 1.5)})
    assert 0 < low < high
    worths = [5 * (0.9 ** (50 * f) - 0.9 ** (53 * f)) for f in (1.5, 1.0)]
    assert low <= worths[0] < worths[1] <= high
    apart = one.bounds({"hall": (1.0, 1.5)})[1] - other.bounds({"hall": (1.0, 1.5)})[0]
    assert high - low < 0.4 * apart


@pytest.mark.parametrize(("hits", "trials"), [(0, 1), (1, 1), (7, 10), (0, 20), (137, 400)])
def test_a_counted_probability_is_missed_no_oftener_than_allowed(hits, trials):
    low, high = Counts(hits, trials).interval(0.9)
    assert low <= hits / trials <= high
    if hits:
        assert binom.sf(hits - 1, trials, low) == pytest.approx(0.05)
    if hits < trials:
        assert binom.cdf(hits, trials, high) == pytest.approx(0.05)
    for truth in np.linspace(0.01, 0.99, 25):
        spans = [Counts(k, trials).interval(0.9) for k in range(trials + 1)]
        missed = sum(binom.pmf(k, trials, truth) for k, (a, b) in enumerate(spans) if not a <= truth <= b)
        assert missed <= 0.1 + 1e-9


@settings(deadline=None, max_examples=60)
@given(st.lists(st.integers(0, 12), min_size=1, max_size=40), st.sampled_from([0.3, 0.8, 0.99]))
def test_a_measured_law_is_bounded_as_its_distribution_is(samples, leg):
    """Against a linear program over all laws whose distribution function is within the band of the samples'."""
    times = [sample / 4 for sample in samples]
    confidence = 0.9
    low, high = Samples(tuple(times)).interval(leg, confidence)
    band = math.sqrt(math.log(2 / (1 - confidence)) / (2 * len(times)))
    points = np.array([i / 4 for i in range(13)] + [math.inf])
    share = np.array([sum(time <= point for time in times) / len(times) for point in points[:-1]])
    rows = np.tril(np.ones((13, 14)))
    limits = {
        "A_ub": np.vstack([rows, -rows]), "b_ub": np.concatenate([share + band, band - share]),
        "A_eq": np.ones((1, 14)), "b_eq": [1.0], "bounds": [(0, 1)] * 14,
    }  # fmt: skip
    worths = np.append(leg ** (points[:-1] - 1), 0.0)
    assert low == pytest.approx(linprog(worths, **limits).fun, abs=1e-7)
    assert high == pytest.approx(-linprog(-worths, **limits).fun, abs=1e-7)


@pytest.mark.parametrize("wrong", [(1, 0), (3, 2), (-1, 4)])
def test_no_count_is_refused(wrong):
    with pytest.raises(SettingError, match="no count"):
        Counts(*wrong)


@pytest.mark.parametrize("wrong", [(), (1.0, -0.1), (math.nan,), (math.inf,)])
def test_no_times_are_refused(wrong):
    with pytest.raises(SettingError, match="times must be finite"):
        Samples(wrong)
