"""By which doorway it is best to leave a region while the probability of slips is known as an interval only.

A robot can make its moves slip more often: by aiming elsewhere now and then, by chance.  So no place is worth less
where they slip less often, nor is a way from there, as long as a move leads where it aims at no less often than to any
other place.  For a span of probabilities each way is worth what it is at the two ends, or something between; that holds
even if the probability is another at each step (an interval MDP over the cells).  Where what two ways may be worth does
not overlap, one is better for all of the span; where it does, the span is halved.
"""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
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
from qualrl.planning.crossings import doors_between
from qualrl.planning.legs import legs_of
from qualrl.planning.one_doorway import OneDoorway
from qualrl.planning.planner import exact_walk
from qualrl.planning.values import exact_plan_values
from qualrl.qualitative.from_counts import Counts
from qualrl.qualitative.robust_order import BETTER, UNDECIDED, WORSE
from qualrl.qualitative.signs import one_after_the_other
from qualrl.solving.exact import ExactValues, exact_values, off_of
from qualrl.spatial.region_map import Doorway

MOST_SLIPS = 65
"""Probabilities of slips that all is worked out for at most; nor is a span halved that so many, evenly spread over the
whole, would not tell ways apart in."""

Span = tuple[float, float]
Bounds = Mapping[str, Span]
"""What leaving by each doorway is worth at least and at most; or staying."""
WaysOut = Mapping[str, tuple[Doorway | None, OneDoorway]]
"""By name: a doorway, None for staying, and the region as it is when left by it."""
Pair = tuple[str, str]
Part = tuple[float, float, dict[Pair, str]]
"""A span from and to, and which of two ways is better in it."""


@dataclass(frozen=True)
class Verdict:
    """Which of two doorways is better for a span of slips."""

    low: float
    high: float
    relation: str
    """BETTER: the first; WORSE: the second; or UNDECIDED."""
    tried: tuple[int, int, int]
    """At how many probabilities of the span it was worked out, and at how many of these the first is better, and the
    second."""


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
    verdicts: Mapping[Pair, tuple[Verdict, ...]]

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
        another = " even if the probability is another at each step" if self.slip[0] < self.slip[1] else ""
        even = depth.from_signs(f",{worth}{another}" if worth or another else "")
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
                {"ways": list(pair), "low": of.low, "high": of.high, "relation": of.relation, "tried": list(of.tried)}
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
    slips = (low, high, _middle(low, high))
    ends = dict(zip(slips, _at_once(model, slips), strict=True))
    ways = _ways(list(ends.values()), start, most)
    search = _Search(model, start, ways, {slip: worlds.bounds(start, ways) for slip, worlds in ends.items()})
    verdicts = search.verdicts(low, high)
    return RobustSlip(
        *names, _region(model, start), model.gamma, (low, high),
        slip if isinstance(slip, Counts) else None, confidence,
        {way: (search.known[high][way][0], search.known[low][way][1]) for way in ways}, verdicts,
    )  # fmt: skip


def _middle(low: float, high: float) -> float:
    return (low + high) / 2


def _stay(region: str) -> str:
    return f"staying in {region}"


def _region(model: HybridMDP, state: int) -> str:
    return model.region_names[int(model.region_of[state])]


@dataclass(frozen=True)
class _AtSlip:
    """The model whose moves slip with one probability."""

    model: HybridMDP
    exact: ExactValues

    @classmethod
    def of(cls, model: HybridMDP, slip: float) -> "_AtSlip":
        """A model, with other slips."""
        changed = replace(model, world=replace(model.grid, slip=slip))
        return cls(changed, exact_values(changed.world))

    def left_by(self, start: int) -> Doorway | None:
        """The doorway by which the plan leaves the region; None where it stays there."""
        assert self.model.regions is not None
        walk = exact_walk(self.model, self.exact, start)
        legs = legs_of(self.model, walk)[:2]
        return next(iter(doors_between(self.model, self.model.regions, walk, legs)), None)

    def bounds(self, start: int, ways: WaysOut) -> Bounds:
        """What each way is worth, as far as it is known."""
        found = {}
        for name, (door, room) in ways.items():
            shifted = value_in(room, self.model, self.exact, start, door)
            worth, off = shifted - self.exact.shift, float(off_of(self.model.grid, shifted, self.exact.shift))
            found[name] = worth - off, worth + off
        return found


def _at_once(model: HybridMDP, slips: Sequence[float]) -> list[_AtSlip]:
    with ThreadPoolExecutor(2) as both:
        return list(both.map(lambda slip: _AtSlip.of(model, slip), slips))


def _ways(worlds: Sequence[_AtSlip], start: int, most: int) -> WaysOut:
    """The ways out of a state's region to compare, the best in the last world first.

    The doorways that lead on to the goal without coming back, those that the plan takes in each of the worlds, and, in
    the goal's region, staying there.
    """
    model, exact = worlds[-1].model, worlds[-1].exact
    assert model.regions is not None
    taken = [world.left_by(start) for world in worlds]
    doors: dict[str, Doorway | None] = {door.name: door for door in taken if door is not None}
    choices = Chooser(model, model.regions, exact_plan_values(model, exact)).at(start, taken[-1])
    stay = _stay(_region(model, start))
    doors |= {stay if choice.door is None else choice.door.name: choice.door for choice in choices}
    ways = {name: (door, left_by(model, start, door)) for name, door in doors.items()}
    worth = {name: value_in(room, model, exact, start, door) for name, (door, room) in ways.items()}
    return {name: ways[name] for name in sorted(worth, key=lambda name: -worth[name])[:most]}


