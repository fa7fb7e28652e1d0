"""Whether other seeds learn the same: a run beside runs that differ in their seed only.

S states.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.depth import Depth
from qualrl.answers.sureness import judged
from qualrl.errors import SettingError
from qualrl.learning.many import over_threads
from qualrl.learning.run import LearningRun
from qualrl.learning.trainer import Trainer
from qualrl.qualitative.from_counts import Counts
from qualrl.solving.policy import greedy_walk

CONFIDENCE = 0.95
"""Of each interval alone."""


@dataclass(frozen=True)
class Share:
    """In how many runs something holds."""

    runs: int
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """Of the probability that it holds of a run with another seed."""
        return Counts(self.runs, self.of).interval(CONFIDENCE)

    def in_words(self, depth: Depth) -> str:
        """With the interval, at the depth of numbers."""
        low, high = self.interval
        count = "all" if self.runs == self.of else "none" if self.runs == 0 else "some"
        exactly = f"{self.runs} of {self.of} runs ({100 * CONFIDENCE:g} % interval {low:.3g} to {high:.3g})"
        return f"in {depth.at_numbers(exactly, f'{count} of the runs')}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"runs": self.runs, "of": self.of, "interval": list(self.interval)}


@dataclass(frozen=True)
class OverSeeds:
    """A run and others, the first run's seed first."""

    seeds: tuple[int, ...]
    errors: tuple[float, ...]
    """Of the learned value of the start, in each run."""
    arrives: Share
    """Whether the learned way leads to the goal."""
    optimal: Share
    """Whether each step of it is optimal, too."""
    regions: tuple[tuple[str, Share], ...]
    """By region on the first run's way: where it enters it, whether what is held for best is optimal."""

    def lines(self, depth: Depth) -> Iterator[str]:
        """In words, a line a fact."""
        yield f"Learned with other seeds too{depth.at_numbers(f': {len(self.seeds)} runs, seeds {self._span()}')}."
        if depth == Depth.NAMES:
            return
        yield f"The learned way from the start arrives {self.arrives.in_words(depth)}."
        yield f"Each step of it is optimal {self.optimal.in_words(depth)}."
        spread = f"{min(self.errors):.3g} to {max(self.errors):.3g}, median {median(self.errors):.3g}"
        if depth == Depth.NUMBERS:
            yield f"Error of the start over the runs: {spread}."
        for region, share in self.regions:
            yield f"Where this run enters {region}, the best action is optimal {share.in_words(depth)}."

    def _span(self) -> str:
        return f"{self.seeds[0]} to {self.seeds[-1]}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "seeds": list(self.seeds), "errors": list(self.errors), "confidence": CONFIDENCE,
            "median_error": median(self.errors),
            "arrives": self.arrives.to_dict(), "optimal": self.optimal.to_dict(),
            "regions": [{"region": region, **share.to_dict()} for region, share in self.regions],
        }  # fmt: skip


def over_seeds(run: LearningRun, start: int, entries: Sequence[tuple[str, int]], more: int) -> OverSeeds:
    """Learn again with so many seeds more, those after the run's, and look where the runs agree.

    entries: region and state where the run's way enters it.  Raises SettingError for a run that another seed would
    not repeat, or that chooses nothing.
    """
    if more < 1:
        raise SettingError(f"other seeds must be 1 or more, got {more}")
    if not run.chooses:
        raise SettingError(f"{run.algorithm} learns what a policy is worth; it chooses nothing for seeds to differ in")
    if run.changes or run.growth is not None:
        raise SettingError("a run whose world changed, or was unknown, is not repeated with other seeds")
    others = [run.seed + number for number in range(1, more + 1)]
    runs = [run, *over_threads(Trainer(run.model, run.algorithm, run.settings, LearningRun).run, others)]
    found = [_of_run(one, start) for one in runs]
    ways = [(arrives, bool(right[walk[:-1]].all())) for walk, arrives, right, _ in found]
    return OverSeeds(
        (run.seed, *others), tuple(error for *_, error in found),
        Share(sum(arrives for arrives, _ in ways), len(runs)), Share(sum(all(way) for way in ways), len(runs)),
        tuple((region, Share(sum(bool(right[at]) for _, _, right, _ in found), len(runs))) for region, at in entries),
    )  # fmt: skip


def _of_run(run: LearningRun, start: int) -> tuple[list[int], bool, NDArray[np.bool_], float]:
    """The learned way, whether it arrives, where the best action is optimal (S,), and the error of the start."""
    states, learned = judged(run)
    walk, arrives = greedy_walk(run.model.world, learned.actions, start)
    assert states.optimal is not None
    return walk, arrives, states.optimal, float(states.error[start])
