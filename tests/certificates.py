"""A checker of certificates of signs, in exact fractions; it shares no code with what makes them.

What it relies on: where a derivative is never 0, a polynomial is monotone.
"""

from fractions import Fraction
from itertools import pairwise


def check_signs(certificate, terms):
    """Raise AssertionError unless a certificate proves the signs on (0, 1) of the polynomial that terms tell."""
    unit = Fraction(1, 2 ** certificate["bits"])
    chain = [{exponent: int(of) for exponent, of in level["terms"]} for level in certificate["levels"]]
    brackets = [[(int(a) * unit, int(b) * unit) for a, b in level["brackets"]] for level in certificate["levels"]]
    terms = {exponent: of for exponent, of in terms.items() if of}
    if not terms:
        assert certificate["signs"] == [0]
        return
    assert chain[0] == shifted(terms)
    for above, below in pairwise(chain):
        assert below == shifted({k - 1: k * of for k, of in above.items() if k})
    assert len(chain[-1]) == 1
    assert not brackets[-1]
    for polynomial, own, critical in zip(chain[-2::-1], brackets[-2::-1], brackets[:0:-1], strict=True):
        for low, high in gaps(own):
            check_gap(polynomial, low, high, critical)
    found = [sign(chain[0], (low + high) / 2) for low, high in gaps(brackets[0])]
    assert found == certificate["signs"]
    shared = {exponent: int(of) for exponent, of in certificate["shared"]}
    assert not shared or divides(shared, chain[0])
    for (low, high), sure in zip(brackets[0], certificate["zeros"], strict=True):
        changes = [of for of in (chain[0], shared) if sign(of, low) * sign(of, high) < 0]
        assert changes or not sure or (low == high and sign(chain[0], low) == 0)


def check_gap(polynomial, low, high, critical):
    """The polynomial keeps one sign in (low, high), given where its derivative may be 0."""
    wanted, at = sign(polynomial, (low + high) / 2), low
    assert wanted != 0
    inside = [(max(begin, low), min(end, high)) for begin, end in critical if end > low and begin < high]
    for begin, end in [*inside, (high, high)]:
        for x in (at, begin):  # the ends of a stretch on which it is monotone
            assert sign(polynomial, x) in ((0, wanted) if x in (low, high) else (wanted,))
        if begin < high:  # from here to the end of the bracket it cannot get as far as to 0
            slope = sum(k * abs(of) * end ** (k - 1) for k, of in polynomial.items() if k)
            assert abs(value(polynomial, begin)) > (end - begin) * slope
        at = end


def divides(factor, polynomial):
    """Long division."""
    rest, top = [Fraction(polynomial.get(k, 0)) for k in range(max(polynomial) + 1)], max(factor)
    while len(rest) > top:
        share = rest[-1] / factor[top]
        for exponent, of in factor.items():
            rest[len(rest) - 1 - top + exponent] -= share * of
        assert rest.pop() == 0
    return not any(rest)


def gaps(brackets):
    """What of (0, 1) lies between brackets."""
    ends = [Fraction(0), *(end for bracket in brackets for end in bracket), Fraction(1)]
    return [(ends[at], ends[at + 1]) for at in range(0, len(ends), 2) if ends[at] < ends[at + 1]]


def shifted(terms):
    return {exponent - min(terms): of for exponent, of in terms.items()}


def value(polynomial, x):
    return sum(of * x**exponent for exponent, of in polynomial.items())


def sign(polynomial, x):
    found = value(polynomial, x)
    return (found > 0) - (found < 0)
