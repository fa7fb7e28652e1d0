"""The rows of the one table, their verdicts, and how they are printed.

A row holds a ratio of every round.  Its verdict goes by their median, or by the worst where the target is one that
each has to meet; it is computed here and nowhere else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Target:
    """What a ratio must be."""

    limit: float
    at_least: bool
    each: bool = False
    """Whether every one of the ratios must keep to it, not their median."""

    def reached(self, ratios: Sequence[float]) -> bool:
        """Whether ratios keep to it."""
        worst = min if self.at_least else max
        judged = worst(ratios) if self.each else float(np.median(ratios))
        return judged >= self.limit if self.at_least else judged <= self.limit

    def __str__(self) -> str:
        return f"{'>=' if self.at_least else '<='} {short(self.limit)}{' each' if self.each else ''}"


def at_least(limit: float, each: bool = False) -> Target:
    """Ratios of this or more."""
    return Target(limit, True, each)


def at_most(limit: float, each: bool = False) -> Target:
    """Ratios of this or less."""
    return Target(limit, False, each)


WITHIN_BOUND = at_most(1)
"""For what is divided by the most that it may be."""


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    subject: int
    """Which of the targets it belongs to."""
    what: str
    ours: str = ""
    beside: str = ""
    """The peer, or the bound, that ours is divided by or that is divided by ours."""
    ratios: Sequence[float] = ()
    target: Target | None = None
    """None where none was set: the row is there to compare."""
    missing: str = ""
    """Why nothing was measured, in a few words."""

    @property
    def verdict(self) -> str:
        """Whether the target is reached: "yes", "NO", "?" where nothing was measured, "-" without a target."""
        if self.missing:
            return "?"
        if self.target is None:
            return "-"
        return "yes" if self.target.reached(self.ratios) else "NO"

    @property
    def cells(self) -> tuple[str, ...]:
        """What stands in the columns."""
        ratio = self.missing or spread(self.ratios)
        return str(self.subject), self.what, self.ours, self.beside, ratio, str(self.target or "-"), self.verdict


def bounded(subject: int, what: str, unit: str, measured: Sequence[float], most: float) -> Row:
    """A row for what may be ``most`` at most."""
    return Row(
        subject, what, f"{short(float(np.median(measured)))} {unit}", f"bound {short(most)} {unit}",
        [value / most for value in measured], WITHIN_BOUND,
    )  # fmt: skip


def short(value: float) -> str:
    """A number in three digits, whole from 100 on."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def spread(values: Sequence[float]) -> str:
    """Median (least to most); the value alone when there is one."""
    if not len(values):
        return ""
    middle = short(float(np.median(values)))
    return middle if len(values) == 1 else f"{middle} ({short(min(values))} to {short(max(values))})"


HEADINGS = "#", "what", "ours", "beside", "ratio: median (range)", "target", "reached"
WIDTHS = 2, 51, 24, 36, 26, 12, 7


def line(cells: Sequence[str]) -> str:
    """One line of text; what is too wide for its column pushes the rest aside."""
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, WIDTHS, strict=True)).rstrip()


def summary(rows: Sequence[Row]) -> str:
    """How many targets are reached."""
    verdicts = [row.verdict for row in rows]
    counts = {word: verdicts.count(word) for word in ("yes", "NO", "?")}
    return f"{counts['yes']} reached, {counts['NO']} not, {counts['?']} not measured"
