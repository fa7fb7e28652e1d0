"""Medians, intervals and fits: the few statistics that verdicts stand on.

N runs (one a seed).  Every interval is meant to hold 95 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Floats = NDArray[np.float64]

TAILS = (2.5, 50.0, 97.5)
RESAMPLES = 2000
FEW = 6
"""With fewer runs no interval of the median reaches 95 %: the extremes stand in for it."""


@dataclass(frozen=True)
class Spread:
    """A number and its interval."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        """As tables show it."""
        return f"{number(self.median)} ({number(self.low)} to {number(self.high)})"


def number(value: float) -> str:
    """A number as tables show it: three significant digits, or all before the decimal point.

    >>> number(2764.2), number(32.333), number(-0.98765)
    ('2764', '32.3', '-0.988')
    """
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def spread(sample: Floats) -> Spread:
    """Median of N runs and the interval that holds 95 % of them."""
    low, median, high = np.percentile(sample, TAILS)
    return Spread(float(median), float(low), float(high))


def median_interval(sample: Floats) -> Spread:
    """Median of N runs and the interval of that median, by the percentile bootstrap."""
    median = float(np.median(sample))
    if len(sample) < 2:
        return Spread(median, float("-inf"), float("inf"))
    if len(sample) < FEW:
        return Spread(median, float(sample.min()), float(sample.max()))
    low, high = np.percentile(_resampled_medians(sample, np.random.default_rng(0)), (TAILS[0], TAILS[2]))
    return Spread(median, float(low), float(high))


def _resampled_medians(sample: Floats, random: np.random.Generator) -> Floats:
    medians: Floats = np.median(sample[random.integers(len(sample), size=(RESAMPLES, len(sample)))], axis=1)
    return medians


def ratio_of_medians(upper: Floats, lower: Floats) -> Spread:
    """Median of ``upper`` over median of ``lower``; its interval by the percentile bootstrap (Efron 1979).

    The resampling has a stream of its own, so the same runs always give the same interval.
    """
    ratio = float(np.median(upper) / np.median(lower))
    if min(len(upper), len(lower)) < 2:
        return Spread(ratio, 0.0, float("inf"))
    if min(len(upper), len(lower)) < FEW:
        return Spread(ratio, float(upper.min() / lower.max()), float(upper.max() / lower.min()))
    random = np.random.default_rng(0)
    resampled = [_resampled_medians(sample, random) for sample in (upper, lower)]
    low, high = np.percentile(resampled[0] / resampled[1], (TAILS[0], TAILS[2]))
    return Spread(ratio, float(low), float(high))


def share(hits: Floats) -> Spread:
    """Share of N runs for which something is so, with the exact binomial interval (Clopper and Pearson 1934)."""
    count = int(hits.sum())
    interval = stats.binomtest(count, len(hits)).proportion_ci(0.95, method="exact")
    return Spread(count / len(hits), float(interval.low), float(interval.high))


def least_squares(terms: dict[str, Sequence[float]], values: Sequence[float]) -> dict[str, Spread]:
    """Coefficient of each term, and of "1", in a linear fit, with Student's interval from the residuals.

    The interval holds what the runs scatter and also what the straight line fails to describe.
    """
    design = np.column_stack([np.ones(len(values)), *terms.values()])
    wanted = np.asarray(values, np.float64)
    coefficients, *_ = np.linalg.lstsq(design, wanted, rcond=None)
    freedom = len(wanted) - design.shape[1]
    if freedom < 1:
        raise ValueError(f"{len(wanted)} points cannot judge a fit of {design.shape[1]} coefficients")
    residual = wanted - design @ coefficients
    variance = float(residual @ residual) / freedom
    error = np.sqrt(variance * np.diag(np.linalg.inv(design.T @ design))) * float(stats.t.ppf(0.975, freedom))
    return {
        name: Spread(float(c), float(c - e), float(c + e))
        for name, c, e in zip(("1", *terms), coefficients, error, strict=True)
    }
