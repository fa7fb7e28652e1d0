"""What a plan may be worth while some of its numbers are known as intervals only.

Values are shifted, W = V - c / (1 - gamma) with c the reward of a step: staying for ever is worth 0.  A plan is a tree,
W = x * (reward + discount * W of ``then``) + (1 - x) * (W of ``instead``), where x is a number in [0, 1], or more:
the probability that a doorway is open, with what comes beyond it, and back and round; or what waiting takes off.
Waiting w steps and then W is worth gamma^w * W, whatever w is, so for a leg of n steps that takes f times as long
x = gamma^((f - 1) n); and if the time is random, E[gamma^tau] / gamma^n.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

Box = Mapping[str, tuple[float, float]]
"""From the key of a number to the interval that holds it."""
Point = Mapping[str, float]
Bounds = tuple[float, float, dict[str, float], dict[str, float]]
"""A least and a greatest worth, and numbers that tend to give them; the worths are certain, the numbers a guess."""
NOTHING: Bounds = 0.0, 0.0, {}, {}
A_NODE = 16.0
"""Roundings at a node, at most: of a reward, powers, products and sums."""


@dataclass(frozen=True)
class Number:
    """A number x of the tree, by the one that is asked about."""

    key: str
    leg: float | None = None
    """gamma^n of a leg, for the times f that it takes: x = leg^(f - 1); None where x is the number itself."""

    def at(self, number: float) -> float:
        """X."""
        return number if self.leg is None else float(self.leg ** (number - 1.0))


@dataclass(frozen=True, eq=False)
class Outlook:
    """A plan from some point on; see the module."""

    reward: float = 0.0
    """Shifted, of what comes next."""
    discount: float = 1.0
    """Of what comes after that."""
    then: "Outlook | None" = None
    """None where the plan ends: worth 0."""
    number: Number | None = None
    """None for x = 1."""
    instead: "Outlook | None" = None
    """None for staying for ever: worth 0."""
    amounts: float = 0.0
    """How large those are that the reward is the sum of: their rounding is what is wrong with it."""

    def value(self, point: Point) -> float:
        """Shifted, with a number for each key."""
        onward = self.reward + (0.0 if self.then is None else self.discount * self.then.value(point))
        if self.number is None:
            return onward
        x = self.number.at(point[self.number.key])
        return x * onward + (0.0 if self.instead is None else (1.0 - x) * self.instead.value(point))

    def bounds(self, box: Box) -> Bounds:
        """Between what the shifted value lies, whatever numbers the box holds."""
        onward = moved(self.reward, self.discount, NOTHING if self.then is None else self.then.bounds(box))
        return mixed(self.number, box, onward, NOTHING if self.instead is None else self.instead.bounds(box))

    @cached_property
    def in_size(self) -> "Outlook":
        """The same with amounts for rewards."""
        then, instead = (None if of is None else of.in_size for of in (self.then, self.instead))
        return replace(self, reward=max(self.amounts, abs(self.reward)), then=then, instead=instead)

    def roundings(self, box: Box) -> float:
        """How often is rounded at most on one way through the tree; a power is wrong by more the larger it is."""
        onward = max(0.0 if of is None else of.roundings(box) for of in (self.then, self.instead))
        if self.number is None or self.number.leg is None:
            return A_NODE + onward
        return A_NODE + box[self.number.key][1] * (1.0 - math.log(self.number.leg)) + onward

    @cached_property
    def times(self) -> dict[str, int]:
        """How often each key is met at most on one way through the tree."""
        own = {} if self.number is None else {self.number.key: 1}
        return _times(own, self.then, self.instead)

    @cached_property
    def places(self) -> Counter[str]:
        """At how many places of the tree each key stands."""
        own = Counter[str]() if self.number is None else Counter({self.number.key: 1})
        return sum((of.places for of in (self.then, self.instead) if of is not None), own)

    @cached_property
    def powers(self) -> frozenset[str]:
        """Keys of numbers that are not x themselves."""
        own = {self.number.key} if self.number is not None and self.number.leg is not None else set()
        return frozenset(own).union(*(of.powers for of in (self.then, self.instead) if of is not None))


def moved(reward: float, discount: float, of: Bounds) -> Bounds:
    """What is paid now, and after it the rest."""
    low, high, at_low, at_high = of
    return reward + discount * low, reward + discount * high, at_low, at_high


def mixed(number: Number | None, box: Box, onward: Bounds, instead: Bounds) -> Bounds:
    """The sum, which is linear in x: an end of x gives the least, and one the greatest."""
    if number is None:
        return onward
    ends = box[number.key]
    found = [_weighed(number.at(end), onward, instead) for end in ends]
    least = 0 if found[0][0] <= found[1][0] else 1
    most = 0 if found[0][1] >= found[1][1] else 1
    return (
        found[least][0], found[most][1],
        {**found[least][2], number.key: ends[least]}, {**found[most][3], number.key: ends[most]},
    )  # fmt: skip


def _weighed(x: float, onward: Bounds, instead: Bounds) -> Bounds:
    """A leg that takes less time than on the map has x above 1, and then nothing ``instead`` but 0."""
    low, high, at_low, at_high = onward
    other_low, other_high, at_other_low, at_other_high = instead
    return (
        x * low + (1.0 - x) * other_low, x * high + (1.0 - x) * other_high,
        {**at_other_low, **at_low}, {**at_other_high, **at_high},
    )  # fmt: skip


def _times(own: dict[str, int], *parts: Outlook | None) -> dict[str, int]:
    """The same for a node, by those of its parts."""
    found = dict(own)
    for part in parts:
        for key, count in {} if part is None else part.times.items():
            found[key] = max(found.get(key, 0), count + own.get(key, 0))
    return found
