"""Claims of the paper, and the rules by which measurements decide them.  Nothing is decided but by an interval.

A claim is judged for each reading of what the paper leaves open.  If all readings bear it out it is reproduced, if
none does it is not, and otherwise it depends on the reading, and which ones bear it out is named.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from qualrl.studies.measures import Measure
from qualrl.studies.statistics import Floats, Spread, median_interval, number, ratio_of_medians, share, spread

REPRODUCED, NOT_REPRODUCED, NOT_MEASURED = "reproduced", "not reproduced", "not measured"


class Strict(BaseModel):
    """Unknown keys are errors, and nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Selector(Strict):
    """Which runs: those of a series, and of one learning rate, epsilon or some readings where it has several."""

    series: str
    alpha: float | None = None
    epsilon: float | None = None
    readings: tuple[str, ...] | None = None


def _selector(value: object) -> object:
    return {"series": value} if isinstance(value, str) else value


Runs = Annotated[Selector, BeforeValidator(_selector)]


@dataclass(frozen=True)
class Finding:
    """What the runs of one reading say of a claim."""

    holds: bool
    text: str
    value: Spread | None = None
    """The number compared, with its interval."""


class _Claim(Strict):
    """What the paper says, of which runs, and in which measure."""

    says: str
    measure: Measure
    of: Runs

    def selectors(self) -> tuple[Selector, ...]:
        """The groups of runs to judge by, in the order ``judge`` takes them."""
        return (self.of,)


class About(_Claim):
    """A number: the median's interval lies within the paper's number, give or take a share of it."""

    rule: Literal["about"]
    paper: float
    within: float = Field(default=0.15, gt=0, lt=1)

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class."""
        found = median_interval(samples[0])
        holds = self.paper * (1 - self.within) <= found.low and found.high <= self.paper * (1 + self.within)
        return Finding(holds, str(found), found)


class Exactly(_Claim):
    """A number that at least 95 % of the runs meet exactly."""

    rule: Literal["exactly"]
    paper: float

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class."""
        found = spread(samples[0])
        return Finding(found.low == found.high == self.paper, str(found), found)


class Less(_Claim):
    """One median is below another: the interval of their ratio ends below 1 - by, so that trifles decide nothing."""

    rule: Literal["less"]
    than: Runs
    by: float = Field(default=0.05, ge=0, lt=1)

    def selectors(self) -> tuple[Selector, ...]:
        """See _Claim."""
        return self.of, self.than

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class."""
        ratio = ratio_of_medians(samples[0], samples[1])
        return Finding(ratio.high < 1 - self.by, _compared(samples, ratio), ratio)


class Alike(_Claim):
    """Two medians differ little: the interval of their ratio lies within 1 / (1 + margin) and 1 + margin."""

    rule: Literal["alike"]
    than: Runs
    margin: float = Field(gt=0)

    def selectors(self) -> tuple[Selector, ...]:
        """See _Claim."""
        return self.of, self.than

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class."""
        ratio = ratio_of_medians(samples[0], samples[1])
        holds = ratio.low > 1 / (1 + self.margin) and ratio.high < 1 + self.margin
        return Finding(holds, _compared(samples, ratio), ratio)


class Falling(_Claim):
    """The median falls from each to the next along alpha or epsilon: every ratio's interval ends below 1 - by."""

    rule: Literal["falling"]
    along: Literal["alpha", "epsilon"]
    by: float = Field(default=0.05, ge=0, lt=1)

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class.  samples: in the order of what they lie along."""
        ratios = [ratio_of_medians(b, a) for a, b in pairwise(samples)]
        worst = max(ratios, key=lambda ratio: ratio.high)
        ends = " to ".join(number(float(np.median(sample))) for sample in (samples[0], samples[-1]))
        return Finding(worst.high < 1 - self.by, f"{ends}, each step x {_ratio(worst)} at most", worst)


class Share(_Claim):
    """Something is so for most runs (at_least), or for few (at_most): the share's interval lies on that side."""

    rule: Literal["share"]
    at_least: float | None = None
    at_most: float | None = None

    def judge(self, samples: Sequence[Floats]) -> Finding:
        """See the class.  Several samples: each of them must be so; the worst is shown."""
        shares = [share(sample) for sample in samples]
        worst = max(shares, key=lambda s: s.high) if self.at_least is None else min(shares, key=lambda s: s.low)
        holds = (self.at_least is None or worst.low > self.at_least) and (
            self.at_most is None or worst.high < self.at_most
        )
        text = f"{worst.median:.0%} of the runs ({worst.low:.0%} to {worst.high:.0%})"
        return Finding(holds, text, worst)


class Coefficient(Strict):
    """A coefficient of a fit lies, with its interval, between two bounds."""

    rule: Literal["coefficient"]
    says: str
    fit: str
    term: str
    low: float | None = None
    high: float | None = None

    def judge(self, fits: Mapping[str, Mapping[str, Spread]]) -> Finding:
        """See the class.  fits: by name, the coefficients by term."""
        found = fits[self.fit][self.term]
        holds = (self.low is None or found.low >= self.low) and (self.high is None or found.high <= self.high)
        return Finding(holds, str(found), found)


class Unmeasured(Strict):
    """A claim that no measurement of this version decides, and why."""

    rule: Literal["unmeasured"]
    says: str
    why: str


Claim = Annotated[
    About | Exactly | Less | Alike | Falling | Share | Coefficient | Unmeasured, Field(discriminator="rule")
]


Reading = tuple[str, ...]
"""A reading for each group of runs compared; "" where nothing is open."""


@dataclass(frozen=True)
class Judged:
    """A claim with what was found for each reading, and the verdict."""

    says: str
    findings: dict[Reading, Finding]
    verdict: str
    why: str = ""
    """Why it was not measured."""

    @property
    def measured(self) -> str:
        """What was found in a line for each reading, those that say the same together."""
        alike: dict[str, list[str]] = {}
        for reading, found in self.findings.items():
            alike.setdefault(found.text, []).append(shown(reading))
        if len(alike) < 2:
            return next(iter(alike), self.why)
        return "\n".join(f"{'; '.join(names)}: {text}" for text, names in alike.items())


def judged(says: str, findings: dict[Reading, Finding]) -> Judged:
    """A claim and its verdict."""
    return Judged(says, findings, verdict({reading: found.holds for reading, found in findings.items()}))


def shown(reading: Reading) -> str:
    """A reading in words."""
    return ", ".join(dict.fromkeys(name for name in reading if name))


def verdict(holds: Mapping[Reading, bool]) -> str:
    """The verdict over all readings.

    Where the readings of one group alone decide, only they are named.
    """
    if not holds:
        return NOT_MEASURED
    if all(holds.values()):
        return REPRODUCED
    if not any(holds.values()):
        return NOT_REPRODUCED
    for at in range(len(next(iter(holds)))):
        good, bad = ({reading[at] for reading, held in holds.items() if held is wanted} for wanted in (True, False))
        if not good & bad:
            names = dict.fromkeys(reading[at] for reading in holds if reading[at] in good)
            return f"depends on a reading ({'; '.join(names)})"
    return f"depends on a reading ({'; '.join(shown(reading) for reading, held in holds.items() if held)})"


def _compared(samples: Sequence[Floats], ratio: Spread) -> str:
    first, second = (number(float(np.median(sample))) for sample in samples)
    return f"{first} / {second} = {_ratio(ratio)}"


def _ratio(ratio: Spread) -> str:
    return f"{ratio.median:.3f} ({ratio.low:.3f} to {ratio.high:.3f})"
