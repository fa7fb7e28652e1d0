"""Signs of polynomials on (0, 1) against sympy's roots, against sums in exact fractions, and by their certificates."""

import json
from collections import Counter
from fractions import Fraction
from itertools import pairwise
from math import lcm
from random import Random

import mpmath
import pytest
import sympy
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qualrl.errors import SettingError
from qualrl.qualitative.plan_value import Course, Stretch, combined, told_apart
from qualrl.qualitative.sign_intervals import sign_intervals
from tests.certificates import check_signs, sign

X = sympy.Symbol("x")
TERMS = st.dictionaries(st.integers(0, 25), st.integers(-20, 20), max_size=6)


def terms_of(expression):
    return {exponent: int(of) for (exponent,), of in sympy.Poly(expression, X).terms()}


def times_of_zeros(terms, low=0, high=1):
    """How often each zero in [low, high] is one, by sympy, which counts sign changes: 0 and 1 themselves left out.

    Its roots as numbers are not asked for: to compare one with a fraction near it may take minutes.
    """
    _, factors = sympy.Poly({(exponent,): of for exponent, of in terms.items()}, X).sqf_list()
    low, high = sympy.Rational(low), sympy.Rational(high)
    return [
        times
        for factor, times in factors
        for _ in range(factor.count_roots(low, high) - sum(factor.eval(end) == 0 for end in {low, high} & {0, 1}))
    ]


@settings(deadline=None, max_examples=60)  # sympy takes a tenth of a second for each
@given(TERMS.filter(lambda terms: any(terms.values())))
@example({0: 1, 1: -4, 2: 4})  # a double zero at 1/2
@example(terms_of((3 * X - 1) ** 2 * (X - 1) ** 3))  # one at 1/3, which no dyadic number is, and one at the end
@example(terms_of((3 * X - 1) ** 3 * (2 * X - 1) * X**4))
@example({0: -1, 25: 1})
@example({6: -1, 7: 8, 21: 8})  # one just below 1/8
def test_brackets_hold_the_zeros_that_sympy_finds(terms):
    found = sign_intervals(terms)
    assert len(found.brackets) == len(times_of_zeros(terms))
    assert all(high < low for (_, high), (low, _) in pairwise(found.brackets))
    for (low, high), sure, (before, after) in zip(
        found.brackets, found.is_zero, zip(found.signs, found.signs[1:], strict=False), strict=True
    ):
        [times] = times_of_zeros(terms, low, high)
        assert high - low <= Fraction(1, 2**64)
        assert sure
        assert (before == after) == (times % 2 == 0)


@settings(deadline=None, max_examples=150)
@given(TERMS, st.fractions(0, 1, max_denominator=10**6))
def test_signs_are_those_of_the_sum(terms, at):
    found = sign_intervals(terms)
    if at in (0, 1) or any(low <= at <= high for low, high in found.brackets):
        return
    before = sum(high < at for _, high in found.brackets)
    assert found.signs[before] == sign({exponent: of for exponent, of in terms.items() if of}, at)


@settings(deadline=None, max_examples=150)
@given(TERMS)
@example(terms_of((3 * X - 1) ** 2 * (X - 1) ** 3))
@example({0: 1, 1: -4, 2: 4})
def test_certificates_prove_the_signs(terms):
    certificate = json.loads(json.dumps(sign_intervals(terms).certificate()))
    check_signs(certificate, terms)


def spoiled(certificate):
    """The certificate with one thing wrong, in each of several ways."""
    text = json.dumps(certificate)
    flipped = json.loads(text)
    flipped["signs"][0] *= -1
    yield flipped
    fewer = json.loads(text)
    fewer["brackets"].pop()
    fewer["signs"].pop()
    yield fewer
    elsewhere = json.loads(text)
    elsewhere["brackets"][-1][1] = elsewhere["brackets"][-1][0]
    yield elsewhere
    other = json.loads(text)
    other["terms"][0][1] = str(2 * int(other["terms"][0][1]))
    yield other
    for at, piece in enumerate(certificate["pieces"]):
        gone = json.loads(text)
        del gone["pieces"][at]
        yield gone
        for level, brackets in enumerate(piece["derivatives"]):
            shorter = json.loads(text)
            del shorter["pieces"][at]["derivatives"][level:]
            yield shorter
            if brackets:
                unlisted = json.loads(text)
                unlisted["pieces"][at]["derivatives"][level] = []
                yield unlisted
    if certificate["shared"]:
        foreign = json.loads(text)
        foreign["shared"][0][1] = str(int(foreign["shared"][0][1]) - 1)
        yield foreign
        unshared = json.loads(text)
        unshared["shared"] = []
        yield unshared


