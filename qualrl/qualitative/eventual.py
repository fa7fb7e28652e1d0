"""What holds for all large k: signs, order, limits, and bounds of an expression without floor, min and max.

An exp-log function (built from k and numbers by + - * / exp log and powers, each logarithm and each base of a power
being positive from some k on) has a limit and, from some k on, one sign: Hardy, *Orders of Infinity* (1910).  The
limits are exact, by Gruntz's algorithm (thesis, ETH Zuerich, 1996) as sympy has it.

``bounds`` replaces what is no exp-log function: min, max and abs by the branch that wins in the end, floor(u) by
u - 1 and u (by its constant when u has a finite limit), and carries the bounds through by interval arithmetic, which
can only widen them.  What cannot be settled raises UndecidedError; nothing is guessed.

Parameters are positive symbols.  gruntz silently takes one side when it meets k + k**w, so it is never shown a
parameter in an exponent: such powers go through their logarithms, where w is a plain factor.
Heavy (sympy): import only where something is proved.
"""

from collections.abc import Callable
from fractions import Fraction
from math import prod
from typing import Any

import sympy as sp
from sympy.series.gruntz import gruntz
from sympy.series.gruntz import sign as gruntz_sign

from qualrl.qualitative.expression import Name, Node, Number, Operation

K = sp.Symbol("k", positive=True)

Bounds = tuple[Any, Any]
"""Two expressions in K, the first at most the second from some k on; the same object twice when exact."""


class UndecidedError(Exception):
    """Why something cannot be decided here."""


def limit(expression: Any) -> Any:
    """The limit as k grows: a number, oo or -oo, perhaps with parameters in it."""
    _refuse_parameters_in_exponents(expression)
    try:
        found = gruntz(expression, K, sp.oo)
    except (NotImplementedError, ValueError, TypeError, AttributeError, RecursionError) as problem:
        raise UndecidedError(f"the limit of {shortened(expression)} is not known") from problem
    if found.has(sp.Limit, sp.AccumBounds, sp.nan, sp.zoo, sp.I, K):
        raise UndecidedError(f"the limit of {shortened(expression)} is not known")
    return found


def limit_of_sum(terms: Any, scale: Any = sp.S.One) -> Any:
    """The limit of a sum over a scale, where factors without k may hold any parameters."""
    plain, found = sp.S.Zero, []
    for term in sp.Add.make_args(terms):
        factor, rest = term.as_independent(K, as_Add=False)
        if factor.free_symbols and rest != 1:
            part = limit(rest / scale)
            found.append(sign(factor) * sign(part) * sp.oo if part.is_infinite else factor * part)
        else:
            plain += term
    found.append(limit(plain / scale))
    infinite = {part for part in found if part.is_infinite}
    if len(infinite) > 1:  # the parameters stand outside all exponents, so their sum may be looked at whole
        return limit(terms / scale)
    return infinite.pop() if infinite else sp.Add(*found)


def has_parameters_in_exponents(expression: Any) -> bool:
    """Whether a power of a growing base, or to a growing exponent, or exp, holds a parameter where it matters."""
    for power in expression.atoms(sp.Pow, sp.exp):
        base, exponent = power.as_base_exp()
        if power.has(K) and (exponent.free_symbols - {K} or (exponent.has(K) and base.free_symbols - {K})):
            return True
    return False


def refuse_cancelling(expression: Any) -> None:
    """Raise UndecidedError where parameters may cancel, as in (a - b)/k + 1/k**2: limits hold for those that do not."""
    for terms in expression.atoms(sp.Add):
        if terms.has(K) and terms.free_symbols - {K} and not all(term.is_extended_positive for term in terms.args):
            raise UndecidedError(f"what is left of {shortened(terms)} {_depends(terms)}")


