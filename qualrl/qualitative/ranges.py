"""For which values of a parameter a sum converges.

The parameter is positive.  Where the deciding exponent is a function of it, the range on which the exponent exceeds 1
is solved for exactly; the ends of the range are decided one by one, and so are sample points inside every piece.
Heavy (sympy): import only where something is proved.
"""

from fractions import Fraction
from itertools import pairwise
from typing import Any

import sympy as sp

from qualrl.qualitative.bertrand import DependsOnParameterError, Sum, decide_sum
from qualrl.qualitative.eventual import UndecidedError
from qualrl.qualitative.expression import Node, replaced

POSITIVE = sp.Interval.open(0, sp.oo)


def where_it_converges(tree: Node) -> tuple[Any, str, tuple[str, ...]]:
    """The set of parameter values with a finite sum, the parameter's name ("" when none decides), and why."""
    try:
        found: Sum = decide_sum(tree)
    except DependsOnParameterError as problem:
        return _solved(tree, problem)
    return (POSITIVE if found.converges else sp.S.EmptySet), "", found.lines


def as_text(values: Any, name: str) -> str:
    """A set as a condition, such as 1/2 < w <= 1."""
    if values == POSITIVE:
        return f"{name} > 0"
    if isinstance(values, sp.Union):
        return " or ".join(as_text(part, name) for part in sorted(values.args, key=lambda part: part.inf))
    if isinstance(values, sp.FiniteSet):
        return " or ".join(f"{name} = {value}" for value in sorted(values))
    if not isinstance(values, sp.Interval):
        raise UndecidedError(f"the range of {name} has no simple form: {values}")
    opening, closing = ("<" if is_open else "<=" for is_open in (values.left_open, values.right_open))
    return f"{values.inf} {opening} {name}" + ("" if values.sup == sp.oo else f" {closing} {values.sup}")


def _solved(tree: Node, problem: DependsOnParameterError) -> tuple[Any, str, tuple[str, ...]]:
    symbols = problem.exponent.free_symbols
    if len(symbols) != 1:
        raise problem
    (symbol,) = symbols
    free = sp.Dummy(str(symbol), real=True)
    exponent = problem.exponent.subs(symbol, free)
    ends = _ends(sp.solveset(sp.Eq(exponent, 1), free, POSITIVE), problem)
    large = sp.solve_univariate_inequality(exponent > 1, free, relational=False, domain=POSITIVE)
    converging = sp.Union(large, *(sp.FiniteSet(end) for end in ends if _converges(tree, symbol, end)))
    for sample in _samples(ends):
        if _converges(tree, symbol, sample) != (sample in large):
            raise UndecidedError(f"the exponent {problem.exponent} does not hold at {symbol} = {sample}")
    text = as_text(converging, str(symbol)) if converging != sp.S.EmptySet else f"no {symbol} > 0"
    line = f"the exponent is {problem.exponent}: the sum converges for {text}"
    others = "" if converging in (POSITIVE, sp.S.EmptySet) else f", and diverges for every other {symbol} > 0"
    return converging, str(symbol), (line + others,)


def _ends(solutions: Any, problem: UndecidedError) -> list[Any]:
    if solutions == sp.S.EmptySet:
        return []
    if not isinstance(solutions, sp.FiniteSet) or not all(value.is_Rational for value in solutions):
        raise problem
    return sorted(solutions)


def _samples(ends: list[Any]) -> list[Any]:
    """A point inside each piece that the ends cut the positive numbers into."""
    if not ends:
        return [sp.S.Half, sp.Integer(2)]
    between = [(left + right) / 2 for left, right in pairwise(ends)]
    return [ends[0] / 2, *between, ends[-1] * 2]


def _converges(tree: Node, symbol: Any, value: Any) -> bool:
    try:
        return decide_sum(replaced(tree, {str(symbol): Fraction(int(value.p), int(value.q))})).converges
    except UndecidedError as problem:
        raise UndecidedError(f"at {symbol} = {value}: {problem}") from problem
