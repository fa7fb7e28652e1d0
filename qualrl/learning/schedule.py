"""Learning rates: a number, or a formula in k = 0, 1, 2, ...

A compiled kernel looks alpha_k up in ``Schedule.table()`` at

    index(k) = k                                                   for k < 65536
    index(k) = 65536 + floor(log(k / 65536) / log1p(1 / 1024))     from there on, at most the last index

so alpha_k is exact for the first 65536 values of k, and from there on it is the alpha of a k' <= k with
k / k' < 1 + 1/1024 (for k**-p that is within p/1024, relatively) up to k = 2**40, where the last value stays.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from math import floor, isfinite, log, log1p

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import FormulaError, SettingError
from qualrl.qualitative.expression import evaluated
from qualrl.qualitative.formula import Formula, constant_formula, parse_formula

EXACT = 65536
"""alpha_k has a table entry of its own for k below this."""
STEP = 1 / 1024
LAST_K = 2**40
LOG_STEP = log1p(STEP)
ENTRIES = EXACT + floor(log(LAST_K / EXACT) / LOG_STEP) + 1
NEVER_ZERO = 8192
"""alpha_k must be above 0 for k below this; later it may be so small that float64 has 0 for it."""


@dataclass(frozen=True)
class Schedule:
    """A learning rate.  Made by ``schedule_of``, which checks it; equal when text and formula are."""

    formula: Formula

    @property
    def text(self) -> str:
        """As written: the formula, or the number."""
        return self.formula.text

    @cached_property
    def constant(self) -> float | None:
        """The number it is at every k; None for a formula in k."""
        return None if self.formula.names else float(evaluated(self.formula.tree, {}))

    def weights(self, count: int) -> NDArray[np.float64]:
        """(count,) float64: alpha_0, alpha_1, ..."""
        return self.formula.values(0, count)

    def table(self) -> NDArray[np.float64]:
        """(ENTRIES,) float64: alpha at ``table_k``, for look-up by ``index_of``."""
        return self.formula.values_at(table_k())

    def index_of(self, k: int) -> int:
        """Where ``table`` holds alpha_k."""
        return index_of(k)


def index_of(k: int) -> int:
    """Where a table holds alpha_k: as the head of this file says."""
    if k < EXACT:
        return k
    return min(EXACT + int(log(k / EXACT) / LOG_STEP), ENTRIES - 1)


@cache
def table_k() -> NDArray[np.float64]:
    """(ENTRIES,) the k of each table entry, whole numbers in float64; locked."""
    steps = np.arange(ENTRIES - EXACT)
    later = np.ceil(EXACT * np.exp(steps * LOG_STEP))
    k = np.concatenate([np.arange(EXACT, dtype=np.float64), later])
    k.setflags(write=False)
    return k


@lru_cache(maxsize=64, typed=True)
def schedule_of(value: float | str) -> Schedule:
    """A learning rate from a number in (0, 1], or a formula in k with such values.

    FormulaError when the formula cannot be read; SettingError names the first k whose value is out of range.

    >>> schedule_of("1/(1 + k)**0.85").weights(2)[0]
    np.float64(1.0)
    """
    if isinstance(value, str):
        schedule = Schedule(parse_formula(value))
    elif isinstance(value, bool) or not isfinite(value):
        raise SettingError(f"alpha must be a number above 0 and at most 1, or a formula in k, got {value!r}")
    else:
        schedule = Schedule(constant_formula(float(value)))
    _check(schedule)
    return schedule


def _check(schedule: Schedule) -> None:
    if schedule.constant is not None:
        if not 0 < schedule.constant <= 1:
            raise SettingError(f"alpha must be above 0 and at most 1, got {schedule.text}")
        return
    try:
        values = schedule.table()
    except FormulaError as problem:
        raise SettingError(f"alpha: {problem}") from None
    wrong = np.flatnonzero((values > 1) | (values < 0) | ((values == 0) & (table_k() < NEVER_ZERO)))
    if wrong.size:
        first = wrong[0]
        raise SettingError(
            f"alpha must be above 0 and at most 1, but {schedule.text} is {values[first]:.6g} at "
            f"k = {table_k()[first]:.0f} (k counts from 0)"
        )
