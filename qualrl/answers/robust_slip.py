"""By which doorway it is best to leave a region while the probability of slips is known as an interval only.

For a span of probabilities each way has bounds: what it is worth if every step slips as is best for it, and if every
step slips as is worst (an interval MDP over the cells).  Where bounds of two ways do not overlap, one is better for all
of the span; where they do, the span is halved.
"""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import combinations, groupby
from typing import Any

from qualrl.answers.answer import Answer
from qualrl.answers.depth import Depth
from qualrl.answers.known import between
from qualrl.answers.through import left_by, value_in
from qualrl.answers.uncertain import check_confidence, check_span
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.choices import Chooser
from qualrl.planning.crossings import door_taken
from qualrl.planning.legs import legs_of
from qualrl.planning.one_doorway import OneDoorway
from qualrl.planning.planner import exact_walk
from qualrl.planning.values import exact_plan_values
from qualrl.qualitative.from_counts import Counts
from qualrl.qualitative.robust_order import BETTER, UNDECIDED, WORSE
from qualrl.qualitative.signs import one_after_the_other
from qualrl.solving.exact import SlipSpan, error_at, exact_values, values_between
from qualrl.spatial.region_map import Doorway

MOST_SPANS = 64
"""Spans that are solved at most, each twice."""

Span = tuple[float, float]
Bounds = Mapping[str, Span]
"""By doorway, or staying."""
WaysOut = Mapping[str, tuple[Doorway | None, OneDoorway]]
"""By name: a doorway, None for staying, and the region as it is when left by it."""


@dataclass(frozen=True)
class Verdict:
    """Which of two doorways is better for a span of slips."""

    low: float
    high: float
    relation: str
    """BETTER: the first; WORSE: the second; or UNDECIDED."""


@dataclass(frozen=True)
class RobustSlip(Answer):
    """The answer."""

    start: str
    goal: str
    region: str
    """That is left."""
    gamma: float
    slip: Span
    counts: Counts | None
    confidence: float
    worth: Bounds
    """What each way is worth at least and at most, even if slips are as likely as they like at each step; best first by
    the middle of the interval."""
    verdicts: Mapping[tuple[str, str], tuple[Verdict, ...]]

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        slip = f"moves slip with a probability of {between(*self.slip)}{self._counted()}"
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        yield f"From {self.start} to {self.goal}{at}, {depth.at_numbers(slip, 'moves may slip')}."
        if depth == Depth.NUMBERS:
            for name, (least, most) in self.worth.items():
                way = f"Staying in {self.region}" if name == _stay(self.region) else f"Leaving {self.region} by {name}"
                yield f"{way} is worth {between(least, most)}."
        else:
            ways = [name if name == _stay(self.region) else f"by {name}" for name in self.worth]
            yield f"Ways on from {self.region}: {', '.join(ways)}."
        if depth != Depth.NAMES:
            for (one, other), verdicts in self.verdicts.items():
                yield f"{_verdicts_in_words(one, other, verdicts, depth)}."
        safest = max(self.worth, key=lambda door: self.worth[door][0])
        worth = depth.at_numbers(f" worth at least {self.worth[safest][0]:.6g}")
        even = depth.from_signs(f",{worth} even if the probability is another at each step")
        yield f"Best in the worst case: {safest}{even}."

    def _counted(self) -> str:
        if self.counts is None:
            return ""
        of = self.counts
        return f" ({of.hits} of {of.trials} moves did; confidence {self.confidence:g})"

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "robust", "from": self.start, "to": self.goal, "region": self.region, "gamma": self.gamma,
            "slip": list(self.slip), "counts": None if self.counts is None else [self.counts.hits, self.counts.trials],
            "confidence": self.confidence, "ways": {door: list(span) for door, span in self.worth.items()},
            "verdicts": [
                {"ways": list(pair), "low": of.low, "high": of.high, "relation": of.relation}
                for pair, verdicts in self.verdicts.items() for of in verdicts
            ],
        }  # fmt: skip


def robust_slip(
    model: HybridMDP, start: int, names: tuple[str, str], slip: Span | Counts, confidence: float, most: int
) -> RobustSlip:
    """Compare the doorways of a state's region while slips are uncertain.  names: of start and goal.

    most: doorways to compare.  Raises SettingError, and NoPlanError where no way leads to the goal.
    """
    check_confidence(confidence)
    if start == model.grid.goal:
        raise SettingError("start and goal are the same, so there is no way to choose")
    span = slip.interval(confidence) if isinstance(slip, Counts) else slip
    check_span("slip (with more of it moves lead less often where they aim at)", span, 0, 1 - 1 / model.grid.n_actions)
    low, high = span
    model.check_reachable(start)
    ways = _ways(model, start, span, most)
    worst = replace(model, world=replace(model.grid, slip=high))
    whole = _bounds(worst, start, ways, low, high)
    pairs = list(combinations(ways, 2))
    found = _Search(worst, start, ways, pairs).verdicts(low, high, whole)
    return RobustSlip(
        *names, _region(model, start), model.gamma, (low, high),
        slip if isinstance(slip, Counts) else None, confidence, whole, found,
    )  # fmt: skip


def _stay(region: str) -> str:
    return f"staying in {region}"


def _region(model: HybridMDP, state: int) -> str:
    return model.region_names[int(model.region_of[state])]


