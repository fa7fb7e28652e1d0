"""A checker of certificates of signs, exact; it shares no code with what makes them.

What it relies on: where a derivative is never 0, a polynomial is monotone; and a power of x grows with x.
"""

from fractions import Fraction
from itertools import pairwise


def check_signs(certificate, terms):
    """Raise AssertionError unless a certificate proves the signs on (0, 1) of the polynomial that terms tell."""
    unit = Fraction(1, 2 ** certificate["bits"])
    terms = {exponent: of for exponent, of in terms.items() if of}
    if not terms:
        assert certificate["signs"] == [0]
        return
    chain = [shifted(terms)]
    assert {exponent: int(of) for exponent, of in certificate["terms"]} == chain[0]
    zeros = [(int(low) * unit, int(high) * unit) for low, high in certificate["brackets"]]
    signs = [sign(chain[0], (low + high) / 2) for low, high in gaps(zeros, Fraction(0), Fraction(1))]
    assert signs == certificate["signs"]
    joints = [Fraction(0)]
    for piece in certificate["pieces"]:
        begin, end = int(piece["from"]) * unit, int(piece["to"]) * unit
        assert begin == joints[-1]
        joints.append(end)
        derivatives = [[(int(low) * unit, int(high) * unit) for low, high in of] for of in piece["derivatives"]]
        while len(chain) <= len(derivatives):
            chain.append(shifted({k - 1: k * of for k, of in chain[-1].items() if k}))
        check_piece(chain, begin, end, [zeros, *derivatives])
    assert joints[-1] == 1
    for (low, high), wanted in zip(gaps(zeros, Fraction(0), Fraction(1)), signs, strict=True):
        assert all(sign(chain[0], joint) == wanted for joint in joints if low < joint < high)
    shared = {exponent: int(of) for exponent, of in certificate["shared"]}
    assert not shared or divides(shared, chain[0])
    for (low, high), sure in zip(zeros, certificate["zeros"], strict=True):
        changes = [of for of in (chain[0], shared) if sign(of, low) * sign(of, high) < 0]
        assert changes or not sure or (low == high and sign(chain[0], low) == 0)


def check_piece(chain, begin, end, brackets):
    """The brackets of each polynomial of a chain hold its zeros in (begin, end); the last one has none there."""
    assert len(brackets) == 1 or not brackets[-1]
    assert is_never_zero(chain[len(brackets) - 1], begin, end)
    for level, (own, critical) in enumerate(pairwise(brackets)):
        for low, high in gaps(own, begin, end):
            check_gap(chain[level], low, high, critical)


def check_gap(polynomial, low, high, critical):
    """The polynomial keeps one sign in (low, high), given where its derivative may be 0."""
    wanted, at = sign(polynomial, (low + high) / 2), low
    assert wanted != 0
    inside = [(max(begin, low), min(end, high)) for begin, end in critical if end > low and begin < high]
    for begin, end in [*inside, (high, high)]:
        for x in (at, begin):  # the ends of a stretch on which it is monotone
            assert sign(polynomial, x) in ((0, wanted) if x in (low, high) else (wanted,))
        assert begin == high or is_never_zero(polynomial, begin, end)
        at = end


def is_never_zero(polynomial, low, high):
    """Whether bounds by Horner's rule have one sign; they are whole multiples of a power of 2, for speed."""
    bits = max(low.denominator, high.denominator).bit_length() - 1
    ends = [int(x * 2**bits) for x in (low, high)]
    top = before = max(polynomial)
    least = most = 0
    for exponent in sorted(polynomial, reverse=True):
        powers = [x ** (before - exponent) for x in ends]
        more = polynomial[exponent] << bits * (top - exponent)
        least, most = least * powers[least < 0] + more, most * powers[most > 0] + more
        before = exponent
    return least > 0 or most < 0  # with an exponent 0, as all that are shifted


def divides(factor, polynomial):
    """Long division."""
    rest, top = [Fraction(polynomial.get(k, 0)) for k in range(max(polynomial) + 1)], max(factor)
    while len(rest) > top:
        share = rest[-1] / factor[top]
        for exponent, of in factor.items():
            rest[len(rest) - 1 - top + exponent] -= share * of
        assert rest.pop() == 0
    return not any(rest)


def gaps(brackets, begin, end):
    """What of (begin, end) lies between brackets."""
    ends = [begin, *(min(max(of, begin), end) for bracket in brackets for of in bracket), end]
    assert ends == sorted(ends)
    return [(ends[at], ends[at + 1]) for at in range(0, len(ends), 2) if ends[at] < ends[at + 1]]


def shifted(terms):
    return {exponent - min(terms): of for exponent, of in terms.items()}


def sign(polynomial, x):
    """Of the value at a fraction."""
    top = max(polynomial, default=0)
    found = sum(of * x.numerator**k * x.denominator ** (top - k) for k, of in polynomial.items())
    return (found > 0) - (found < 0)