@pytest.mark.parametrize(
    "terms",
    [
        {0: 1, 3: -7, 9: 8, 20: -1},
        terms_of((3 * X - 1) ** 2 * (X**9 - 2 * X + 3)),
        terms_of((2 * X - 1) * sum((-1) ** k * (k % 5 + 1) * X ** (3 * k) for k in range(12))),
    ],
)
def test_the_checker_finds_what_is_wrong(terms):
    certificate = sign_intervals(terms).certificate()
    check_signs(certificate, terms)
    for wrong in spoiled(certificate):
        with pytest.raises(AssertionError):
            check_signs(wrong, terms)
    with pytest.raises(AssertionError):
        check_signs(certificate, terms | {3: -6})


def alternating(rng, turns, most):
    """(1 - x) * V of a way that goes straight and diagonally in turns, before it is paid 500."""
    rewards = [-(2 ** (turn % 2 / 2)) for turn in range(turns)]
    return Course((*(Stretch("", rng.randint(1, most), reward) for reward in rewards), Stretch("", 1, 500.0)))


def scaled_difference(first, second):
    difference = combined((1, first), (-1, second))
    scale = lcm(*(of.denominator for of in difference.values()))
    return {exponent: int(of * scale) for exponent, of in difference.items()}


@settings(deadline=None, max_examples=40)
@given(st.randoms(use_true_random=False), st.integers(2, 60), st.fractions(0, 1, max_denominator=500))
def test_ways_of_many_turns(rng, turns, at):
    terms = scaled_difference(alternating(rng, turns, 20), alternating(rng, turns + 1, 20))
    found = sign_intervals(terms)
    check_signs(json.loads(json.dumps(found.certificate())), terms)
    assert all(found.is_zero)
    for (low, high), *around in zip(found.brackets, found.signs, found.signs[1:], strict=False):
        assert high - low <= Fraction(1, 2**64)
        assert around[0] == -around[1]
    if 0 < at < 1 and not any(low <= at <= high for low, high in found.brackets):
        assert found.signs[sum(high < at for _, high in found.brackets)] == sign(terms, at)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(-9, 9), min_size=8, max_size=25).filter(any), st.integers(0, 3), st.integers(0, 2))
def test_many_terms_with_zeros_where_pieces_meet(coefficients, times_half, times_one):
    """Zeros at 1/2 and at 1, by sympy, also where other zeros are near."""
    terms = terms_of(
        (2 * X - 1) ** times_half * (X - 1) ** times_one * sum(of * X**k for k, of in enumerate(coefficients))
    )
    found = sign_intervals(terms)
    check_signs(json.loads(json.dumps(found.certificate())), terms)
    assert all(found.is_zero)
    assert len(found.brackets) == len(times_of_zeros(terms))
    assert all(len(times_of_zeros(terms, low, high)) == 1 for low, high in found.brackets)
    assert all(high < low for (_, high), (low, _) in pairwise(found.brackets))


def with_zero(terms, at):
    """The polynomial times one that is 0 there."""
    product = Counter()
    for exponent, of in terms.items():
        product[exponent + 1] += of * at.denominator
        product[exponent] -= of * at.numerator
    return {exponent: of for exponent, of in product.items() if of}


@settings(deadline=None, max_examples=40)
@given(
    st.dictionaries(st.integers(0, 25), st.integers(-20, 20).filter(bool), min_size=1, max_size=3),
    st.lists(st.tuples(st.integers(60, 120), st.sampled_from((-1, 0, 1))), min_size=2, max_size=4),
)
@example({0: 1, 25: -1}, [(66, -1), (66, -1), (66, 1)])  # a bracket on either side of 1/2, where pieces meet
@example({0: 1}, [(66, -1), (70, 1), (70, 1), (80, 0)])
def test_no_zero_is_lost_where_brackets_touch(terms, planted):
    """Zeros nearer to 1/2 than a bracket is wide: one may hold several of them, but all are held."""
    zeros = [Fraction(1, 2) + Fraction(side, 2**depth) for depth, side in planted]
    for zero in zeros:
        terms = with_zero(terms, zero)
    found = sign_intervals(terms)
    check_signs(json.loads(json.dumps(found.certificate())), terms)
    assert all(any(low <= zero <= high for low, high in found.brackets) for zero in zeros)
    assert all(high < low for (_, high), (low, _) in pairwise(found.brackets))


