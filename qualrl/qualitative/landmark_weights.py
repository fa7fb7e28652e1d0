"""The weights of the landmark step, eta_n = eta0 ** (m ** n) for n = 0, 1, 2, ...: their total, with certainty.

They fall ever faster: eta_{n+1} / eta_n = eta0 ** (m**n * (m - 1)), which is at most eta0 ** (m - 1) < 1.  So what
follows eta_N adds up to at most eta_N / (1 - its ratio), and the product of all 1 - eta_n, the share of its own value
that a landmark keeps after every step there can be, lies between the product so far less that rest and the product so
far.  All arithmetic is on intervals that enclose the exact numbers, so the printed bounds hold to the last digit.
"""

from dataclasses import dataclass
from functools import cache
from math import floor, inf, nextafter
from typing import Any

from qualrl.errors import SettingError

MOST_TERMS = 5000
NEGLIGIBLE = 1e-30
DIGITS = 40


@dataclass(frozen=True)
class LandmarkWeights:
    """Proven bounds, each a pair (at least, at most)."""

    eta0: float
    m: float
    total: tuple[float, float]
    """Of all weights: finite, which is what the landmark step needs so as not to disturb Theorem 2."""
    kept: tuple[float, float]
    """Product of 1 - eta_n: the share of its own value that a landmark keeps."""
    lines: tuple[str, ...]


def landmark_weights(eta0: float, m: float) -> LandmarkWeights:
    """Bound the total of the landmark step's weights, for 0 <= eta0 < 1 and m > 1."""
    if not (0 <= eta0 < 1 and 1 < m < inf):
        raise SettingError(f"need 0 <= eta0 < 1 and m > 1, got eta0 = {eta0!r} and m = {m!r}")
    if eta0 == 0:
        return LandmarkWeights(eta0, m, (0.0, 0.0), (1.0, 1.0), ("eta0 is 0: there is no landmark step",))
    total, kept, count = _bounded(repr(eta0), repr(m))
    ratio = eta0 ** (m - 1)
    lines = (
        ratio_line() + (f" = {ratio:.6g}" if ratio < 0.999999 else " < 1") + ": the total is finite",
        f"the sum of eta_n over all n is {_shown(total)} ({count} terms, and a geometric bound on the rest)",
        f"the product of 1 - eta_n over all n is {_shown(kept)}: "
        f"a landmark keeps at least {floor(1000 * kept[0]) / 10:g} % of its own value",
    )
    return LandmarkWeights(eta0, m, total, kept, lines)


@cache
def ratio_line() -> str:
    """The step of the proof that holds for every eta0 and m, as sympy confirms it."""
    import sympy as sp

    size, growth = sp.symbols("L d", positive=True)
    n = sp.Symbol("n", integer=True, nonnegative=True)
    log_eta = -size * (1 + growth) ** n  # of eta0 = exp(-L), m = 1 + d
    log_ratio = log_eta.subs(n, n + 1) - log_eta
    if sp.simplify(log_ratio + size * growth * (1 + growth) ** n) != 0:
        raise AssertionError("sympy does not confirm the ratio of the weights")
    return (
        "with eta0 = exp(-L) and m = 1 + d: log(eta_{n+1}/eta_n) = -L*d*(1 + d)**n <= -L*d, "
        "so each weight is at most the one before times eta0**(m - 1)"
    )


def _bounded(eta0: str, m: str) -> tuple[tuple[float, float], tuple[float, float], int]:
    """Bounds of the sum and of the product, and how many terms they took."""
    import mpmath

    numbers = mpmath.ctx_iv.MPIntervalContext()
    numbers.dps = DIGITS
    log_eta0, growth = numbers.log(numbers.mpf(eta0)), numbers.mpf(m)
    total, kept, exponent, count = numbers.mpf(0), numbers.mpf(1), numbers.mpf(1), 0
    weight = numbers.exp(log_eta0)
    while count < MOST_TERMS and weight.b > NEGLIGIBLE:
        total += weight
        kept *= 1 - weight
        exponent *= growth
        count += 1
        weight = numbers.exp(log_eta0 * exponent)
    ratio = numbers.exp(log_eta0 * exponent * (growth - 1))
    rest = weight / (1 - ratio)
    least_kept = kept * (1 - rest) if rest.b < 1 else numbers.mpf(0)
    return (_down(total.a), _up((total + rest).b)), (_down(least_kept.a), min(1.0, _up(kept.b))), count


def _down(value: Any) -> float:
    return max(0.0, nextafter(float(value), -inf))


def _up(value: Any) -> float:
    return nextafter(float(value), inf)


def _shown(pair: tuple[float, float]) -> str:
    """The decimal that both bounds round to, or both bounds."""
    for digits in range(12, 2, -1):
        low, high = (f"{value:.{digits}g}" for value in pair)
        if low == high:
            return f"{low} (proven to that rounding)"
    return f"between {pair[0]:.6g} and {pair[1]:.6g}"
