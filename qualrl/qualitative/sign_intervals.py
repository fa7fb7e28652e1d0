"""Where a polynomial of few terms is positive and where negative between 0 and 1: proved, with a certificate.

Between two zeros of its derivative a polynomial is monotone, so two signs tell whether it is zero there; and the
derivative, divided by the power of x that it contains, has one term less (Rolle).  So the cost goes with the number of
terms and hardly with the degree, which is in the thousands for plans of thousands of steps.

A *bracket* is an interval [low, high] between dyadic numbers, 2**-bits wide or a point.  What is proved of each level
is that all its zeros in (0, 1) lie in its brackets.  All is whole numbers; nothing is rounded.

Where a polynomial only touches 0, no sign changes.  There it shares a factor with its derivative, whose sign does.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from qualrl.errors import SettingError

Terms = dict[int, int]
"""Coefficient by exponent, none of them 0."""
Bracket = tuple[int, int]
"""Numerators over 2**bits."""

FIRST_BITS, BITS, MOST_BITS = 16, 64, 512
"""Brackets are this narrow at first, for speed; in the end; and at most, where narrower ones may decide more."""
MOST_SHARED = 5000
"""Factors are looked for in polynomials of at most this degree."""
MOST_DEGREE = 100_000
"""Numbers of this many times ``BITS`` bits are worked with."""


@dataclass(frozen=True)
class Level:
    """A polynomial, and brackets that hold all its zeros in (0, 1)."""

    terms: Terms
    brackets: tuple[Bracket, ...]


@dataclass(frozen=True)
class SignIntervals:
    """The signs of a polynomial on (0, 1)."""

    levels: tuple[Level, ...]
    """The polynomial divided by its lowest power, then each time the derivative of the one before, so divided."""
    bits: int
    signs: tuple[int, ...]
    """1 or -1 left of the first bracket, between each two and right of the last one; (0,) for the polynomial 0."""
    is_zero: tuple[bool, ...]
    """Whether a bracket is proved to hold a zero; else it may hold none."""
    shared: Terms
    """A factor of the first level that changes its sign in each bracket where that only touches 0; {} without such."""

    @property
    def brackets(self) -> tuple[tuple[Fraction, Fraction], ...]:
        """Where the polynomial may be 0."""
        return tuple(
            (Fraction(low, 1 << self.bits), Fraction(high, 1 << self.bits)) for low, high in self.levels[0].brackets
        )

    def certificate(self) -> dict[str, Any]:
        """As JSON: what a few lines of code can check again (see the tests); coefficients as text, for size."""
        return {
            "bits": self.bits,
            "signs": list(self.signs),
            "zeros": list(self.is_zero),
            "shared": _as_text(self.shared),
            "levels": [
                {
                    "terms": _as_text(level.terms),
                    "brackets": [[str(low), str(high)] for low, high in level.brackets],
                }
                for level in self.levels
            ],
        }


def _as_text(terms: Terms) -> list[list[Any]]:
    return [[exponent, str(of)] for exponent, of in sorted(terms.items())]


def sign_intervals(terms: Mapping[int, int]) -> SignIntervals:
    """The signs on (0, 1) of the polynomial sum of terms[k] * x**k.

    Raises SettingError for an exponent below 0 or too large to be exact about.
    """
    if any(not 0 <= exponent <= MOST_DEGREE for exponent in terms):
        raise SettingError(f"exponents must be from 0 to {MOST_DEGREE}, got {min(terms)} to {max(terms)}")
    kept = {exponent: of for exponent, of in terms.items() if of}
    if not kept:
        return SignIntervals((Level({}, ()),), BITS, (0,), (), {})
    bits, shared = FIRST_BITS, Terms()
    while True:
        levels = _levels(kept, bits)
        zeros = [_is_zero(levels, bracket, bits) for bracket in levels[0].brackets]
        if not all(zeros) and bits >= BITS:
            shared = shared or _shared_with_derivative(levels[0].terms)
            zeros = [sure or _changes(shared, of, bits) for sure, of in zip(zeros, levels[0].brackets, strict=True)]
        if all(zeros) or 2 * bits > MOST_BITS:
            break
        bits *= 2
    if bits < BITS:
        levels, bits = _narrowed(levels, bits), BITS
    ends = [0, *(end for bracket in levels[0].brackets for end in bracket), 1 << bits]
    signs = [sign_at(levels[0].terms, ends[at] + ends[at + 1], bits + 1) for at in range(0, len(ends), 2)]
    return SignIntervals(tuple(levels), bits, tuple(signs), tuple(zeros), shared)


def _levels(terms: Terms, bits: int) -> list[Level]:
    chain = [_without_power(terms)]
    while len(chain[-1]) > 1:
        chain.append(_without_power({k - 1: k * of for k, of in chain[-1].items() if k}))
    levels = [Level(chain[-1], ())]
    for above in reversed(chain[:-1]):
        levels.append(Level(above, tuple(_brackets(above, levels[-1].brackets, bits))))
    return levels[::-1]


def _is_zero(levels: list[Level], bracket: Bracket, bits: int) -> bool:
    """Whether a bracket of the first level surely holds one zero: a point that is one, or a monotone crossing."""
    terms, (low, high) = levels[0].terms, bracket
    if low == high:
        return sign_at(terms, low, bits) == 0
    monotone = all(end <= low or begin >= high for begin, end in levels[1].brackets)
    return monotone and _sign_from(terms, low, bits) * _sign_up_to(terms, high, bits) < 0


def _shared_with_derivative(terms: Terms) -> Terms:
    """A factor that has each zero which the polynomial has more than once, and has it once; {} for one too large."""
    if max(terms) > MOST_SHARED:
        return {}
    import sympy

    whole = sympy.Poly({(exponent,): of for exponent, of in terms.items()}, sympy.Dummy(), domain="ZZ")
    factor = whole.gcd(whole.diff()).sqf_part()
    return {exponent: int(of) for (exponent,), of in factor.terms()}


def _changes(terms: Terms, bracket: Bracket, bits: int) -> bool:
    """Whether a polynomial has one sign at the lower end of a bracket and the other one at the upper end."""
    return bool(terms) and sign_at(terms, bracket[0], bits) * sign_at(terms, bracket[1], bits) < 0


def _narrowed(levels: list[Level], bits: int) -> list[Level]:
    """The same with brackets of the first level, each of one zero, 2**-BITS wide."""
    finer = BITS - bits
    scaled = [
        Level(level.terms, tuple((low << finer, high << finer) for low, high in level.brackets)) for level in levels
    ]
    terms = scaled[0].terms
    found = [
        (low, high) if low == high else _crossing(terms, low, high, _sign_from(terms, low, BITS), BITS)
        for low, high in scaled[0].brackets
    ]
    return [Level(terms, tuple(found)), *scaled[1:]]


def _without_power(terms: Terms) -> Terms:
    lowest = min(terms)
    return {exponent - lowest: of for exponent, of in terms.items()}


def _brackets(terms: Terms, critical: tuple[Bracket, ...], bits: int) -> list[Bracket]:
    """Brackets of a polynomial from those of its derivative; brackets that touch become one."""
    merged: list[Bracket] = []
    for low, high in _each_bracket(terms, critical, bits):
        if merged and merged[-1][1] >= low:
            low = merged.pop()[0]
        merged.append((low, high))
    return merged


def _each_bracket(terms: Terms, critical: tuple[Bracket, ...], bits: int) -> Iterator[Bracket]:
    end = 0
    one = 1 << bits
    for low, high in (*critical, (one, one)):
        if end < low and (sign := _sign_from(terms, end, bits)) * _sign_up_to(terms, low, bits) < 0:
            yield _crossing(terms, end, low, sign, bits)
        if low < one and not is_never_zero(terms, low, high, bits):
            yield low, high
        end = high


def _crossing(terms: Terms, low: int, high: int, sign: int, bits: int) -> Bracket:
    """The bracket of the only zero between two points; sign: that at the lower one."""
    while high - low > 1:
        middle = (low + high) // 2
        here = sign_at(terms, middle, bits)
        if here == 0:
            return middle, middle
        low, high = (middle, high) if here == sign else (low, middle)
    return low, high


def is_never_zero(terms: Terms, low: int, high: int, bits: int) -> bool:
    """Whether a polynomial is farther from 0 at the lower end than it can change up to the upper end.

    It changes by at most (high - low) * sum of k * abs(terms[k]) * high**(k - 1), all over 2**bits.
    """
    degree = max(terms)
    slope: int = sum(k * abs(of) * high ** (k - 1) << (bits * (degree - k)) for k, of in terms.items() if k)
    return abs(_scaled(terms, low, bits)) > (high - low) * slope


def sign_at(terms: Terms, numerator: int, bits: int) -> int:
    """The sign of a polynomial at numerator / 2**bits."""
    value = _scaled(terms, numerator, bits)
    return (value > 0) - (value < 0)


def _scaled(terms: Terms, numerator: int, bits: int) -> int:
    """The value of a polynomial of degree n at numerator / 2**bits, times 2**(bits * n)."""
    *rest, (before, value) = sorted(terms.items())
    degree = before
    for exponent, of in reversed(rest):  # Horner's rule over the gaps between exponents
        value = value * numerator ** (before - exponent) + (of << (bits * (degree - exponent)))
        before = exponent
    scaled: int = value * numerator**before
    return scaled


def _sign_from(terms: Terms, numerator: int, bits: int) -> int:
    """The sign at a point, which at 0 is that of the constant term."""
    return sign_at(terms, numerator, bits) if numerator else (terms[0] > 0) - (terms[0] < 0)


def _sign_up_to(terms: Terms, numerator: int, bits: int) -> int:
    """The sign at a point, and for 1 that just below it: of the first derivative there that is not 0."""
    if numerator < 1 << bits:
        return sign_at(terms, numerator, bits)
    flip, derivative = 1, terms
    while (at_one := sum(derivative.values())) == 0:
        flip, derivative = -flip, {k - 1: k * of for k, of in derivative.items() if k}
    return flip if at_one > 0 else -flip
