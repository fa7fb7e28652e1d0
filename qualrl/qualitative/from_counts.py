"""Intervals from counts: between what a probability or a law of times lies, with a given confidence.

Both hold for any number of trials, few included, and whatever the law of the times is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from qualrl.errors import SettingError

MOST_TRIALS = 10**9
"""Beyond, the interval's ends are lost in rounding."""


@dataclass(frozen=True)
class Counts:
    """So many of so many trials came out so."""

    hits: int
    trials: int

    def __post_init__(self) -> None:
        is_whole = type(self.hits) is int and type(self.trials) is int
        if not is_whole or not 0 <= self.hits <= self.trials or not 0 < self.trials <= MOST_TRIALS:
            raise SettingError(
                f"{self.hits} of {self.trials} is no count: give hits of trials in whole numbers, as 7 of 10, "
                f"up to {MOST_TRIALS:,}"
            )

    def interval(self, confidence: float) -> tuple[float, float]:
        """Of the probability (Clopper and Pearson 1934)."""
        from scipy.special import betaincinv  # SciPy loads slowly, and most questions need none

        tail, misses = (1 - confidence) / 2, self.trials - self.hits
        low = float(betaincinv(self.hits, misses + 1, tail)) if self.hits else 0.0
        return low, float(betaincinv(self.hits + 1, misses, 1 - tail)) if misses else 1.0


@dataclass(frozen=True)
class Samples:
    """How many times as long as on the map something took, each time that it was measured."""

    times: tuple[float, ...]

    def __post_init__(self) -> None:
        is_plain = all(isinstance(time, int | float) for time in self.times)
        if not self.times or not is_plain or not all(math.isfinite(time) and time >= 0 for time in self.times):
            raise SettingError(f"times must be finite numbers, not negative, got {', '.join(map(str, self.times))}")

    def interval(self, leg: float, confidence: float) -> tuple[float, float]:
        """Of E[leg^(f - 1)] for a law of times f; leg: gamma^n, above 0.

        The law's distribution function lies within a band around the samples' (Dvoretzky, Kiefer and Wolfowitz 1956,
        constant by Massart 1990), so at most that share of the times is for ever, or none at all.  It holds for every
        leg at once.
        """
        band = min(math.sqrt(math.log(2 / (1 - confidence)) / (2 * len(self.times))), 1.0)
        worths = [leg ** (time - 1) for time in sorted(self.times)]  # falling
        return _mean_without(worths, band), _mean_without(worths[::-1], band) + band / leg


def _mean_without(worths: Sequence[float], share: float) -> float:
    """The mean when a share of the samples, the first ones, is worth nothing."""
    left, total = share * len(worths), 0.0
    for worth in worths:
        total += worth * (1 - min(left, 1.0))
        left = max(left - 1.0, 0.0)
    return total / len(worths)
