"""Where a polynomial of few terms is positive and where negative between 0 and 1: proved, with a certificate.

Between two zeros of its derivative a polynomial is monotone, so two signs tell whether it is zero there; and the
derivative, divided by the power of x that it contains, has one term less (Rolle).  On a short *piece* of [0, 1] a few
derivatives are enough: bounds prove that one of them is never 0 there.  So (0, 1) is halved until they do, and the cost
goes with the number of terms and hardly with the degree, which is in the thousands for plans of thousands of steps.

A *bracket* is an interval [low, high] between dyadic numbers, 2**-bits wide or a point.  What is proved of each level
of a piece is that all its zeros inside the piece lie in its brackets.  Bounds are rounded outwards, and where they do
not tell, whole numbers do.

Where a polynomial only touches 0, no sign changes.  There it shares a factor with its derivative, whose sign does.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from qualrl.errors import SettingError
from qualrl.qualitative.derivative_chain import DerivativeChain, Terms

Bracket = tuple[int, int]
"""Numerators over 2**bits."""

FIRST_BITS, BITS, MOST_BITS = 16, 64, 512
"""Brackets are this narrow at first, for speed; in the end; and at most, where narrower ones may decide more.  Where a
zero is so near to 0 or 1 that there would be no gap, they are as narrow as it takes."""
FEW_LEVELS = 4
"""So many derivatives are tried on all of (0, 1); on halves one more, on quarters two more than that, and so on."""
MOST_SHARED = 5000
"""Factors are looked for in polynomials of at most this degree."""
MOST_DEGREE = 100_000
"""Numbers of this many times ``BITS`` bits are worked with."""


@dataclass(frozen=True)
class Piece:
    """A part of [0, 1], and brackets that hold all zeros of the derivatives inside it."""

    low: int
    """Numerators over 2**bits, as those of brackets."""
    high: int
    critical: tuple[tuple[Bracket, ...], ...]
    """Of the first derivative, of the second and so on; the last one of these has no zero and so no bracket.

    Each derivative is divided by the power of x that it contains.  Empty where the polynomial itself has no zero.
    """


@dataclass(frozen=True)
class SignIntervals:
    """The signs of a polynomial on (0, 1)."""

    terms: Terms
    """The polynomial divided by its lowest power."""
    bits: int
    zeros: tuple[Bracket, ...]
    """They hold all its zeros in (0, 1)."""
    signs: tuple[int, ...]
    """1 or -1 left of the first bracket, between each two and right of the last one; (0,) for the polynomial 0."""
    is_zero: tuple[bool, ...]
    """Whether a bracket is proved to hold a zero; else it may hold none."""
    shared: Terms
    """A factor of the polynomial that changes its sign in each bracket where that only touches 0; {} without such."""
    pieces: tuple[Piece, ...]
    """From 0 to 1."""

    @property
    def brackets(self) -> tuple[tuple[Fraction, Fraction], ...]:
        """Where the polynomial may be 0."""
        return tuple((Fraction(low, 1 << self.bits), Fraction(high, 1 << self.bits)) for low, high in self.zeros)

    def certificate(self) -> dict[str, Any]:
        """As JSON: what a few lines of code can check again (see the tests); large numbers as text."""
        return {
            "bits": self.bits,
            "terms": _as_text(self.terms),
            "brackets": _ends_as_text(self.zeros),
            "signs": list(self.signs),
            "zeros": list(self.is_zero),
            "shared": _as_text(self.shared),
            "pieces": [
                {
                    "from": str(piece.low),
                    "to": str(piece.high),
                    "derivatives": [_ends_as_text(brackets) for brackets in piece.critical],
                }
                for piece in self.pieces
            ],
        }


def _as_text(terms: Terms) -> list[list[Any]]:
    return [[exponent, str(of)] for exponent, of in sorted(terms.items())]


def _ends_as_text(brackets: tuple[Bracket, ...]) -> list[list[str]]:
    return [[str(low), str(high)] for low, high in brackets]


def sign_intervals(terms: Mapping[int, int]) -> SignIntervals:
    """The signs on (0, 1) of the polynomial sum of terms[k] * x**k.

    Raises SettingError for an exponent below 0 or too large to be exact about.
    """
    if any(not 0 <= exponent <= MOST_DEGREE for exponent in terms):
        raise SettingError(f"exponents must be from 0 to {MOST_DEGREE}, got {min(terms)} to {max(terms)}")
    kept = {exponent: of for exponent, of in terms.items() if of}
    if not kept:
        return SignIntervals({}, BITS, (), (0,), (), {}, ())
    chain = DerivativeChain(kept)
    parts = list(_parts(chain, 0, 1 << FIRST_BITS, FEW_LEVELS, 1))
    bits, shared = FIRST_BITS, Terms()
    while True:
        pieces, found = _isolated(chain, parts, bits)
        zeros = list(found.values())
        if not all(zeros) and bits >= BITS:
            shared = shared or _shared_with_derivative(chain.terms())
            zeros = [sure or _changes(shared, of, bits) for of, sure in found.items()]
        if not _reaches_an_end(found, bits) and (all(zeros) or 2 * bits > MOST_BITS):
            break
        bits *= 2
    brackets = list(found)
    if bits < BITS:
        pieces, brackets, bits = *_narrowed(chain, pieces, brackets, BITS - bits), BITS
    ends = [0, *(end for bracket in brackets for end in bracket), 1 << bits]
    signs = [chain.sign_at(0, ends[at] + ends[at + 1], bits + 1) for at in range(0, len(ends), 2)]
    return SignIntervals(chain.terms(), bits, tuple(brackets), tuple(signs), tuple(zeros), shared, tuple(pieces))


def _parts(chain: DerivativeChain, low: int, high: int, most: int, more: int) -> Iterator[tuple[int, int, int]]:
    """Where pieces begin and end, over 2**FIRST_BITS, and which level is never 0 there."""
    if high - low == 1:
        most = chain.last
    for level in range(min(most, chain.last) + 1):
        if chain.never_zero(level, low, high, FIRST_BITS):
            yield low, high, level
            return
    middle = (low + high) // 2
    yield from _parts(chain, low, middle, most + more, more + 1)
    yield from _parts(chain, middle, high, most + more, more + 1)


def _isolated(
    chain: DerivativeChain, parts: list[tuple[int, int, int]], bits: int
) -> tuple[list[Piece], dict[Bracket, bool]]:
    """Pieces with brackets, and those of the polynomial with whether each surely holds a zero."""
    finer = bits - FIRST_BITS
    pieces: list[Piece] = []
    zeros: dict[Bracket, bool] = {}
    for low, high, level in parts:
        low, high = low << finer, high << finer
        if low and chain.sign_at(0, low, bits) == 0:
            _add(zeros, (low, low), True)
        critical: list[tuple[Bracket, ...]] = [()] if level else []
        for above in range(level - 1, 0, -1):
            critical.insert(0, tuple(_brackets(chain, above, low, high, critical[0], bits)))
        pieces.append(Piece(low, high, tuple(critical)))
        if level:
            for bracket in _brackets(chain, 0, low, high, critical[0], bits):
                _add(zeros, bracket, _is_zero(chain, bracket, critical[0], bits))
    return pieces, zeros


def _reaches_an_end(brackets: Iterable[Bracket], bits: int) -> bool:
    """Whether a bracket leaves no gap to 0 or 1, whose sign could be told; narrower ones will.

    Zeros of a polynomial with whole coefficients, and of its derivatives, keep a distance to 0 and 1, unless they are
    there.
    """
    return any(low == 0 or high == 1 << bits for low, high in brackets)


def _add(zeros: dict[Bracket, bool], bracket: Bracket, sure: bool) -> None:
    """Brackets that touch become one, of which nothing is sure."""
    last = next(reversed(zeros), None)
    if last and last[1] >= bracket[0]:
        del zeros[last]
        bracket, sure = (last[0], bracket[1]), False
    zeros[bracket] = sure


def _is_zero(chain: DerivativeChain, bracket: Bracket, critical: tuple[Bracket, ...], bits: int) -> bool:
    """Whether a bracket of the polynomial surely holds one zero: a point that is one, or a monotone crossing."""
    low, high = bracket
    if low == high:
        return chain.sign_at(0, low, bits) == 0
    monotone = all(end <= low or begin >= high for begin, end in critical)
    return monotone and chain.sign_at(0, low, bits) * chain.sign_up_to(0, high, bits) < 0


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
    if not terms:
        return False
    chain = DerivativeChain(terms)
    return chain.sign_at(0, bracket[0], bits) * chain.sign_at(0, bracket[1], bits) < 0


def _narrowed(
    chain: DerivativeChain, pieces: list[Piece], zeros: list[Bracket], finer: int
) -> tuple[list[Piece], list[Bracket]]:
    """The same with so many bits more; brackets of the polynomial, each of one zero, are as narrow as that."""
    scaled = [
        Piece(of.low << finer, of.high << finer, tuple(_scaled(brackets, finer) for brackets in of.critical))
        for of in pieces
    ]
    found = [
        (low, high) if low == high else _crossing(chain, 0, low, high, chain.sign_at(0, low, BITS), BITS)
        for low, high in _scaled(zeros, finer)
    ]
    return scaled, found


def _scaled(brackets: Iterable[Bracket], finer: int) -> tuple[Bracket, ...]:
    return tuple((low << finer, high << finer) for low, high in brackets)


def _brackets(
    chain: DerivativeChain, level: int, low: int, high: int, critical: tuple[Bracket, ...], bits: int
) -> list[Bracket]:
    """Brackets of a level inside a piece from those of its derivative; brackets that touch become one."""
    merged: list[Bracket] = []
    for begin, end in _each_bracket(chain, level, low, high, critical, bits):
        if merged and merged[-1][1] >= begin:
            begin = merged.pop()[0]
        merged.append((begin, end))
    return merged


def _each_bracket(
    chain: DerivativeChain, level: int, low: int, high: int, critical: tuple[Bracket, ...], bits: int
) -> Iterator[Bracket]:
    for begin, end in (*critical, (high, high)):
        if low < begin and (sign := chain.sign_at(level, low, bits)) * chain.sign_up_to(level, begin, bits) < 0:
            yield _crossing(chain, level, low, begin, sign, bits)
        if begin < high and not chain.never_zero(level, begin, end, bits):
            yield begin, end
        low = end


def _crossing(chain: DerivativeChain, level: int, low: int, high: int, sign: int, bits: int) -> Bracket:
    """The bracket of the only zero of a level between two points; sign: that at the lower one."""
    while high - low > 1:
        middle = (low + high) // 2
        here = chain.sign_at(level, middle, bits)
        if here == 0:
            return middle, middle
        low, high = (middle, high) if here == sign else (low, middle)
    return low, high
