"""Bounds and signs of a polynomial and its derivatives, against sums in exact fractions."""

from fractions import Fraction
from itertools import islice

from hypothesis import example, given
from hypothesis import strategies as st

from qualrl.qualitative.derivative_chain import DerivativeChain

BITS = 20
TERMS = st.dictionaries(st.integers(0, 120), st.integers(-(10**20), 10**20).filter(bool), min_size=1, max_size=9)
POINTS = st.integers(0, 2**BITS)


def levels_of(terms):
    """The polynomial and its derivatives, each divided by its power of x."""
    while True:
        lowest = min(terms)
        terms = {exponent - lowest: of for exponent, of in terms.items()}
        yield terms
        if len(terms) == 1:
            return
        terms = {exponent - 1: exponent * of for exponent, of in terms.items() if exponent}


def value(terms, x):
    return sum(of * x**exponent for exponent, of in terms.items())


def sign(of):
    return (of > 0) - (of < 0)


@given(TERMS, POINTS)
@example({0: 1, 1: -2}, 2 ** (BITS - 1))
@example({3: -1, 250: 3, 251: -2}, 2**BITS)
def test_signs_at_a_point_are_those_of_the_sum(terms, numerator):
    chain = DerivativeChain(terms)
    levels = list(levels_of(terms))
    assert chain.last == len(levels) - 1
    assert chain.terms() == levels[0]
    for level, polynomial in enumerate(levels):
        assert chain.sign_at(level, numerator, BITS) == sign(value(polynomial, Fraction(numerator, 2**BITS)))


@given(TERMS, POINTS, st.integers(0, 2**12), st.fractions(0, 1, max_denominator=50))
@example({0: 1, 1: -2}, 2 ** (BITS - 1), 0, Fraction(0))
def test_what_is_never_zero_has_one_sign(terms, low, width, share):
    high = min(low + width, 2**BITS)
    chain = DerivativeChain(terms)
    for level, polynomial in enumerate(levels_of(terms)):
        if chain.never_zero(level, low, high, BITS):
            inside = Fraction(low, 2**BITS) + share * Fraction(high - low, 2**BITS)
            ends = Fraction(low, 2**BITS), Fraction(high, 2**BITS)
            assert {sign(value(polynomial, x)) for x in (*ends, inside)} in ({1}, {-1})
    assert chain.never_zero(chain.last, low, high, BITS)


@given(st.dictionaries(st.integers(0, 30), st.integers(-1000, 1000).filter(bool), min_size=1), st.integers(0, 3))
def test_signs_just_below_one(terms, times):
    """Nearer to 1 than any zero: in powers of 1 - x coefficients are below 2**80, and a zero is above 1 over that."""
    for _ in range(times):
        product = {k: terms.get(k, 0) - terms.get(k - 1, 0) for k in range(max(terms) + 2)}
        terms = {exponent: of for exponent, of in product.items() if of}
    near = 1 - Fraction(1, 2**100)
    chain = DerivativeChain(terms)
    for level, polynomial in enumerate(islice(levels_of(terms), 3)):
        assert chain.sign_up_to(level, 2**BITS, BITS) == sign(value(polynomial, near))