def _ways(model: HybridMDP, start: int, span: Span, most: int) -> WaysOut:
    """The ways out of a state's region to compare, the best in the middle of a span of slips first.

    The doorways that lead on to the goal without coming back, those that the plan takes in the middle and at the ends,
    and, in the goal's region, staying there.
    """
    assert model.regions is not None
    low, high = span
    doors = dict[str, Doorway | None]()
    for slip in (low, high, (low + high) / 2):
        changed = replace(model, world=replace(model.grid, slip=slip))
        exact = exact_values(changed.world)
        walk = exact_walk(changed, exact, start)
        legs, taken = legs_of(changed, walk), None
        if len(legs) > 1:
            taken = door_taken(changed, model.regions, walk[legs[1].first - 1], walk[legs[1].first])
            doors[taken.name] = taken
    choices = Chooser(changed, model.regions, exact_plan_values(changed, exact)).at(start, taken)
    stay = _stay(_region(model, start))
    doors |= {stay if choice.door is None else choice.door.name: choice.door for choice in choices}
    rooms = {name: left_by(changed, start, door) for name, door in doors.items()}
    worth = {name: value_in(rooms[name], changed, exact, start, door, slip) for name, door in doors.items()}
    return {name: (doors[name], rooms[name]) for name in sorted(worth, key=lambda name: -worth[name])[:most]}


def _bounds(model: HybridMDP, start: int, ways: WaysOut, low: float, high: float) -> Bounds:
    """What each way out is worth at least and at most for a span of slips, inexact values allowed for.

    model: of the most slips that are asked about, or less.
    """

    def end(helps: bool) -> dict[str, float]:
        span = SlipSpan(low, high, helps)
        values = values_between(model.grid, span)
        worth = {name: value_in(room, model, values, start, door, span) for name, (door, room) in ways.items()}
        return {
            name: value - values.shift + error_at(model.grid, value, values.shift) * (1 if helps else -1)
            for name, value in worth.items()
        }

    with ThreadPoolExecutor(2) as both:
        least, most = both.map(end, (False, True))
    return {name: (worth, most[name]) for name, worth in least.items()}


@dataclass
class _Search:
    """Halves the span until each pair of ways is told apart."""

    model: HybridMDP
    start: int
    ways: WaysOut
    pairs: list[tuple[str, str]]
    solved: int = 0
    parts: list[tuple[float, float, dict[tuple[str, str], str]]] = field(default_factory=list)

    def verdicts(self, low: float, high: float, whole: Bounds) -> dict[tuple[str, str], tuple[Verdict, ...]]:
        """Of each pair, spans in order; neighbours of one kind are one."""
        waiting = [(low, high, self._relations(whole))]
        while waiting:
            waiting.sort(key=lambda part: part[0] - part[1])
            low, high, relations = waiting.pop(0)
            if UNDECIDED not in relations.values() or low == high or self.solved >= MOST_SPANS:
                self.parts.append((low, high, relations))
                continue
            middle = (low + high) / 2
            asked = {name for pair, of in relations.items() if of == UNDECIDED for name in pair}
            ways = {name: way for name, way in self.ways.items() if name in asked}
            for half in ((low, middle), (middle, high)):
                self.solved += 1
                found = self._relations(_bounds(self.model, self.start, ways, *half))
                known = {pair: found[pair] if of == UNDECIDED else of for pair, of in relations.items()}
                waiting.append((*half, known))
        self.parts.sort(key=lambda part: part[0])
        return {pair: self._joined(pair) for pair in self.pairs}

    def _relations(self, bounds: Bounds) -> dict[tuple[str, str], str]:
        """Of pairs of which both have bounds."""
        found = {}
        for one, other in self.pairs:
            if one not in bounds or other not in bounds:
                continue
            (low, high), (other_low, other_high) = bounds[one], bounds[other]
            found[one, other] = BETTER if low > other_high else WORSE if high < other_low else UNDECIDED
        return found

    def _joined(self, pair: tuple[str, str]) -> tuple[Verdict, ...]:
        found = []
        for relation, group in groupby(self.parts, key=lambda part: part[2][pair]):
            parts = list(group)
            found.append(Verdict(parts[0][0], parts[-1][1], relation))
        return tuple(found)


def _verdicts_in_words(one: str, other: str, verdicts: tuple[Verdict, ...], depth: Depth) -> str:
    better = {BETTER: f"{one} is better than {other}", WORSE: f"{other} is better than {one}"}
    if len(verdicts) == 1 and verdicts[0].relation != UNDECIDED:
        return f"Certain: {better[verdicts[0].relation]}, whatever the probability is"
    if len(verdicts) == 1:
        return f"Undecided: whether {one} or {other} is better"
    kinds = {of.relation for of in verdicts} - {UNDECIDED}
    how = "Possible" if len(kinds) > 1 else "Certain"
    if depth == Depth.SIGNS:
        words = [better.get(of.relation, "undecided") for of in verdicts]
        return f"{how}: {one_after_the_other(words, 'probabilities')}"
    told = [
        f"{better[of.relation]} from {of.low:.4g} to {of.high:.4g}"
        for of in verdicts if of.relation != UNDECIDED
    ]  # fmt: skip
    rest = [f"{of.low:.4g} to {of.high:.4g}" for of in verdicts if of.relation == UNDECIDED]
    undecided = f"; undecided from {', '.join(rest)}" if rest else ""
    return f"{how}: {', '.join(told)}{undecided}"
