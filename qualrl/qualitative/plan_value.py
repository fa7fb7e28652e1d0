"""What a way is worth, as a formula in gamma: the rewards of its steps, one after the other.

A way of T steps with rewards r_0 .. r_{T-1} is worth V = sum of r_t * gamma**t.  Few rewards differ from the one
before, so (1 - gamma) * V = r_0 + sum of (r_t - r_{t-1}) * gamma**t - r_{T-1} * gamma**T has few terms, whatever T.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING, Any, Protocol

from qualrl.errors import SettingError
from qualrl.qualitative.sign_intervals import SignIntervals, sign_intervals
from qualrl.qualitative.signs import one_after_the_other

if TYPE_CHECKING:
    import sympy


DIGITS = (6, 9, 12, 15)
HALF = 0.5


class Worth(Protocol):
    """What has a value as a formula in gamma: a way, or several of which chance picks one."""

    def value(self, gamma: float) -> float:
        """At its first step, in floating point."""

    def terms(self) -> dict[int, Fraction]:
        """(1 - gamma) * V: coefficient by exponent of gamma."""

    def formula(self) -> "sympy.Expr":
        """V in the symbol gamma."""


@dataclass(frozen=True)
class Stretch:
    """Steps in one place that are all paid alike."""

    place: str
    steps: int
    reward: float
    """Of each of them."""


@dataclass(frozen=True)
class Course:
    """The rewards of a way without chance."""

    stretches: tuple[Stretch, ...]

    @property
    def steps(self) -> int:
        """Of all stretches."""
        return sum(stretch.steps for stretch in self.stretches)

    def value(self, gamma: float) -> float:
        """What it is worth at its first step, in floating point."""
        worth, discount = 0.0, 1.0
        for stretch in self.stretches:
            worth += discount * stretch.reward * _sum_of_powers(gamma, stretch.steps)
            discount *= gamma**stretch.steps
        return worth

    def terms(self) -> dict[int, Fraction]:
        """(1 - gamma) * V: coefficient by exponent of gamma, the rewards taken for the numbers that floats are."""
        found: dict[int, Fraction] = {}
        before, at = Fraction(0), 0
        for stretch in (*self.stretches, Stretch("", 0, 0.0)):
            reward = Fraction(stretch.reward)
            found[at] = found.get(at, Fraction(0)) + reward - before
            before, at = reward, at + stretch.steps
        return {exponent: of for exponent, of in found.items() if of}

    def formula(self) -> "sympy.Expr":
        """V in the symbol gamma, stretch by stretch; at gamma = 1 its limit counts."""
        import sympy

        gamma, at = sympy.Symbol("gamma"), 0
        parts = []
        for stretch in self.stretches:
            share = 1 if stretch.steps == 1 else (1 - gamma**stretch.steps) / (1 - gamma)
            parts.append(sympy.Rational(Fraction(stretch.reward)) * gamma**at * share)
            at += stretch.steps
        return sympy.Add(*parts, evaluate=False)


@dataclass(frozen=True)
class Chance:
    """Two ways that begin alike and go on by chance: worth what they are worth on average."""

    likely: float
    """The probability of the first."""
    first: Course
    second: Course

    def value(self, gamma: float) -> float:
        """What to expect at the first step, in floating point."""
        return self.likely * self.first.value(gamma) + (1 - self.likely) * self.second.value(gamma)

    def terms(self) -> dict[int, Fraction]:
        """(1 - gamma) * V, the probability taken for the number that a float is."""
        likely = Fraction(self.likely)
        return combined((likely, self.first), (1 - likely, self.second))

    def formula(self) -> "sympy.Expr":
        """V in the symbol gamma."""
        import sympy

        likely = sympy.Rational(Fraction(self.likely))
        shares = (likely, self.first), (1 - likely, self.second)
        return sympy.Add(*(share * of.formula() for share, of in shares))


def combined(*parts: tuple[Fraction | int, Worth]) -> dict[int, Fraction]:
    """(1 - gamma) times a weighted sum of values: coefficient by exponent of gamma, none of them 0."""
    found: dict[int, Fraction] = {}
    for weight, worth in parts:
        for exponent, of in worth.terms().items():
            found[exponent] = found.get(exponent, Fraction(0)) + weight * of
    return {exponent: of for exponent, of in found.items() if of}


def _sum_of_powers(gamma: float, steps: int) -> float:
    return float(steps) if gamma == 1 else (1 - gamma**steps) / (1 - gamma)


@dataclass(frozen=True)
class Verdict:
    """Which of two ways is worth more for gamma between two numbers."""

    low: float
    high: float
    sign: int
    """1 for the first, -1 for the second, 0 where they are worth the same."""


@dataclass(frozen=True)
class Contrast:
    """Two ways compared for every gamma in (0, 1), with proof."""

    first: Worth
    second: Worth
    scale: int
    """``signs`` is of scale * (1 - gamma) * (V of the first - V of the second), whose coefficients are whole."""
    signs: SignIntervals

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Intervals in order; at a number where two of them meet, both are worth the same."""
        cuts = [0.0, *(float(low) for low, _ in self.signs.brackets), 1.0]
        return tuple(
            Verdict(low, high, sign) for low, high, sign in zip(cuts[:-1], cuts[1:], self.signs.signs, strict=True)
        )

    @property
    def is_decided(self) -> bool:
        """Whether it is known of each number where two intervals meet that the two are worth the same there."""
        return all(self.signs.is_zero)

    def in_words(self, first: str, second: str, has_numbers: bool = True) -> str:
        """The verdicts in one sentence; ``first`` and ``second`` say what to call the two."""
        verdicts = self.verdicts
        every = "for every gamma in (0, 1)" if has_numbers else "for every gamma"
        if verdicts[0].sign == 0:
            return f"{every} {first} and {second} are worth the same: proved"
        called = {1: first, -1: second}
        if len(verdicts) == 1:
            return f"{every} {called[verdicts[0].sign]} is worth more: proved"
        cuts = ["0", *told_apart([low for low, _ in self.signs.brackets]), "1"]
        spans = ", ".join(
            f"{called[of.sign]} for gamma in ({low}, {high})"
            for of, low, high in zip(verdicts, cuts[:-1], cuts[1:], strict=True)
        )
        if not has_numbers:
            spans = one_after_the_other([called[of.sign] for of in verdicts], "gamma")
        last = "proved" if self.is_decided else "proved but where two intervals meet, which is undecided"
        return f"worth more is {spans}: {last}"

    def to_dict(self, first: str, second: str) -> dict[str, Any]:
        """As JSON, with formulas and certificate; ``first`` and ``second`` are the keys of the two."""
        better = {1: first, -1: second, 0: "equal"}
        return {
            "verdicts": [{"low": of.low, "high": of.high, "better": better[of.sign]} for of in self.verdicts],
            "decided": self.is_decided,
            "formulas": {first: str(self.first.formula()), second: str(self.second.formula())},
            "scale": str(self.scale),
            "certificate": self.signs.certificate(),
        }


