"""Which of two plans is better while numbers are known as intervals only: always one of them, either, or undecided.

Always better is one thing, never worse another: there the two may be worth the same for some of the numbers, as at an
end of an interval.

Bounds of the difference are worked out for the box that the intervals span, and where they leave the sign open for
parts of it: interval arithmetic, branch and bound.  A number that the difference is linear in is put to its two ends,
which loses nothing; another interval is halved.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice, product
from types import MappingProxyType

import numpy as np

from qualrl.qualitative.outlook import Box, Outlook, Point
from qualrl.qualitative.outlook_difference import difference

BETTER, EQUAL, WORSE, EITHER, UNDECIDED = "better", "equal", "worse", "either", "undecided"
NEVER_WORSE, NEVER_BETTER = "never worse", "never better"
OPPOSITE = {BETTER: WORSE, WORSE: BETTER, NEVER_WORSE: NEVER_BETTER, NEVER_BETTER: NEVER_WORSE}
ALIKE = 1e-9
"""Worths that differ by no more than rounding are the same if that is less than this share of what is paid."""
A_ROUNDING = float(np.finfo(float).eps)
"""Of what is rounded, the share that a rounding is at most."""
MOST_BOXES = 1000
"""Parts of the box that are looked at, before the order is called undecided."""
MOST_CORNERS = 64
HALVINGS = 40


@dataclass(frozen=True)
class Order:
    """How the first of two plans stands to the second, over a whole box."""

    relation: str
    """BETTER or WORSE: everywhere; EQUAL: everywhere as good; NEVER_WORSE or NEVER_BETTER: it was not proved that it is
    nowhere as good; EITHER: somewhere better and somewhere worse; UNDECIDED: none of these was proved."""
    at_better: Point | None = None
    """Numbers with which the first is better."""
    at_worse: Point | None = None
    at_equal: Point | None = None
    """Numbers with which it is as good, where it is NEVER_WORSE or NEVER_BETTER and they are known."""

    def turned(self) -> "Order":
        """How the second stands to the first."""
        return Order(OPPOSITE.get(self.relation, self.relation), self.at_worse, self.at_better, self.at_equal)


def compare(
    first: Outlook, second: Outlook, box: Box, together: Mapping[str, str] = MappingProxyType({}), paid: float = 1.0
) -> Order:  # fmt: skip
    """Compare two plans for all numbers that a box holds.

    paid: an amount as large as those that steps and the goal are paid with.  Near gamma 1 shifted worths are many times
    as large, and so is their rounding: where it is not small beside what is paid, what looks the same is undecided.
    together: keys of numbers that one thing decides (a law of times, for legs of several lengths), with its name.  Then
    EITHER is shown by numbers that are as far along in all their intervals, and what holds for the whole box holds.
    """
    keys = [key for key in box if key in first.times or key in second.times]
    search = _Search(first, second, {key: box[key] for key in keys}, together, paid)
    search.look_at(_corners(search.box))
    unsettled = search.cleared([search.box], search.settles, lambda: bool(search.better and search.worse))
    return search.order(is_whole=not unsettled)


def consistent(point: Point, box: Box, together: Mapping[str, str]) -> Point:
    """A point at which numbers that one thing decides are as far along in their intervals: on average as far as were
    they.
    """
    along: dict[str, list[float]] = {}
    for key, name in together.items():
        if key in point:
            low, high = box[key]
            along.setdefault(name, []).append((point[key] - low) / (high - low) if high > low else 0.5)
    found = dict(point)
    for key in together.keys() & point.keys():
        low, high = box[key]
        shares = along[together[key]]
        found[key] = low + (high - low) * sum(shares) / len(shares)
    return found


def sign(first: Outlook, second: Outlook, point: Point, paid: float) -> int | None:
    """1 where the first is better with these numbers, -1 where it is worse, 0 where it is as good; None where rounding
    does not let it be told.
    """
    ahead = first.value(point) - second.value(point)
    here = {key: (number, number) for key, number in point.items()}
    rounding = A_ROUNDING * sum(plan.roundings(here) * plan.in_size.value(point) for plan in (first, second))
    if abs(ahead) > rounding:
        return 1 if ahead > 0 else -1
    return 0 if rounding <= ALIKE * paid else None


def _rounding(first: Outlook, second: Outlook, box: Box) -> float:
    """By how much the difference of two plans may be wrong, whatever numbers the box holds."""
    return A_ROUNDING * sum(plan.roundings(box) * plan.in_size.bounds(box)[1] for plan in (first, second))


def _corners(box: Box) -> Iterator[Point]:
    """Some corners of a box: all where they are few; two opposite ones in any case."""
    for at in (0, 1):
        yield {key: span[at] for key, span in box.items()}
    for ends in islice(product(*({*span} for span in box.values())), MOST_CORNERS):
        yield dict(zip(box, ends, strict=True))


def _once(plan: Outlook, key: str) -> bool:
    return plan.times.get(key, 0) <= 1


def change(first: Outlook, second: Outlook, better: Point, worse: Point) -> Point:
    """Numbers between two points, close to which the first plan stops being better than the second."""
    for _ in range(HALVINGS):
        middle = {key: (number + worse[key]) / 2 for key, number in better.items()}
        if first.value(middle) > second.value(middle):
            better = middle
        else:
            worse = middle
    return better


@dataclass
class _Search:
    """What is known so far."""

    first: Outlook
    second: Outlook
    box: Box
    together: Mapping[str, str]
    paid: float
    better: Point | None = None
    worse: Point | None = None
    equal: Point | None = None
    may_be_better: bool = False
    may_be_worse: bool = False
    """By the bounds of a part that is settled."""
    loose: list[Box] = field(default_factory=list)
    """Settled parts whose bounds leave it open whether the two are as good somewhere."""
    looks: int = field(default_factory=lambda: MOST_BOXES)
    """Parts that may still be looked at."""

    def cleared(
        self, parts: Iterable[Box], is_clear: Callable[[Box], bool], is_over: Callable[[], bool]
    ) -> list[Box]:  # fmt: skip
        """Halve parts until each is clear; those left that are not."""
        waiting, left = deque(parts), list[Box]()
        while waiting and self.looks and not is_over():
            self.looks -= 1
            part = waiting.popleft()
            if not is_clear(part):
                halves = self._halves(part)
                waiting.extend(halves)
                left.extend([] if halves else [part])
        return [*left, *waiting]

    def settles(self, part: Box) -> bool:
        """Whether no more than one sign is possible in a part; numbers are remembered that show a sign."""
        low, high, rounding = self._seen(part)
        is_told_apart = low > rounding or high < -rounding
        is_open = low < -rounding and high > rounding
        if is_open or (rounding > ALIKE * self.paid and not is_told_apart):
            return False
        self.may_be_better |= high > rounding
        self.may_be_worse |= low < -rounding
        if not is_told_apart:
            self.loose.append(part)
        return True

    def tells_apart(self, part: Box) -> bool:
        """Whether the two are nowhere as good in a part."""
        low, high, rounding = self._seen(part)
        return low > rounding or high < -rounding

    def look_at(self, points: Iterable[Point]) -> None:
        """Remember points that show which plan is better there."""
        for guess in points:
            point = consistent(guess, self.box, self.together)
            shown = sign(self.first, self.second, point, self.paid)
            if shown == 1:
                self.better = self.better or point
            elif shown == -1:
                self.worse = self.worse or point
            elif shown == 0:
                self.equal = self.equal or point

    def order(self, is_whole: bool) -> Order:
        """The outcome; is_whole: whether every part was settled."""
        if self.better and self.worse:
            return Order(EITHER, self.better, self._nearest(self.better, self.worse, -1))
        if not is_whole or (self.may_be_better and self.may_be_worse):
            return Order(UNDECIDED, self.better, self.worse)
        if not self.may_be_better and not self.may_be_worse:
            return Order(EQUAL)
        relation = BETTER if self.may_be_better else WORSE
        is_equal_somewhere = self.cleared(self.loose, self.tells_apart, lambda: self.equal is not None)
        if self.equal is None and not is_equal_somewhere:
            return Order(relation, self.better, self.worse)
        shown = self.better or self.worse
        equal = self._nearest(shown, self.equal, 0) if shown and self.equal else self.equal
        return Order(NEVER_WORSE if relation == BETTER else NEVER_BETTER, self.better, self.worse, equal)

    def _seen(self, part: Box) -> tuple[float, float, float]:
        """Bounds of the difference, and how much of it may be rounding; the numbers that give them are looked at."""
        low, high, at_low, at_high = difference(self.first, self.second, part)
        start = {key: ends[0] for key, ends in part.items()}
        self.look_at({**start, **guess} for guess in (at_low, at_high))
        return low, high, _rounding(self.first, self.second, part)

    def _halves(self, part: Box) -> list[Box]:
        """Two parts of a part, by the number that is felt most; none where bounds are as narrow as can be."""
        places = self.first.places + self.second.places
        both = [key for key in self.box if part[key][0] < part[key][1] and places[key] > 1]
        if not both:
            return []
        key = max(both, key=lambda key: self._felt(part, key))
        low, high = part[key]
        middle = (low + high) / 2
        halves = [(low, low), (high, high)] if self._is_linear(key) else [(low, middle), (middle, high)]
        return [{**part, key: half} for half in halves]

    def _felt(self, part: Box, key: str) -> float:
        """By how much narrower the bounds are at best when a number is put to one of its ends."""
        found = [difference(self.first, self.second, {**part, key: (end, end)}) for end in part[key]]
        return -min(of[1] - of[0] for of in found)

    def _is_linear(self, key: str) -> bool:
        """Whether the difference is linear in a number."""
        return all(key not in plan.powers and plan.times.get(key, 0) <= 1 for plan in (self.first, self.second))

    def _nearest(self, shown: Point, other: Point, wanted: int) -> Point:
        """Numbers of a sign, of which none can be left as where another sign was shown, one by one."""
        for key in shown:
            name = self.together.get(key, key)
            nearer = {**other, **{of: shown[of] for of in shown if self.together.get(of, of) == name}}
            other = nearer if sign(self.first, self.second, nearer, self.paid) == wanted else other
        return other
