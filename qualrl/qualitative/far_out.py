"""A term at k near 10**200 and 10**400: what exact limits must agree with.

Everything is evaluated with 1300 digits, so k + 1 and k differ as they should.
Heavy (mpmath): import only where something is proved.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import mpmath

from qualrl.qualitative.expression import Name, Node, Number

DIGITS = 1300
POINTS = (10**200 + 7, 10**400 + 9)
MOST_BITS = 1400
"""Of the argument of exp: 10**400 has 1329; beyond it exp counts as 0 or infinite."""


def slopes(tree: Node, parameters: Mapping[str, Fraction] | None = None) -> tuple[float, float] | None:
    """How fast the term falls between the two points: its slopes against log k, and of a_k k against log log k.

    (inf, inf) for a term too small to hold; None where it is not positive, or has no value.
    """
    numbers = mpmath.mp.clone()
    numbers.dps = DIGITS
    near, far = (_value(tree, numbers, {**(parameters or {}), "k": Fraction(k)}) for k in POINTS)
    if numbers.isnan(near) or numbers.isnan(far) or near < 0 or far < 0 or (near == 0 and far != 0):
        return None
    if far == 0 or near == 0:
        return float("inf"), float("inf")
    logs = [numbers.log(value) for value in (near, far)]
    log_k = [numbers.log(k) for k in POINTS]
    loglog_k = [numbers.log(value) for value in log_k]
    first = -(logs[1] - logs[0]) / (log_k[1] - log_k[0])
    second = -(logs[1] - logs[0] + log_k[1] - log_k[0]) / (loglog_k[1] - loglog_k[0])
    return float(first), float(second)


def _value(tree: Node, numbers: Any, names: Mapping[str, Fraction]) -> Any:
    if isinstance(tree, Number):
        return numbers.mpf(tree.value.numerator) / tree.value.denominator
    if isinstance(tree, Name):
        return numbers.mpf(names[tree.name].numerator) / names[tree.name].denominator
    values = [_value(argument, numbers, names) for argument in tree.arguments]
    try:
        return _applied(tree.name, values, numbers)
    except (ValueError, ZeroDivisionError, OverflowError):  # no real value here
        return numbers.nan


def _applied(name: str, values: list[Any], numbers: Any) -> Any:
    first, last = values[0], values[-1]
    if any(numbers.isnan(value) for value in values):
        return numbers.nan
    match name:
        case "+":
            return first + last
        case "-":
            return first - last
        case "*":
            return first * last
        case "/":
            return first / last
        case "**":
            return _power(first, last, numbers)
        case "negative":
            return -first
        case "exp":
            return _exp(first, numbers)
        case "log":
            return numbers.log(first) if first > 0 else numbers.nan
        case "sqrt":
            return numbers.sqrt(first) if first >= 0 else numbers.nan
        case "abs":
            return abs(first)
        case "min" | "max":
            return min(values) if name == "min" else max(values)
    return numbers.floor(first) if name == "floor" else numbers.ceil(first)


def _exp(of: Any, numbers: Any) -> Any:
    if numbers.isinf(of) or numbers.mag(of) > MOST_BITS:
        return numbers.inf if of > 0 else numbers.zero
    return numbers.exp(of)


def _power(base: Any, exponent: Any, numbers: Any) -> Any:
    if not numbers.isinf(exponent) and abs(exponent) <= 1000 and numbers.isint(exponent):
        return base ** int(exponent)
    if base <= 0:
        return numbers.nan
    return _exp(exponent * numbers.log(base), numbers)
