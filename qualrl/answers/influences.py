"""Which way a plan's value goes when something about it grows: by signs alone where they tell, else exactly.

By signs alone: V is the sum of rewards times how often, discounted, they are paid, which is never negative.  So what a
reward does is plain, slips or not.  One more step of reward r before what is still worth W is worth
r - (1 - gamma) * W more, discounted: a sum of two, whose signs may leave it open.  Then, and for gamma itself, the
exact signs of the difference are found for every gamma in (0, 1), where moves do not slip.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any

from qualrl.answers.answer import Answer
from qualrl.answers.depth import Depth
from qualrl.answers.trying import trying
from qualrl.answers.ways import Way, course, way_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.plan_value import Course, Stretch, contrast, told_apart
from qualrl.qualitative.sign_intervals import SignIntervals, sign_intervals
from qualrl.qualitative.signs import Sign, one_after_the_other, sign_of_sum
from qualrl.solving.exact import exact_values


@dataclass(frozen=True)
class Influence:
    """The sign of the change of a plan's value when something grows."""

    of: str
    by_signs: Sign
    """For every gamma in (0, 1), by sign algebra."""
    because: str
    exact: SignIntervals | None
    """Where the sign is + and where -; None where signs alone tell, or moves slip."""
    polynomial: str = ""
    """Whose signs those are, up to a positive factor."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        signs = f"{self.by_signs} by signs alone ({self.because})"
        alone = f"{self.of}: {depth.at_numbers(signs, signs.replace(Sign.ZERO, 'none'))}"
        if self.by_signs != Sign.UNKNOWN:
            return alone
        return f"{alone}; {'undecided: moves slip' if self.exact is None else _spans(self.exact, depth)}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON, with the certificate."""
        exact = None
        if self.exact is not None:
            exact = {
                "polynomial": self.polynomial,
                "signs": [str(Sign.of(sign)) for sign in self.exact.signs],
                "between": [float(low) for low, _ in self.exact.brackets],
                "decided": all(self.exact.is_zero),
                "certificate": self.exact.certificate(),
            }
        return {"of": self.of, "by_signs": str(self.by_signs), "because": self.because, "exact": exact}


def _spans(found: SignIntervals, depth: Depth) -> str:
    cuts = ["0", *told_apart([low for low, _ in found.brackets]), "1"]
    signs = [Sign.of(sign) for sign in found.signs]
    last = "proved" if all(found.is_zero) else "proved but where two intervals meet"
    if depth != Depth.NUMBERS:
        words = ["none" if sign == Sign.ZERO else str(sign) for sign in signs]
        return f"exactly: {one_after_the_other(words, 'gamma')}, {last}"
    if len(signs) == 1:
        return f"exactly: {signs[0]} for every gamma in (0, 1), proved"
    spans = [f"{sign} for gamma in ({low}, {high})" for sign, low, high in zip(signs, cuts[:-1], cuts[1:], strict=True)]
    return f"exactly: {', '.join(spans)}, {last}"


@dataclass(frozen=True)
class Influences(Answer):
    """The answer."""

    start: str
    goal: str
    gamma: float
    way: Way
    formula: str | None
    """The value of the way, in gamma; None where moves slip."""
    influences: tuple[Influence, ...]

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        yield f"From {self.start} to {self.goal}{at}: {self.way.with_worth(depth)}."
        if depth != Depth.NAMES:
            yield "How its value changes when one thing grows and the way stays:"
            yield from (influence.in_words(depth) for influence in self.influences)

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "signs", "from": self.start, "to": self.goal, "gamma": self.gamma,
            "way": self.way.to_dict(), "formula": self.formula,
            "influences": [influence.to_dict() for influence in self.influences],
        }  # fmt: skip