@settings(deadline=None, max_examples=25)
@given(
    st.dictionaries(st.integers(0, 25), st.integers(-20, 20).filter(bool), min_size=1, max_size=4),
    st.lists(st.tuples(st.integers(60, 180), st.booleans()), min_size=1, max_size=2, unique=True),
    st.integers(0, 1),
)
@example({0: 1}, [(80, True)], 1)  # an end of the bracket would be 1, and so would be the gap beyond it
@example({0: 1}, [(100, False)], 0)
@example({0: 1, 25: -1}, [(100, True), (80, True)], 1)
@example({0: 1}, [(2000, True)], 0)
def test_zeros_very_near_to_0_and_1(terms, planted, times_one):
    zeros = [1 - Fraction(1, 2**depth) if is_last else Fraction(1, 2**depth) for depth, is_last in planted]
    for zero in [*zeros, *[Fraction(1)] * times_one]:
        terms = with_zero(terms, zero)
    found = sign_intervals(terms)
    check_signs(json.loads(json.dumps(found.certificate())), terms)
    assert all(low > 0 and high < 1 for low, high in found.brackets)
    for zero in zeros:
        assert any(low <= zero <= high for low, high in found.brackets)
    cuts = [Fraction(0), *(end for bracket in found.brackets for end in bracket), Fraction(1)]
    for wanted, low, high in zip(found.signs, cuts[::2], cuts[1::2], strict=True):
        assert low < high
        assert sign(terms, (2 * low + high) / 3) == wanted != 0


def test_one_piece_or_several():
    """Few terms need no halving; and with many, no piece needs a derivative as far down as the last."""
    assert [(piece.low, piece.high) for piece in sign_intervals({0: 1, 3: -7, 9: 8, 900: -1}).pieces] == [(0, 2**64)]
    terms = scaled_difference(alternating(Random(1), 60, 20), alternating(Random(2), 50, 20))
    pieces = sign_intervals(terms).pieces
    assert len(pieces) < len(terms) / 2
    assert max(len(piece.critical) for piece in pieces) < len(terms) / 2


def test_two_thresholds_of_a_corridor_and_a_lab():
    """The corridor takes 40 steps at -1, the lab 22 at -1 and 10 at -3; the goal pays 200 instead of the last step."""
    worth = {0: -1, 39: 200 + 1, 40: -200}, {0: -1, 22: -2, 31: 200 + 3, 32: -200}
    terms = {k: worth[0].get(k, 0) - worth[1].get(k, 0) for k in worth[0] | worth[1]}
    found = sign_intervals(terms)
    assert found.signs == (1, -1, 1)
    assert [round(float(low), 4) for low, _ in found.brackets] == [0.6805, 0.9931]


def test_a_thousand_steps_are_no_hindrance():
    terms = {534: 2, 799: -5003, 800: 5000, 999: 5001, 1000: -5000}
    found = sign_intervals(terms)
    check_signs(json.loads(json.dumps(found.certificate())), terms)
    assert found.signs == (1, -1, 1)
    cuts = [0.0, *(float(low) for low, _ in found.brackets), 1.0]
    with mpmath.workdps(60):
        for wanted, low, high in zip(found.signs, cuts[:-1], cuts[1:], strict=True):
            for share in (1e-6, 0.1, 0.5, 0.9, 1 - 1e-6):
                x = mpmath.mpf(low) + share * (mpmath.mpf(high) - low)
                assert mpmath.sign(sum(of * x**k for k, of in terms.items())) == wanted


@pytest.mark.parametrize("factor", [(3 * X - 2) ** 2, (2 * X**2 - 1) ** 2, (5 * X**3 - 2) ** 2])
def test_where_it_only_touches_zero_is_proved_too(factor):
    terms = terms_of(sympy.expand(factor * (100 * X**900 - 3 * X**400 - 200)))
    found = sign_intervals(terms)
    assert found.signs == (-1, -1)
    assert found.is_zero == (True,)
    check_signs(json.loads(json.dumps(found.certificate())), terms)


def test_zeros_too_close_to_be_told_apart_are_not_said_to_be_there():
    near = terms_of(sympy.expand((3 * X - 1) ** 2 * 2**1100 + X))
    assert sign_intervals(near).is_zero == (False,)


@pytest.mark.parametrize("terms", [{-1: 1}, {10**9: 1}])
def test_exponents_out_of_range_are_refused(terms):
    with pytest.raises(SettingError, match="exponents must be from 0"):
        sign_intervals(terms)


def test_numbers_of_verdicts_are_told_apart():
    assert told_apart([Fraction(1, 3), Fraction(2, 3)]) == ["0.333333", "0.666667"]
    assert told_apart([0.99999998]) == ["0.99999998"]
    assert told_apart([0.5, 0.5 + 1e-8]) == ["0.5", "0.50000001"]
    assert told_apart([1 - Fraction(1, 10**30)]) == ["1 - 1e-30"]
    assert told_apart([Fraction(1, 10**400), Fraction(1, 2)]) == ["1e-400", "0.5"]
    near = 1 - Fraction(1, 10**30) - Fraction(1, 10**38), 1 - Fraction(1, 10**30)
    assert told_apart(near) == ["1 - 1.00000001e-30", "1 - 1e-30"]
    assert told_apart([0.0, 2**-30]) == ["0", "9.31323e-10"]  # 0 itself is 0