@dataclass
class _Search:
    """Halves the span until each pair of ways is told apart."""

    model: HybridMDP
    start: int
    ways: WaysOut
    known: dict[float, Bounds]
    """By the probability of slips; of the ways that were not told apart before."""

    def verdicts(self, low: float, high: float) -> dict[Pair, tuple[Verdict, ...]]:
        """Of each pair, spans in order; neighbours of one kind are one."""
        pairs, finest = list(combinations(self.ways, 2)), (high - low) / max(MOST_SLIPS - 1, 1)
        open_, done = [(low, high, self._relations(low, high, dict.fromkeys(pairs, UNDECIDED)))], list[Part]()
        while open_:
            open_.sort(key=lambda part: part[0] - part[1])
            widest, open_ = open_[:2], open_[2:]
            halved = [
                part for part in widest if part[0] < _middle(*part[:2]) < part[1] and self._may_tell(part, finest)
            ]
            halved = halved[: max(MOST_SLIPS - len(self.known), 0)]
            done += [part for part in widest if part not in halved]
            self._work_out(halved)
            for low, high, relations in halved:
                middle = _middle(low, high)
                open_ += [(*half, self._relations(*half, relations)) for half in ((low, middle), (middle, high))]
        done.sort(key=lambda part: part[0])
        return {pair: self._joined(pair, done) for pair in pairs}

    def _may_tell(self, part: Part, finest: float) -> bool:
        """Whether halves of a span, or halves of these, may tell more, down to some width.

        What a way is worth falls about evenly in a span, and how far two are apart changes evenly.
        """
        low, high, relations = part
        return any(
            (self.known[low][name][1] - self.known[high][name][0]) * finest
            <= (high - low) * max(abs(self._apart(slip, pair)) for slip in (low, high))
            for pair, of in relations.items() if of == UNDECIDED for name in pair
        )  # fmt: skip

    def _apart(self, slip: float, pair: Pair) -> float:
        one, other = (self.known[slip][name] for name in pair)
        return (one[0] + one[1] - other[0] - other[1]) / 2

    def _work_out(self, parts: Sequence[Part]) -> None:
        """In the middle of some spans, for the ways that are not told apart in them."""
        asked = {
            _middle(low, high): {name for pair, of in relations.items() if of == UNDECIDED for name in pair}
            for low, high, relations in parts
        }
        missing = [slip for slip in asked if slip not in self.known]
        for slip, world in zip(missing, _at_once(self.model, missing), strict=True):
            self.known[slip] = world.bounds(self.start, {name: self.ways[name] for name in asked[slip]})

    def _relations(self, low: float, high: float, before: Mapping[Pair, str]) -> dict[Pair, str]:
        """Of all pairs in a span of one in which some are told apart already."""
        return {pair: self._relation(low, high, pair) if of == UNDECIDED else of for pair, of in before.items()}

    def _relation(self, low: float, high: float, pair: Pair) -> str:
        (one_least, other_least), (one_most, other_most) = (
            [self.known[slip][name][side] for name in pair] for slip, side in ((high, 0), (low, 1))
        )
        return BETTER if one_least > other_most else WORSE if one_most < other_least else UNDECIDED

    def _joined(self, pair: Pair, parts: Sequence[Part]) -> tuple[Verdict, ...]:
        found = []
        for relation, group in groupby(parts, key=lambda part: part[2][pair]):
            of = list(group)
            found.append(Verdict(of[0][0], of[-1][1], relation, self._tried(pair, of[0][0], of[-1][1])))
        return tuple(found)

    def _tried(self, pair: Pair, low: float, high: float) -> tuple[int, int, int]:
        slips = [slip for slip, of in self.known.items() if low <= slip <= high and all(name in of for name in pair)]
        found = [self._relation(slip, slip, pair) for slip in slips]
        return len(found), found.count(BETTER), found.count(WORSE)


def _verdicts_in_words(one: str, other: str, verdicts: tuple[Verdict, ...], depth: Depth) -> str:
    better = {BETTER: f"{one} is better than {other}", WORSE: f"{other} is better than {one}"}
    if len(verdicts) == 1 and verdicts[0].relation != UNDECIDED:
        return f"Certain: {better[verdicts[0].relation]}, whatever the probability is"
    if len(verdicts) == 1:
        tried, better_one, better_other = verdicts[0].tried
        slips = f"{tried} probabilit{'y' if tried == 1 else 'ies'}"
        at = f"; of {slips} tried, {one} is better at {better_one}, {other} at {better_other}"
        return f"Undecided: whether {one} or {other} is better{depth.at_numbers(at)}"
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