def influences(model: HybridMDP, start: int, names: tuple[str, str]) -> Influences:
    """Ask how the value of the best way from a state changes with rewards, its length, doorways' chances and gamma.

    names: what to call start and goal.  Raises NoPlanError where no way leads to the goal, SettingError where start
    and goal are the same.
    """
    model.check_reachable(start)
    if start == model.grid.goal:
        raise SettingError("start and goal are the same, so there is no way whose value could change")
    exact = exact_values(model.world)
    walk = exact_walk(model, exact, start)
    way = way_of(model, [walk], exact.shifted[start], exact.shift)
    slips = model.grid.slip > 0
    found = [
        Influence("the goal's reward", Sign.PLUS, "it is paid, discounted", None),
        Influence(
            "a step's reward",
            Sign.PLUS if len(walk) > 2 or slips else Sign.ZERO,
            "it is paid as often as steps are made",
            None,
        ),
    ]
    found += _of_lengths(course(model, walk), slips)
    found += () if slips else _of_doors(model, walk, way)
    found.append(_of_gamma(course(model, walk), slips))
    formula = None if slips else str(course(model, walk).formula())
    return Influences(*names, model.gamma, way, formula, tuple(found))


def _of_lengths(of: Course, slips: bool) -> Iterator[Influence]:
    """One more step like the first one in each place."""
    told = set[str]()
    for at, stretch in enumerate(of.stretches):
        if stretch.place in told or (at == len(of.stretches) - 1 and stretch.steps == 1):
            continue
        told.add(stretch.place)
        ahead = sign_of_sum(Sign.of(later.reward) for later in of.stretches[at:])
        signs = Sign.of(stretch.reward), Sign.MINUS.times(ahead)
        longer = Course((*of.stretches[:at], Stretch(stretch.place, 1, stretch.reward), *of.stretches[at:]))
        by_signs = sign_of_sum(signs)
        is_open = by_signs == Sign.UNKNOWN and not slips
        because = f"its reward {signs[0]}, what is ahead put off {signs[1]}"
        yield Influence(
            f"a step more in {stretch.place}",
            by_signs,
            because,
            contrast(longer, of).signs if is_open else None,
            "(1 - gamma) * (V with that step - V)",
        )


def _of_doors(model: HybridMDP, walk: Sequence[int], way: Way) -> Iterator[Influence]:
    """How likely each doorway of the way is to be open, for one who goes there and sees."""
    for door in dict.fromkeys(way.doors):
        after, of = model.with_closed([door]), f"the chance that {door} is open"
        if not after.can_reach[walk[0]]:
            yield Influence(of, Sign.PLUS, "without it no way leads to the goal", None)
            continue
        exact = exact_values(after.world)
        tried = trying(model, after, walk, exact_walk(after, exact, walk[0]), exact, None)
        if tried is not None:  # else a diagonal step passes it by
            because = "on through it +, back and round -"
            grows = tried.break_even.grows.signs
            yield Influence(of, Sign.UNKNOWN, because, grows, "(1 - gamma) * (V if it is open - V if it is closed)")


def _of_gamma(of: Course, slips: bool) -> Influence:
    """The sign of dV / dgamma: with N = (1 - gamma) * V, that of (1 - gamma) * N' + N."""
    signs = [Sign.of(stretch.reward) for at, stretch in enumerate(of.stretches) if at or stretch.steps > 1]
    if slips:  # any step may be followed by more, whose reward is below 0, and the goal's may come later
        signs = [Sign.MINUS, Sign.of(of.stretches[-1].reward)]
    by_signs = sign_of_sum(signs)
    because = f"later rewards {', '.join(dict.fromkeys(signs)) or 'none'}"
    exact = sign_intervals(_whole(_slope(of))) if by_signs == Sign.UNKNOWN and not slips else None
    return Influence("gamma", by_signs, because, exact, "(1 - gamma)**2 * dV/dgamma")


def _slope(of: Course) -> dict[int, Fraction]:
    found: dict[int, Fraction] = {}
    for exponent, value in of.terms().items():
        for power, share in ((exponent - 1, exponent * value), (exponent, (1 - exponent) * value)):
            if share:
                found[power] = found.get(power, Fraction(0)) + share
    return {power: share for power, share in found.items() if share}


def _whole(terms: dict[int, Fraction]) -> dict[int, int]:
    scale = lcm(*(of.denominator for of in terms.values()))
    return {power: int(of * scale) for power, of in terms.items()}
