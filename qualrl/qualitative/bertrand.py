"""Whether sum a_k converges: Bertrand's logarithmic test on exact limits, checked far out with long numbers.

The term's exponents are p0 = -lim log a_k / log k, then, as long as the one before is exactly 1,
p1 = -lim log(a_k k) / log log k, p2 = -lim log(a_k k log k) / log log log k, ...  The first that is not 1 decides:
above 1 the sum converges, below 1 it diverges, by comparison with sum 1 / (k log k ... (log..log k)^p)
(Bertrand 1842; Knopp, *Theory and Application of Infinite Series*, section 38).

A second and independent look guards against a wrong limit: at k near 10**200 and 10**400 the term itself must be
positive and fall as the exponents say.  Where it does not, nothing is decided.  sympy's own ``is_convergent`` is not
asked: it calls 0.1*0.5**floor(k/1000) and k**-(1+1/k) divergent in both powers, which they are not.
Heavy (sympy): import only where something is proved.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from math import inf
from typing import Any

import sympy as sp

from qualrl.qualitative.eventual import (
    K,
    UndecidedError,
    bounds,
    has_parameters_in_exponents,
    limit,
    limit_of_sum,
    log_of,
    refuse_cancelling,
    shortened,
    sign,
)
from qualrl.qualitative.expression import Node, names_in
from qualrl.qualitative.far_out import slopes

SCALES = (K, sp.log(K), sp.log(sp.log(K)), sp.log(sp.log(sp.log(K))))
SCALE_NAMES = ("k", "log(k)", "log(log(k))", "log(log(log(k)))")
NEAR = (0.1, 0.3)
"""How far p0 and p1 may lie from what is seen far out; slowly varying factors account for this much."""
STEEP = 1.2
"""The slope that must be seen where p0 is infinite; exp(-log(k)**1.1) shows no more than 2 there."""
SAMPLES = (Fraction(1, 3), Fraction(1), Fraction(3))
"""Parameters are positive; these are tried far out."""


class DependsOnParameterError(UndecidedError):
    """Parameters decide; ``exponent`` is p0 as a function of them."""

    def __init__(self, exponent: Any) -> None:
        names = " and ".join(sorted(str(name) for name in exponent.free_symbols))
        super().__init__(f"the exponent is {exponent}: it depends on {names}")
        self.exponent = exponent


@dataclass(frozen=True)
class Sum:
    """What was found of sum a_k, and why."""

    converges: bool
    lines: tuple[str, ...]
    exponents: tuple[Any, ...] = ()
    """p0, p1, ... as sympy numbers: of the term, or of the bound that decided; 0 for a term that does not tend to 0."""


def decide_sum(tree: Node) -> Sum:
    """Whether the sum of a tree's values over k converges; UndecidedError says why it cannot be said."""
    low, high = bounds(tree)
    found = _decided(low) if low is high else _between(low, high)
    _check_far_out(tree, found)
    return found


def _between(low: Any, high: Any) -> Sum:
    """Decide by whichever bound is enough."""
    where = f"from some k on the term lies between {shortened(low)} and {shortened(high)}"
    if sign(low) < 0:
        raise UndecidedError(f"the term may be negative again and again: {where}")
    above = _decided(high)
    if above.converges:
        return replace(above, lines=(where, "the upper bound is enough:", *above.lines))
    if sign(low) > 0 and not (below := _decided(low)).converges:
        return replace(below, lines=(where, "the lower bound is enough:", *below.lines))
    raise UndecidedError(f"{where}; the sum of the one converges, that of the other diverges")


