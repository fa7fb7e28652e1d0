"""Which plan is best while the chances of doorways and the times that regions take are known as intervals only.

An interval MDP over the doorways of the ways that may be best: what each is worth in the worst and in the best case,
and of each two whether one is better for all numbers, never worse, either for some, or undecided.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from qualrl.answers.answer import Answer
from qualrl.answers.contingent import Contingent
from qualrl.answers.depth import Depth
from qualrl.answers.known import between, known_in_words
from qualrl.answers.rivals import rivals
from qualrl.answers.uncertain import Uncertain
from qualrl.answers.ways import Way, way_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.from_counts import Counts, Samples
from qualrl.qualitative.outlook import Outlook, Point
from qualrl.qualitative.robust_order import (
    BETTER,
    EITHER,
    EQUAL,
    NEVER_BETTER,
    NEVER_WORSE,
    UNDECIDED,
    WORSE,
    Order,
    change,
    compare,
    consistent,
    sign,
)
from qualrl.solving.exact import exact_values

MOST_WAYS = 6
"""Ways that are compared at most, if not said otherwise."""
MOST_SOLVED = 60
"""Ways that are solved at most to find them."""
CERTAIN, POSSIBLE, TIED, NEVER = "certain", "possible", "tied", "never"


@dataclass(frozen=True)
class Rival:
    """A way, and what it may be worth."""

    way: Way
    """As it goes when all doorways are open and everything takes the time that it takes on the map."""
    least: float
    most: float
    best: str
    """Whether it is the best of the ways told: CERTAIN, for all numbers (or as good as any); POSSIBLE, for some; TIED,
    as good as any for some, but never better than one of the others; NEVER, or UNDECIDED."""

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {**self.way.to_dict(), "least": self.least, "most": self.most, "best": self.best}


@dataclass(frozen=True)
class Robust(Answer):
    """The answer."""

    start: str
    goal: str
    gamma: float
    uncertain: Uncertain
    box: Mapping[str, tuple[float, float]]
    """The numbers that some way told hangs on, and their intervals: the probability that a doorway is open; how many
    times as long a region takes; or, of the steps of a leg in a region where times were measured, E[gamma^tau] beside
    gamma to the power of the steps."""
    measured: Mapping[str, int]
    """The steps of the last kind, by its key."""
    rivals: tuple[Rival, ...]
    """The best first, where all doorways are open and times are as on the map."""
    orders: Mapping[tuple[int, int], Order]
    """How one of them stands to a later one."""
    changes: Mapping[tuple[int, int], tuple[str, float]]
    """Where two of them change places, if a single number decides: its key, and a value close to one such place."""
    stranded: tuple[tuple[str, ...], ...]
    """Doorways that leave no way, when all of a group are found shut."""
    stuck: float
    """What having no way left is worth: walking for ever."""
    others: float | None
    """No way that is not told is worth more than this, whatever the numbers are; None where all ways are told."""

    @property
    def safest(self) -> int:
        """The way that is worth the most in its worst case."""
        return max(range(len(self.rivals)), key=lambda at: self.rivals[at].least)

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        yield f"From {self.start} to {self.goal}{at}, as far as it is known:"
        yield from (f"  {line}" for line in known_in_words(self.uncertain, depth))
        for number, rival in enumerate(self.rivals, 1):
            worth = depth.at_numbers(f", worth {between(rival.least, rival.most)}")
            yield f"Way {number}: {rival.way.in_words(depth)}{worth}."
        for doors in self.stranded:
            shut = f"{' and '.join(doors)} {'is' if len(doors) == 1 else 'are'} shut"
            yield f"Where {shut}, no way is left{depth.at_numbers(f', which is worth {self.stuck:.6g}')}."
        if depth != Depth.NAMES:
            yield from self._orders_in_words(depth)
        yield from self._best_in_words(depth)
        if words := self._others_in_words(depth):
            yield words

    def _orders_in_words(self, depth: Depth) -> Iterator[str]:
        for (one, other), order in self.orders.items():
            first, second = (f"way {at + 1}" for at in (one, other))
            if order.relation in (WORSE, NEVER_BETTER):
                order, first, second = order.turned(), second, first
            if order.relation == BETTER:
                yield f"Certain: {first} is better than {second}, whatever the numbers are."
            elif order.relation == NEVER_WORSE:
                yield f"Certain: {first} is never worse than {second}{self._never_worse_in_words(order, depth)}."
            elif order.relation == EQUAL:
                yield f"Certain: {first} and {second} are worth the same, whatever the numbers are."
            elif order.relation == UNDECIDED:
                yield f"Undecided: whether {first} or {second} is better."
            else:
                yield f"Possible: {self._either_in_words(one, other, order, depth)}."

    def _never_worse_in_words(self, order: Order, depth: Depth) -> str:
        if order.at_better is None or order.at_equal is None:
            return ", whatever the numbers are"
        if depth == Depth.SIGNS:
            return ": better for some numbers, for others as good"
        better, equal = self._at(order.at_better, order.at_equal), self._at(order.at_equal, order.at_better)
        return f": better with {better}; as good with {equal}"

    def _either_in_words(self, one: int, other: int, order: Order, depth: Depth) -> str:
        better, worse = order.at_better or {}, order.at_worse or {}
        if depth == Depth.SIGNS:
            some = "for some numbers"
            if (one, other) in self.changes:
                key, _ = self.changes[one, other]
                some = f"with {self._moved(key, better[key] - worse[key])}"
            return f"way {one + 1} is better than way {other + 1} {some}, for others worse"
        told = [
            f"way {one + 1} is better than way {other + 1} with {self._at(better, worse)}",
            f"worse with {self._at(worse, better)}",
        ]
        if (one, other) in self.changes:
            told.append(f"they change places at {self._number(*self.changes[one, other])}")
        return "; ".join(told)

    def _at(self, point: Point, other: Point) -> str:
        """The numbers of a point that are others at the other point; JSON has all."""
        return ", ".join(self._number(key, number) for key, number in point.items() if number != other[key])

    def _number(self, key: str, number: float) -> str:
        if key in self.uncertain.doors:
            return f"{key} open with {number:.4g}"
        if key in self.measured:
            wait = math.log(number) / math.log(self.gamma) if number else math.inf
            return f"{key} worth as much as {self.measured[key] + wait:.4g}"
        return f"{key} {number:.4g} times as long"

    def _moved(self, key: str, by: float) -> str:
        """A number that is larger or smaller."""
        if key in self.uncertain.doors:
            return f"{key} {'more' if by > 0 else 'less'} likely open"
        if key in self.measured:
            return f"steps in {key.partition(' steps in ')[2]} taking {'less' if by > 0 else 'more'} time"
        return f"{key} taking {'more' if by > 0 else 'less'} time"

    def _best_in_words(self, depth: Depth) -> Iterator[str]:
        of_these = "" if self._is_whole else " of these ways"
        for kind, words in (
            (CERTAIN, f"Certainly best{of_these}"),
            (POSSIBLE, f"Best{of_these} for some numbers"),
            (TIED, f"Among the best{of_these} for some numbers"),
            (UNDECIDED, f"Perhaps best{of_these}"),
        ):
            ways = [f"way {at}" for at, rival in enumerate(self.rivals, 1) if rival.best == kind]
            if ways:
                yield f"{words}: {', '.join(ways)}."
        worth = depth.at_numbers(f", worth at least {self.rivals[self.safest].least:.6g}")
        yield f"Best{of_these} in the worst case: way {self.safest + 1}{worth}."

    @property
    def _is_whole(self) -> bool:
        """Whether no way that is not told can be better than the safest one."""
        return self.others is None or self.others <= self.rivals[self.safest].least

    def _others_in_words(self, depth: Depth) -> str:
        if self.others is None:
            return "Every way that is not told passes a region twice."
        if self._is_whole:
            most = depth.at_numbers(f": at most {self.others:.6g}")
            return depth.from_signs(f"Every other way that passes no region twice is worth no more than that{most}.")
        worth = depth.at_numbers(f"; they are worth at most {self.others:.6g}")
        return f"Other ways were not compared{worth}{depth.from_signs(', so one of them may be better')}."

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "robust", "from": self.start, "to": self.goal, "gamma": self.gamma,
            "confidence": self.uncertain.confidence,
            "doors": {name: list(self.uncertain.door(name)) for name in self.uncertain.doors},
            "counts": {
                name: [given.hits, given.trials]
                for name, given in self.uncertain.doors.items() if isinstance(given, Counts)
            },
            "times": {
                name: list(times.times if isinstance(times, Samples) else times)
                for name, times in self.uncertain.times.items()
            },
            "numbers": {key: list(span) for key, span in self.box.items()}, "measured": dict(self.measured),
            "ways": [rival.to_dict() for rival in self.rivals],
            "orders": [self._order_to_dict(pair) for pair in self.orders],
            "safest": self.safest + 1, "others": self.others,
            "stranded": [list(doors) for doors in self.stranded], "stuck": self.stuck,
        }  # fmt: skip

    def _order_to_dict(self, pair: tuple[int, int]) -> dict[str, Any]:
        order = self.orders[pair]
        return {
            "ways": [at + 1 for at in pair], "relation": order.relation,
            "better_at": None if order.at_better is None else dict(order.at_better),
            "worse_at": None if order.at_worse is None else dict(order.at_worse),
            "equal_at": None if order.at_equal is None else dict(order.at_equal),
            "change": list(self.changes[pair]) if pair in self.changes else None,
        }  # fmt: skip


def robust(
    model: HybridMDP, start: int, names: tuple[str, str], uncertain: Uncertain, most: int = MOST_WAYS
) -> Robust:  # fmt: skip
    """Compare the ways from a state to the goal while doorways and times are uncertain.  names: of start and goal.

    most: ways to tell.  Raises SettingError, UnknownNameError, and NoPlanError where no way leads to the goal even if
    all doorways are open.
    """
    assert model.regions is not None
    if model.grid.slip > 0:
        raise SettingError(
            "where moves slip, times are random already: set motion.slip to 0, or give slip itself an interval"
        )
    if not uncertain.doors and not uncertain.times:
        raise SettingError(
            "say what is uncertain: a doorway (--chance), the time in a region (--time) or the slips (--slip)"
        )
    uncertain.check_names(model.regions)
    model.check_reachable(start)
    if start == model.grid.goal:
        raise SettingError("start and goal are the same, so there is no way to choose")
    contingent = Contingent(model, uncertain)
    plans, others = _plans(model, start, contingent)
    plans.sort(key=lambda plan: -plan.most)
    others = max([of.most for of in plans[most:]] + ([] if others is None else [others]), default=None)
    plans = sorted(plans[:most], key=lambda plan: -plan.way.value)
    box = {key: span for plan in plans for key, span in plan.box.items()}
    paid = max(abs(model.grid.goal_reward), abs(model.grid.step_reward))
    orders = {
        (i, j): compare(plans[i].outlook, plans[j].outlook, box, contingent.together, paid)
        for i, j in combinations(range(len(plans)), 2)
    }
    measured = {key: steps for plan in plans for key, steps in plan.measured.items()}
    shift = -model.grid.step_reward / (1 - model.gamma)
    rivals_told = tuple(
        Rival(plan.way, plan.least - shift, plan.most - shift, best)
        for plan, best in zip(plans, _best(orders, _seen(plans, orders, box, contingent.together, paid)), strict=True)
    )
    return Robust(
        *names, model.gamma, uncertain, box, measured, rivals_told, orders, _changes(plans, orders),
        _fewest(contingent.stranded), -shift, None if others is None else others - shift,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Plan:
    """A way, as a tree; worths are shifted."""

    way: Way
    outlook: Outlook
    box: Mapping[str, tuple[float, float]]
    least: float
    most: float
    at_most: Point
    measured: Mapping[str, int]


def _plans(model: HybridMDP, start: int, contingent: Contingent) -> tuple[list[_Plan], float | None]:
    """The best way and its rivals, and what those not found are worth at most (shifted); None where there is none."""
    exact = exact_values(model.world)
    walk = exact_walk(model, exact, start)
    plans = [_plan(model, contingent, walk, float(exact.value[start]))]
    found = {plans[0].way.doors}
    for bound, doors in rivals(model, start, contingent.uncertain):
        if doors is None or len(found) >= MOST_SOLVED or bound < max(plan.least for plan in plans):
            return plans, bound
        if doors in found:
            continue
        found.add(doors)
        changed = model.with_closed(_beside(model, start, doors))
        if not changed.can_reach[start]:
            continue
        exact = exact_values(changed.world)
        plan = _plan(model, contingent, exact_walk(changed, exact, start), float(exact.value[start]))
        if plan.way.doors not in {other.way.doors for other in plans}:
            plans.append(plan)
    return plans, None


def _plan(model: HybridMDP, contingent: Contingent, walk: Sequence[int], value: float) -> _Plan:
    outlook = contingent.outlook(walk)
    assert outlook is not None  # start and goal are not the same
    box = {key: contingent.box[key] for key in outlook.times}
    least, most, _, at_most = outlook.bounds(box)
    measured = {key: steps for key, steps in contingent.measured.items() if key in box}
    return _Plan(way_of(model, [walk], value), outlook, box, least, most, at_most, measured)


def _beside(model: HybridMDP, start: int, doors: Sequence[str]) -> list[str]:
    """The other doorways of the regions that a way passes."""
    assert model.regions is not None
    passed = {int(model.region_of[start])}.union(*(of.pair for of in model.regions.doorways if of.name in doors))
    return [of.name for of in model.regions.doorways if of.name not in doors and passed & {*of.pair}]


def _seen(
    plans: Sequence[_Plan],
    orders: Mapping[tuple[int, int], Order],
    box: Mapping[str, tuple[float, float]],
    together: Mapping[str, str],
    paid: float,
) -> list[bool]:
    """Of each plan, whether numbers were seen with which no other is better."""
    start = {key: span[0] for key, span in box.items()}
    guesses = [point for order in orders.values() for point in (order.at_better, order.at_worse, order.at_equal)]
    points = [
        consistent({**start, **(guess or {})}, box, together) for guess in [*guesses, *(of.at_most for of in plans)]
    ]

    def leads(plan: _Plan, point: Point) -> bool:
        others = (other for other in plans if other is not plan)
        return all(sign(plan.outlook, other.outlook, point, paid) in (0, 1) for other in others)

    return [any(leads(plan, point) for point in points) for plan in plans]


def _best(orders: Mapping[tuple[int, int], Order], seen: Sequence[bool]) -> list[str]:
    """Of each plan, whether it is the best.  seen: whether there are numbers with which no other is better."""
    found = []
    for at, leads in enumerate(seen):
        to_others = {order.relation for (one, _), order in orders.items() if one == at}
        to_others |= {order.turned().relation for (_, other), order in orders.items() if other == at}
        if to_others <= {BETTER, NEVER_WORSE, EQUAL}:
            found.append(CERTAIN)
        elif WORSE in to_others:
            found.append(NEVER)
        elif not leads:
            found.append(UNDECIDED)
        else:
            found.append(TIED if NEVER_BETTER in to_others else POSSIBLE)
    return found


def _changes(
    plans: Sequence[_Plan], orders: Mapping[tuple[int, int], Order]
) -> dict[tuple[int, int], tuple[str, float]]:
    found = {}
    for (one, other), order in orders.items():
        if order.relation == EITHER and order.at_better and order.at_worse:
            keys = [key for key, number in order.at_better.items() if order.at_worse[key] != number]
            if len(keys) == 1:
                near = change(plans[one].outlook, plans[other].outlook, order.at_better, order.at_worse)
                found[one, other] = keys[0], near[keys[0]]
    return found


def _fewest(stranded: Iterable[frozenset[str]]) -> tuple[tuple[str, ...], ...]:
    """Groups of doorways, without those that hold another."""
    groups = sorted(stranded, key=lambda doors: (len(doors), sorted(doors)))
    return tuple(tuple(sorted(of)) for at, of in enumerate(groups) if not any(other <= of for other in groups[:at]))
