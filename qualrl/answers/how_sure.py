"""How sure a learner may be: what it learned against exact values, and whether other seeds learn the same.

S states.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.answer import Answer, in_sign
from qualrl.answers.depth import Depth
from qualrl.answers.over_seeds import OverSeeds, over_seeds
from qualrl.answers.sureness import Judged, Sureness, judged
from qualrl.learning.rules import FLAT, rule_named
from qualrl.learning.run import LearningRun
from qualrl.models.grid_world import GridWorld
from qualrl.planning.legs import legs_of
from qualrl.solving.policy import greedy_walk


@dataclass(frozen=True)
class HowSure(Answer):
    """The answer."""

    algorithm: str
    seed: int
    episodes: int
    total_steps: int
    gamma: float
    limit: str
    """What the learner's values tend to."""
    start: str
    learned: float
    """Value of the start."""
    exact: float
    error: float
    counts: bool
    """Whether visits were counted; else states are told by their values, and one whose updates came to exactly 0 is
    missed.
    """
    whole: Sureness
    regions: tuple[Sureness, ...]
    steps: tuple[Sureness, ...]
    """Of the states that the learned plan passes, a part for each region on the way, in its order."""
    arrives: bool
    """Whether what was learned leads from the start to the goal."""
    others: OverSeeds | None
    """What other seeds learned; None if that was not asked."""

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        run = f", {self.episodes} episodes with seed {self.seed}, {self.total_steps:,} steps,"
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        yield f"{self.algorithm}{depth.at_numbers(run)} beside exact values{at}."
        if depth != Depth.NAMES:
            worth = f"{self.learned:.6g} learned, {self.exact:.6g} exact, error {self.error:.3g}"
            sign = in_sign(self.learned - self.exact, self.exact, ("too low", "right", "too high"))
            yield f"Worth of {self.start}: {depth.at_numbers(worth, f'learned {sign}')}."
        yield from (part.in_words(depth) for part in (self.whole, *self.regions))
        if depth == Depth.SIGNS:
            yield from self._largest_errors()
        if self.steps:
            yield f"The learned way from {self.start}{'' if self.arrives else ', which does not arrive'}:"
            for number, part in enumerate(self.steps, 1):
                yield f"{depth.at_numbers(f'{number}.', ' ')} {part.in_words(depth)}"
        yield from self._remarks(depth)

    def _largest_errors(self) -> Iterator[str]:
        """In which regions what was learned is farthest from exact values."""
        errors = {part.name: part.mean_error for part in self.regions if part.mean_error}
        if len(errors) > 1:
            yield f"Error on average, the largest first: {', '.join(sorted(errors, key=lambda name: -errors[name]))}."

    def _remarks(self, depth: Depth) -> Iterator[str]:
        if self.whole.optimal is not None and self.whole.visited and depth != Depth.NAMES:
            yield (
                "An order is settled where the two learned values differ by more than both their errors together; "
                "one that is not settled is not wrong, but errors of that size could turn it."
            )
        if not self.counts:
            yield "Visits were not counted: a state is said to be visited if one of its values has changed."
        if self.limit != FLAT and depth != Depth.NAMES:
            yield f"What its values tend to: {depth.at_numbers(self.limit, self.limit.partition(' (')[0])}."
        if self.others is None:
            yield "This is one run: how far runs with other seeds would differ is not known from it."
        else:
            yield from self.others.lines(depth)

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "how-sure", "algorithm": self.algorithm, "seed": self.seed, "episodes": self.episodes,
            "total_steps": self.total_steps, "gamma": self.gamma, "limit": self.limit, "from": self.start,
            "learned": self.learned, "exact": self.exact, "error": self.error, "counts": self.counts,
            "whole": self.whole.to_dict(), "regions": [part.to_dict() for part in self.regions],
            "steps": [part.to_dict() for part in self.steps], "arrives": self.arrives,
            "others": None if self.others is None else self.others.to_dict(),
        }  # fmt: skip


def how_sure(run: LearningRun, start: int, name: str, seeds: int = 0) -> HowSure:
    """Compare what was learned with exact values, and ask how firm the learner's choices are.  name: of the start.

    seeds: how many others to learn with, to see whether they learn the same.
    Raises NoPlanError where no way leads from the start to the goal, SettingError where other seeds say nothing.
    """
    model = run.model
    model.check_reachable(start)
    found, learned = judged(run)
    world = model.world
    over = np.arange(len(model)) == world.goal if isinstance(world, GridWorld) else world.terminal
    states = np.flatnonzero(model.can_reach & ~over)
    by_region = [(region, states[model.region_of[states] == index]) for index, region in enumerate(model.region_names)]
    walk, arrives = greedy_walk(world, learned.actions, start) if run.chooses else ([start], False)
    steps, entries = [], []
    for leg in legs_of(model, walk) if run.chooses else []:
        passed = np.array(walk[leg.first : leg.last + 1])
        entries.append((model.region_names[leg.region], walk[leg.first]))
        steps.append((model.region_names[leg.region], np.unique(passed[~over[passed]])))
    entries = [(region, state) for region, state in entries if not over[state]]
    others = over_seeds(run, start, entries, seeds) if seeds else None
    return HowSure(
        run.algorithm, run.seed, len(run.steps), run.total_steps, model.gamma, rule_named(run.algorithm).limit, name,
        float(run.q[start].max()), float(run.exact_values[start]), float(found.error[start]), run.visits is not None,
        found.part("all regions", states), _parts(found, by_region), _parts(found, steps), arrives, others,
    )  # fmt: skip


def _parts(found: Judged, states_of: Sequence[tuple[str, NDArray[np.int64]]]) -> tuple[Sureness, ...]:
    return tuple(found.part(name, states) for name, states in states_of if len(states))
