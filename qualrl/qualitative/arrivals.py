"""Which of two ways is better at every discount of a range, from what they are worth at a few discounts.

Let K be what the dearest step costs.  A policy's value and K / (1 - gamma), which is the same for all, are together a
sum of powers of gamma, none of them with a negative factor: each step is paid K more than it is, and K is paid for ever
after the last one.  With u = log(gamma), the logarithm of such a sum is convex in u (Hoelder's inequality), and so is
the largest of several policies' at each u; and both grow with u.  A convex curve lies below its chords, and above them
where they are drawn out beyond their ends.  So a few points of a curve bound it everywhere between them, however moves
slip.

Where every step is paid r < 0 and the last one W, that sum is (W - r / (1 - gamma)) * E[gamma ** (T - 1)] of a policy
that takes T steps.  Then E[gamma ** (T - 1)] alone is such a sum too, and tells more.

What was solved is not quite on the curve: values settle to a relative tolerance of their backups.  If no value v
exceeds its backup, or falls short of it, by more than a share e, it lies between the true values for gamma * (1 - e)
and rewards smaller by that share, and for gamma * (1 + e) and larger ones: gamma was off by no more.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

OFF = 4e-12
"""By what share gamma may seem to be off at most: sweeps end at 1e-12, and what is solved next builds on that."""
ROUNDED = 1e-13
"""A logarithm may be rounded by this much, and by this share of itself."""


@dataclass(frozen=True)
class Solved:
    """Two ways at one discount."""

    gamma: float
    """In (0, 1)."""
    logs: tuple[float, float]
    """The logarithm of the sum of each."""
    most: tuple[float, float] = (0.0, 0.0)
    """(u, logarithm) at a larger u than here that neither curve is above; E[gamma ** (T - 1)] is never above 1."""

    @property
    def u(self) -> float:
        """The logarithm of gamma."""
        return math.log(self.gamma)

    def off(self, way: int) -> float:
        """How far the logarithm may be from the truth: a convex curve is no steeper than on to where it is at most."""
        log = self.logs[way]
        return OFF * (1 + _through((self.u, log), self.most).slope) + ROUNDED * (1 + abs(log))

    @property
    def sign(self) -> int:
        """1 if the first is better here, -1 if the second is, 0 if they are too much alike to tell."""
        ahead, off = self.logs[0] - self.logs[1], self.off(0) + self.off(1)
        return (ahead > off) - (ahead < -off)


@dataclass(frozen=True)
class _Line:
    """Through a point."""

    u: float
    log: float
    slope: float

    def at(self, u: float) -> float:
        return self.log + self.slope * (u - self.u)

    def meets(self, other: "_Line") -> float | None:
        """Where; None for parallels."""
        if self.slope == other.slope:
            return None
        return (other.at(0.0) - self.at(0.0)) / (self.slope - other.slope)


def sign_between(points: Sequence[Solved], at: int) -> int:
    """1 if the first way is better from ``points[at]`` to the next one (by gamma, which grows), -1 if the second is.

    0 if the points do not tell.
    """
    return int(_least_ahead(points, at, 0) > 0) - int(_least_ahead(points, at, 1) > 0)


def left_open(points: Sequence[Solved], at: int) -> float:
    """How far bounds between ``points[at]`` and the next one are from telling, as a share of what there is to tell.

    Infinite where the points themselves tell nothing, or one way is better at one of them and the other at the other.
    """
    one, other = points[at : at + 2]
    if one.sign * other.sign < 0 or not (one.sign or other.sign):
        return math.inf
    ahead = 0 if one.sign + other.sign > 0 else 1
    tell = min(abs(point.logs[0] - point.logs[1]) for point in (one, other))
    return -_least_ahead(points, at, ahead) / tell if tell else math.inf


def _least_ahead(points: Sequence[Solved], at: int, way: int) -> float:
    """By how much a way's lower bounds are above the other way's upper bound at least."""
    low, high = points[at].u, points[at + 1].u
    most = _through(*(_end(points[of], 1 - way, 1) for of in (at, at + 1)))
    least = list(_lower_bounds(points, at, way))
    meetings = [meeting for one, other in combinations(least, 2) if (meeting := one.meets(other)) is not None]
    corners = [low, high, *(u for u in meetings if low < u < high)]
    return min(max(line.at(u) for line in least) - most.at(u) for u in corners)


def _lower_bounds(points: Sequence[Solved], at: int, way: int) -> list[_Line]:
    """Lines that a way's curve lies above from one point to the next: it grows, and it is convex."""
    begin, end = _end(points[at], way, -1), _end(points[at + 1], way, -1)
    lines = [_Line(*begin, 0.0)]
    if at > 0:
        lines.append(_Line(*begin, _through(_end(points[at - 1], way, 1), begin).slope))
    beyond = _end(points[at + 2], way, 1) if at + 2 < len(points) else points[at + 1].most
    lines.append(_Line(*end, _through(end, beyond).slope))
    return lines


def _end(point: Solved, way: int, side: int) -> tuple[float, float]:
    """(u, logarithm) surely above the curve (side 1) or below it (-1)."""
    return point.u, point.logs[way] + side * point.off(way)


def _through(one: tuple[float, float], other: tuple[float, float]) -> _Line:
    return _Line(*one, (other[1] - one[1]) / (other[0] - one[0]))