def told_apart(numbers: Sequence[float | Fraction]) -> list[str]:
    """Numbers with as many digits as tell them apart, and from 0 and 1; six at least.

    Those too close to 1 for that are told by their distance.
    """
    different = len({0, 1, *numbers})
    for in_words in (_to_digits, _by_distance):
        for digits in DIGITS:
            texts = [in_words(number, digits) for number in numbers]
            if len({"0", "1", *texts}) == different:
                return texts
    return texts


def _to_digits(number: float | Fraction, digits: int) -> str:
    return f"{float(number):.{digits}g}"


def _by_distance(number: float | Fraction, digits: int) -> str:
    """From 1 for what is nearer to it than to 0; of fractions that no floating point number holds, too."""
    exact = Fraction(number)
    from_one = HALF < exact < 1
    told = 1 - exact if from_one else exact
    rounded = Context(prec=digits).divide(Decimal(told.numerator), Decimal(told.denominator)).normalize()
    return f"{'1 - ' if from_one else ''}{rounded:g}"


def contrast(first: Worth, second: Worth) -> Contrast:
    """Compare what two ways are worth for every gamma in (0, 1).

    Raises SettingError for ways too long to be exact about (see ``sign_intervals``) and for rewards that are no
    numbers.
    """
    try:
        difference = combined((1, first), (-1, second))
    except (ValueError, OverflowError):
        raise SettingError("rewards must be finite numbers to compare ways by them") from None
    scale = lcm(*(of.denominator for of in difference.values()))
    whole = {exponent: int(of * scale) for exponent, of in difference.items()}
    return Contrast(first, second, scale, sign_intervals(whole))


def course_of(places: Sequence[str], rewards: Sequence[float]) -> Course:
    """The course of a way by the place and the reward of each step."""
    stretches: list[Stretch] = []
    for place, reward in zip(places, rewards, strict=True):
        if stretches and (stretches[-1].place, stretches[-1].reward) == (place, reward):
            stretches[-1] = Stretch(place, stretches[-1].steps + 1, reward)
        else:
            stretches.append(Stretch(place, 1, float(reward)))
    return Course(tuple(stretches))