def _decided(term: Any) -> Sum:
    """Decide an exp-log term."""
    now = sign(term)
    if now < 0:
        raise UndecidedError("the term is negative from some k on")
    if now == 0:
        return Sum(True, ("the term is 0 from some k on: the sum is finite",), (sp.oo,))
    refuse_cancelling(term)
    # where this limit is not to be had the exponents are enough: they are at most 0 when the term does not tend to 0
    to = sp.S.Zero if has_parameters_in_exponents(term) else limit(term)
    if to != 0:
        if sign(to) <= 0:
            raise UndecidedError(f"the limit {to} contradicts the sign of the term")
        return Sum(False, (f"the term tends to {to}, not to 0: the sum diverges",), (sp.S.Zero,))
    return _by_exponents(term)


def _by_exponents(term: Any) -> Sum:
    """Bertrand's test of a term that is positive in the end."""
    logarithm = log_of(term)
    exponents: list[Any] = []
    lines: list[str] = []
    for scale, name in zip(SCALES, SCALE_NAMES, strict=True):
        exponent = sp.simplify(limit_of_sum(-logarithm, sp.log(scale)))
        exponents.append(exponent)
        if exponent.free_symbols:
            raise DependsOnParameterError(exponent)
        side = sign(sp.simplify(exponent - 1))
        if side:
            lines.append(_compared(logarithm, exponents, side))
            return Sum(side > 0, tuple(lines), tuple(exponents))
        lines.append(f"the exponent of {name} is exactly 1: the next logarithm decides")
        logarithm += sp.log(scale)
        rest = limit_of_sum(logarithm)
        if rest != -sp.oo:
            size = "infinity" if rest == sp.oo else sp.exp(rest)
            series = _series(len(exponents) - 1)
            lines[-1] = f"a_k * {series} tends to {size}: the sum diverges as that of {_over(series)} does"
            return Sum(False, tuple(lines), tuple(exponents))
    raise UndecidedError(f"the term is too close to {_over(_series(len(SCALES) - 1))}")


def _series(level: int, power: Any = 1) -> str:
    """The denominator of Bertrand's series: k * log(k) * ... * (the last logarithm)**power."""
    last = SCALE_NAMES[level]
    if power != 1:
        last += f"**{power}" if sp.sympify(power).is_Integer else f"**({power})"
    return " * ".join([*SCALE_NAMES[:level], last])


def _over(series: str) -> str:
    return f"1/({series})" if "*" in series else f"1/{series}"


def _compared(logarithm: Any, exponents: list[Any], side: int) -> str:
    """The deciding line: a comparison with an explicit series, whose ratio's limit is computed anew."""
    exponent, level = exponents[-1], len(exponents) - 1
    between = sp.Integer(1 + side) if exponent.is_infinite else (1 + exponent) / 2
    ratio = limit_of_sum(logarithm + between * sp.log(SCALES[level]))
    if ratio != -side * sp.oo:
        raise UndecidedError(f"the exponent {exponent} contradicts the comparison with exponent {between}")
    series = _series(level, between)
    order, grows, verdict = (">", "0", "converges") if side > 0 else ("<", "infinity", "diverges")
    size = "infinite" if exponent.is_infinite else f"{exponent} {order} 1"
    return (
        f"the exponent of {SCALE_NAMES[level]} is {size}: a_k * {series} tends to {grows}, "
        f"so the sum {verdict} as that of {_over(series)} does"
    )


def _check_far_out(tree: Node, found: Sum) -> None:
    """Raise UndecidedError when the term does not fall as its exponents say; one-sided, for a bound is one."""
    parameters = sorted(names_in(tree) - {"k"})
    for values in product(SAMPLES, repeat=len(parameters)):
        seen = slopes(tree, dict(zip(parameters, values, strict=True)))
        if seen is None:
            raise UndecidedError("the exact limits want a positive term, but near k = 10**200 or 10**400 there is none")
        for slope, exponent, near in zip(seen, found.exponents, NEAR, strict=False):
            claimed = float(exponent)
            least = STEEP if claimed == inf else claimed - near
            if slope < least if found.converges else slope > claimed + near:
                raise UndecidedError(f"the exponent {exponent} contradicts the slope {slope:.4g} seen near k = 10**400")