def sign(expression: Any) -> int:
    """-1, 0 or 1: the sign from some k on, whatever the parameters."""
    expression = sp.sympify(expression)  # a bare 0 or 1 of Python's may come in; no text ever does
    if expression.has(sp.nan, sp.zoo, sp.I):
        raise UndecidedError(f"{shortened(expression)} has no real value")
    for found, known in (
        (1, expression.is_extended_positive),
        (-1, expression.is_extended_negative),
        (0, expression.is_zero),
    ):
        if known:
            return found
    if isinstance(expression, sp.exp):
        return 1
    if expression.is_Mul:
        return prod(sign(factor) for factor in expression.args)
    if not expression.has(K):
        raise UndecidedError(f"the sign of {shortened(expression)} {_depends(expression)}")
    _refuse_parameters_in_exponents(expression)
    try:
        return int(gruntz_sign(expression, K))
    except (NotImplementedError, ValueError, TypeError, AttributeError, RecursionError) as problem:
        raise UndecidedError(f"the sign of {shortened(expression)} for large k {_depends(expression)}") from problem


def shortened(expression: Any, most: int = 60) -> str:
    """An expression as a certificate quotes it."""
    text = str(expression)
    return text if len(text) <= most else text[: most - 3] + "..."


def bounds(tree: Node) -> Bounds:
    """Exp-log functions that enclose the tree's value from some k on."""
    if isinstance(tree, Number):
        exact = sp.Rational(tree.value.numerator, tree.value.denominator)
        return exact, exact
    if isinstance(tree, Name):
        name = sp.Symbol(tree.name, positive=True)
        return name, name
    if tree.name == "**":
        return _power(tree)
    rule: Callable[..., Bounds] = RULES[tree.name]
    return rule(*(bounds(argument) for argument in tree.arguments))


def log_of(expression: Any) -> Any:
    """The logarithm of what is positive from some k on, taken apart as far as signs are known."""
    if expression.is_Mul:
        return sp.Add(*(log_of(factor if sign(factor) > 0 else -factor) for factor in expression.args))
    if isinstance(expression, sp.exp):
        return expression.args[0]
    if expression.is_Pow:
        base, exponent = expression.as_base_exp()
        if sign(base) > 0:
            return exponent * log_of(base)
        if exponent.is_even:
            return exponent * log_of(-base)
    return sp.log(expression)


def _refuse_parameters_in_exponents(expression: Any) -> None:
    if has_parameters_in_exponents(expression):
        raise UndecidedError(f"what {shortened(expression)} does for large k {_depends(expression)}")


def _order(left: Any, right: Any) -> int:
    """-1, 0 or 1 as left is below, equal to or above right from some k on."""
    if left is right:
        return 0
    if not has_parameters_in_exponents(left - right):
        return sign(left - right)
    if sign(left) <= 0 or sign(right) <= 0:
        if sign(left) == sign(right) == -1:
            return _order(-right, -left)
        return sign(left) - sign(right)
    for expression in (left, right):
        refuse_cancelling(expression)
    ratio = limit_of_sum(log_of(left) - log_of(right))
    if ratio == 0:
        raise UndecidedError(f"the order of {shortened(left)} and {shortened(right)} {_depends(left - right)}")
    return sign(ratio)


def _depends(expression: Any) -> str:
    others = sorted(str(name) for name in expression.free_symbols - {K})
    return f"depends on {' and '.join(others)}" if others else "is not known"


def _least(*expressions: Any) -> Any:
    found = expressions[0]
    for other in expressions[1:]:
        if _order(other, found) < 0:
            found = other
    return found


def _greatest(*expressions: Any) -> Any:
    found = expressions[0]
    for other in expressions[1:]:
        if _order(other, found) > 0:
            found = other
    return found


def _exact(*pairs: Bounds) -> bool:
    return all(low is high for low, high in pairs)


def _both(expression: Any) -> Bounds:
    return expression, expression


def _negative(of: Bounds) -> Bounds:
    return _both(-of[0]) if _exact(of) else (-of[1], -of[0])


def _sum(left: Bounds, right: Bounds) -> Bounds:
    return _both(left[0] + right[0]) if _exact(left, right) else (left[0] + right[0], left[1] + right[1])


def _difference(left: Bounds, right: Bounds) -> Bounds:
    return _sum(left, _negative(right))


