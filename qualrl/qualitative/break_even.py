"""How likely a door must be open for it to pay to try it: a formula in gamma.

Who tries goes to the door; where it is open, on through it (a way worth ``open``), and where not, back and round
(``closed``).  Who does not try goes round at once (``round``).  Trying is worth p * open + (1 - p) * closed, which
grows with p wherever open > closed, and is worth as much as going round at p* = (round - closed) / (open - closed).
"""

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

from qualrl.qualitative.plan_value import Contrast, Course, combined, contrast

if TYPE_CHECKING:
    import sympy

DIGITS = 60
"""Differences of long ways are small beside the ways' values."""


@dataclass(frozen=True)
class BreakEven:
    """The three ways that trying a door or not can lead to."""

    open: Course
    closed: Course
    round: Course

    def at(self, gamma: float) -> float | None:
        """p* at a gamma in (0, 1); None where an open door is worth no more than a closed one."""
        above, below = (_at(terms, gamma) for terms in self._terms)
        return None if below == 0 else float(above / below)

    def more_than_round(self, gamma: float) -> tuple[Decimal, Decimal]:
        """By how much an open door is worth more than going round, and a closed one, to many digits."""
        opened, closed = (_at(combined((1, way), (-1, self.round)), gamma) for way in (self.open, self.closed))
        with localcontext(prec=DIGITS):
            return opened / (1 - Decimal(gamma)), closed / (1 - Decimal(gamma))

    def signs_at(self, gamma: float) -> tuple[int, int]:
        """Whether an open door is worth more (1), as much (0) or less (-1) than going round; and a closed one."""
        opened, closed = self.more_than_round(gamma)
        return _sign(opened), _sign(closed)

    @property
    def limit(self) -> Fraction | None:
        """p* as gamma tends to 1; None where it has no limit, or an open door gains nothing."""
        above, below = self._terms
        if not below:
            return None
        while (divisor := sum(below.values())) == 0:
            if sum(above.values()) != 0:
                return None
            above, below = _derivative(above), _derivative(below)
        return sum(above.values(), Fraction(0)) / divisor

    def formula(self) -> "sympy.Expr":
        """p* in the symbol gamma."""
        return (self.round.formula() - self.closed.formula()) / (self.open.formula() - self.closed.formula())

    @cached_property
    def grows(self) -> Contrast:
        """An open door against a closed one: where the first is worth more, trying is worth the more the likelier."""
        return contrast(self.open, self.closed)

    @cached_property
    def _terms(self) -> tuple[dict[int, Fraction], dict[int, Fraction]]:
        return combined((1, self.round), (-1, self.closed)), combined((1, self.open), (-1, self.closed))


def _at(terms: dict[int, Fraction], gamma: float) -> Decimal:
    with localcontext(prec=DIGITS):
        powers = ((Decimal(of.numerator) / of.denominator, Decimal(gamma) ** k) for k, of in terms.items())
        return sum((of * power for of, power in powers), Decimal(0))


def _sign(of: Decimal) -> int:
    return (of > 0) - (of < 0)


def _derivative(terms: dict[int, Fraction]) -> dict[int, Fraction]:
    return {k - 1: k * of for k, of in terms.items() if k}
