"""Which of two plans is better while numbers are known as intervals only: always one of them, either, or undecided.

Bounds of the difference are worked out for the box that the intervals span, and where they leave the sign open for
parts of it: interval arithmetic, branch and bound.  A number that the difference is linear in is put to its two ends,
which loses nothing; another interval is halved.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, product
from types import MappingProxyType

from qualrl.qualitative.outlook import Bounds, Box, Outlook, Point
from qualrl.qualitative.outlook_difference import difference

BETTER, EQUAL, WORSE, EITHER, UNDECIDED = "better", "equal", "worse", "either", "undecided"
ALIKE = 1e-9
"""Worths that differ by less than this share are the same: rounding is far below."""
MOST_BOXES = 1000
"""Parts of the box that are looked at, before the order is called undecided."""
MOST_CORNERS = 64
HALVINGS = 40


@dataclass(frozen=True)
class Order:
    """How the first of two plans stands to the second, over a whole box."""

    relation: str
    """BETTER: nowhere worse; WORSE: nowhere better; EQUAL: everywhere as good; EITHER: somewhere better and somewhere
    worse; UNDECIDED: none of these was proved."""
    at_better: Point | None = None
    """Numbers with which the first is better."""
    at_worse: Point | None = None

    def turned(self) -> "Order":
        """How the second stands to the first."""
        relation = {BETTER: WORSE, WORSE: BETTER}.get(self.relation, self.relation)
        return Order(relation, self.at_worse, self.at_better)


def compare(first: Outlook, second: Outlook, box: Box, together: Mapping[str, str] = MappingProxyType({})) -> Order:
    """Compare two plans for all numbers that a box holds.

    together: keys of numbers that one thing decides (a law of times, for legs of several lengths), with its name.  Then
    EITHER is shown by numbers that are as far along in all their intervals, and what holds for the whole box holds.
    """
    keys = [key for key in box if key in first.times or key in second.times]
    powers, places = first.powers | second.powers, first.places + second.places
    linear = {key for key in keys if key not in powers and _once(first, key) and _once(second, key)}
    whole = {key: box[key] for key in keys}

    def bounds(part: Box) -> Bounds:
        return difference(first, second, part)

    def split(part: Box) -> str | None:
        both = [key for key in keys if part[key][0] < part[key][1] and places[key] > 1]
        return max(both, key=lambda key: _felt(bounds, part, key), default=None)

    search = _Search(first, second, whole, together)
    search.look_at(_corners(whole))
    waiting = deque([whole])
    for _ in range(MOST_BOXES):
        if not waiting or (search.better and search.worse):
            break
        part = waiting.popleft()
        if search.settles(part, bounds(part)):
            continue
        key = split(part)
        if key is None:
            return search.order(is_whole=False)
        low, high = part[key]
        middle = (low + high) / 2
        halves = [(low, low), (high, high)] if key in linear else [(low, middle), (middle, high)]
        waiting.extend({**part, key: half} for half in halves)
    return search.order(is_whole=not waiting)


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


def _corners(box: Box) -> Iterator[Point]:
    """Some corners of a box: all where they are few; two opposite ones in any case."""
    for at in (0, 1):
        yield {key: span[at] for key, span in box.items()}
    for ends in islice(product(*({*span} for span in box.values())), MOST_CORNERS):
        yield dict(zip(box, ends, strict=True))


def _once(plan: Outlook, key: str) -> bool:
    return plan.times.get(key, 0) <= 1


def _felt(bounds: Callable[[Box], Bounds], part: Box, key: str) -> float:
    """By how much narrower the bounds are at best when a number is put to one of its ends."""
    low, high = part[key]
    widths = [of[1] - of[0] for of in (bounds({**part, key: (end, end)}) for end in (low, high))]
    return -min(widths)


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
    better: Point | None = None
    worse: Point | None = None
    may_be_better: bool = False
    may_be_worse: bool = False
    """By the bounds of a part that is settled."""

    def settles(self, part: Box, of: Bounds) -> bool:
        """Whether no more than one sign is possible in a part; numbers are remembered that show a sign."""
        low, high, at_low, at_high = of
        start = {key: ends[0] for key, ends in part.items()}
        self.look_at({**start, **guess} for guess in (at_low, at_high))
        rounding = ALIKE * max(abs(end) for plan in (self.first, self.second) for end in plan.bounds(part)[:2])
        if low < -rounding and high > rounding:
            return False
        self.may_be_better |= high > rounding
        self.may_be_worse |= low < -rounding
        return True

    def look_at(self, points: Iterable[Point]) -> None:
        """Remember points that show which plan is better there."""
        for guess in points:
            point = consistent(guess, self.box, self.together)
            sign = self._sign(point)
            if sign > 0:
                self.better = self.better or point
            elif sign < 0:
                self.worse = self.worse or point

    def _sign(self, point: Point) -> int:
        """1 where the first is better, -1 where it is worse."""
        one, other = self.first.value(point), self.second.value(point)
        return 0 if abs(one - other) <= ALIKE * max(abs(one), abs(other)) else 1 if one > other else -1

    def order(self, is_whole: bool) -> Order:
        """The outcome; is_whole: whether every part was settled."""
        if self.better and self.worse:
            return Order(EITHER, self.better, self._nearest_worse(self.better, self.worse))
        if not is_whole or (self.may_be_better and self.may_be_worse):
            return Order(UNDECIDED, self.better, self.worse)
        relation = BETTER if self.may_be_better else WORSE if self.may_be_worse else EQUAL
        return Order(relation, self.better, self.worse)

    def _nearest_worse(self, better: Point, worse: Point) -> Point:
        """Numbers for which the first is worse, and of which none can be left as where it is better, one by one."""
        for key in better:
            name = self.together.get(key, key)
            nearer = {**worse, **{of: better[of] for of in better if self.together.get(of, of) == name}}
            worse = nearer if self._sign(nearer) < 0 else worse
        return worse
