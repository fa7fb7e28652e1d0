"""A polynomial of few terms and its derivatives between 0 and 1: bounds and signs that are sure.

Each level of the chain is the derivative of the one before, divided by the power of x that it contains; so it has one
term less, and the last one is a number.  Points are numerators over 2**bits.

Bounds come from Horner's rule from the highest term down, over the gaps between exponents, in whole numbers that are
rounded outwards.  Terms of opposite sign that nearly cancel do so inside the rule, which a sum of bounds of the terms
would not see.  Powers are shared: levels need the same ones.
"""

from collections.abc import Mapping
from itertools import pairwise

Terms = dict[int, int]
"""Coefficient by exponent, none of them 0."""

SPARE_BITS = 64
"""So many more than those of the points are kept of each number at first."""
SMALL = 4000
"""Exact values of up to so many bits are as fast as bounds."""
MOST_POINTS = 1000
"""Powers of more points than that are not kept."""


class DerivativeChain:
    """A polynomial, its derivatives, and what is known of their powers."""

    def __init__(self, terms: Mapping[int, int]) -> None:
        """Terms: at least one, none of them 0."""
        falling = sorted(terms, reverse=True)
        self._exponents = [exponent - falling[-1] for exponent in falling]
        self._gaps = [above - below for above, below in pairwise(falling)]
        self._levels = [[terms[exponent] for exponent in falling]]
        self._shifted: dict[tuple[int, int], list[int]] = {}
        self._powers: dict[tuple[int, int, int], tuple[list[int], list[int]]] = {}

    @property
    def last(self) -> int:
        """The level that is a number."""
        return len(self._exponents) - 1

    def terms(self) -> Terms:
        """The first level."""
        return dict(zip(self._exponents, self._levels[0], strict=True))

    def never_zero(self, level: int, low: int, high: int, bits: int) -> bool:
        """Whether bounds prove that a level is not 0 anywhere from one point to another."""
        if low == high:
            return self.sign_at(level, low, bits) != 0
        lower, upper = self._bounds(level, low, high, bits, bits + SPARE_BITS)
        return lower > 0 or upper < 0

    def sign_at(self, level: int, numerator: int, bits: int) -> int:
        """The sign of a level at a point: by bounds if they tell, else exactly."""
        if bits * self._exponents[0] <= SMALL:
            return self._exact_sign(level, numerator, bits)
        for kept in (bits + SPARE_BITS, 4 * (bits + SPARE_BITS)):
            lower, upper = self._bounds(level, numerator, numerator, bits, kept)
            if lower > 0 or upper < 0:
                return 1 if lower > 0 else -1
        return self._exact_sign(level, numerator, bits)

    def sign_up_to(self, level: int, numerator: int, bits: int) -> int:
        """The sign at a point, and for 1 that just below it: of the first derivative there that is not 0."""
        if numerator < 1 << bits:
            return self.sign_at(level, numerator, bits)
        flip = 1
        while (at_one := sum(self._coefficients(level))) == 0:
            flip, level = -flip, level + 1
        return flip if at_one > 0 else -flip

    def _coefficients(self, level: int) -> list[int]:
        """Of the highest exponent first."""
        while len(self._levels) <= level:
            above = self._levels[-1]
            lowest = self._exponents[len(above) - 1]
            self._levels.append([of * (k - lowest) for k, of in zip(self._exponents, above[:-1], strict=False)])
        return self._levels[level]

    def _bounds(self, level: int, low: int, high: int, bits: int, kept: int) -> tuple[int, int]:
        """Bounds of 2**kept times a level between two points."""
        first, *others = self._shifted_coefficients(level, kept)
        floors, ceilings = self._powers_of(low, bits, kept)[0], self._powers_of(high, bits, kept)[1]
        lower = upper = first
        for of, least, most in zip(others, floors, ceilings, strict=False):
            lower = (lower * (least if lower > 0 else most) >> kept) + of
            upper = of - (-upper * (most if upper > 0 else least) >> kept)
        return lower, upper

    def _shifted_coefficients(self, level: int, kept: int) -> list[int]:
        found = self._shifted.get((level, kept))
        if found is None:
            found = self._shifted[level, kept] = [of << kept for of in self._coefficients(level)]
        return found

    def _powers_of(self, numerator: int, bits: int, kept: int) -> tuple[list[int], list[int]]:
        """2**kept times the power of a point for each gap: lower and upper bounds."""
        found = self._powers.get((numerator, bits, kept))
        if found is None:
            if len(self._powers) >= MOST_POINTS:
                self._powers.clear()
            point = numerator << (kept - bits)
            floor = {gap: _power(point, gap, kept) for gap in set(self._gaps)}
            ceiling = {gap: of + gap for gap, of in floor.items()}
            found = [floor[gap] for gap in self._gaps], [ceiling[gap] for gap in self._gaps]
            self._powers[numerator, bits, kept] = found
        return found

    def _exact_sign(self, level: int, numerator: int, bits: int) -> int:
        while bits and numerator % 2 == 0:
            numerator, bits = numerator // 2, bits - 1
        value, *others = self._coefficients(level)
        degree = 0
        for of, gap in zip(others, self._gaps, strict=False):
            degree += gap
            value = value * numerator**gap + (of << bits * degree)
        return (value > 0) - (value < 0)


def _power(point: int, exponent: int, kept: int) -> int:
    """A lower bound of a power of a number in [0, 1], all times 2**kept; too small by less than the exponent.

    With errors below e of x**n and none of x: of x**(2 * n) below 2 * e + 1, since x <= 1; of x**(n + 1) below e + 1.
    """
    value = point
    for digit in bin(exponent)[3:]:
        value = value * value >> kept
        if digit == "1":
            value = value * point >> kept
    return value