def _product(left: Bounds, right: Bounds) -> Bounds:
    if _exact(left, right):
        return _both(left[0] * right[0])
    if sign(left[0]) >= 0 and sign(right[0]) >= 0:
        return left[0] * right[0], left[1] * right[1]
    corners = [a * b for a in left for b in right]
    return _least(*corners), _greatest(*corners)


def _quotient(above: Bounds, below: Bounds) -> Bounds:
    if sign(below[0]) * sign(below[1]) <= 0:
        raise UndecidedError(f"the denominator {shortened(below[0])} is, or may be, 0 again and again")
    return _product(above, _both(1 / below[0]) if _exact(below) else (1 / below[1], 1 / below[0]))


def _growing(function: Any, least_sign: int | None, what: str) -> Any:
    """The rule of a growing function, defined where its argument's sign is at least ``least_sign``."""

    def rule(of: Bounds) -> Bounds:
        if least_sign is not None and sign(of[0]) < least_sign:
            raise UndecidedError(f"{what} of {shortened(of[0])}, which is, or may be, too small again and again")
        return _both(function(of[0])) if _exact(of) else (function(of[0]), function(of[1]))

    return rule


def _power(tree: Operation) -> Bounds:
    base, exponent = bounds(tree.arguments[0]), tree.arguments[1]
    if isinstance(exponent, Number) and exponent.value.denominator == 1:
        return _whole_power(base, exponent.value)
    power = bounds(exponent)
    if sign(base[0]) <= 0:
        raise UndecidedError(f"a power of {shortened(base[0])}, which is, or may be, negative or 0 again and again")
    if _exact(base, power):
        return _both(sp.Pow(base[0], power[0]))
    logarithm = (log_of(base[0]), log_of(base[1]))
    low, high = _product(power, _both(logarithm[0]) if _exact(base) else logarithm)
    return sp.exp(low), sp.exp(high)


def _whole_power(base: Bounds, exponent: Fraction) -> Bounds:
    power = sp.Integer(exponent.numerator)
    if power < 0:
        return _quotient(_both(sp.S.One), _whole_power(base, -exponent))
    if _exact(base):
        return _both(base[0] ** power)
    if sign(base[0]) >= 0 or power % 2 == 1:
        return base[0] ** power, base[1] ** power
    size = _absolute(base)
    return size[0] ** power, size[1] ** power


def _absolute(of: Bounds) -> Bounds:
    if sign(of[0]) >= 0:
        return of
    if sign(of[1]) <= 0:
        return _negative(of)
    return sp.S.Zero, _greatest(-of[0], of[1])


def _smaller(left: Bounds, right: Bounds) -> Bounds:
    low = _least(left[0], right[0])
    return _both(low) if _exact(left, right) else (low, _least(left[1], right[1]))


def _larger(left: Bounds, right: Bounds) -> Bounds:
    return _negative(_smaller(_negative(left), _negative(right)))


def _floor(of: Bounds) -> Bounds:
    low, high = _floor_of(of[0]), _floor_of(of[1])
    return _both(low[0]) if low[0] == high[1] else (low[0], high[1])


def _floor_of(expression: Any) -> Bounds:
    """Near a finite limit floor is constant in the end; otherwise it is within 1 of its argument."""
    refuse_cancelling(expression)
    to = limit(expression)
    if to.is_infinite:
        return expression - 1, expression
    if to.is_integer:
        return _both(to if sign(expression - to) >= 0 else to - 1)
    if to.is_integer is None or not sp.floor(to).is_Integer:
        raise UndecidedError(f"the floor of {shortened(expression)} {_depends(expression)}")
    return _both(sp.floor(to))


def _ceil(of: Bounds) -> Bounds:
    return _negative(_floor(_negative(of)))


RULES: dict[str, Any] = {
    "+": _sum, "-": _difference, "*": _product, "/": _quotient, "negative": _negative, "min": _smaller,
    "max": _larger, "abs": _absolute, "floor": _floor, "ceil": _ceil, "exp": _growing(sp.exp, None, "exp"),
    "log": _growing(sp.log, 1, "the logarithm"), "sqrt": _growing(sp.sqrt, 0, "the root"),
}  # fmt: skip
