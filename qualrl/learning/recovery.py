"""How long a learner takes to get over a change of its world, beside one that learns the changed world from nothing.

A learner has recovered once the next WINDOW episodes take, on average, at most WITHIN more steps than those of the
optimal policy of the changed world would, if it explored as much (epsilon, slip and max_steps as in the run).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.changes import WorldChange
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.models.hybrid_mdp import HybridMDP

WINDOW = 50
WITHIN = 0.05
SAMPLE = 1000
"""Episodes of the optimal policy by which its mean is known; its standard error is well under 1 %."""


@dataclass(frozen=True)
class Recovery:
    """What one change cost."""

    after: int
    """Episodes before the change."""
    what: str
    optimum_before: int | None
    """Steps of the shortest way from the start before the change; None when episodes start at random."""
    optimum_after: int | None
    attainable: float
    """Mean steps of an episode of the optimal policy after the change, exploring as the learner does."""
    episodes: int | None
    """Episodes from the change until recovered; None if not before the next change or the end of the run."""
    steps: int | None
    """Steps of those episodes."""
    fresh_episodes: int | None
    """The same of a learner that starts from nothing in the changed world, with the same seed."""
    fresh_steps: int | None


def recovery_of(run: LearningRun) -> tuple[Recovery, ...]:
    """The recovery from each change of a run.  Learns each changed world once more from nothing."""
    if not run.changes:
        return ()
    ends = [*(event.after for event in run.changes[1:]), len(run.steps)]
    return tuple(_measured(run, event, end) for event, end in zip(run.changes, ends, strict=True))


def _measured(run: LearningRun, event: WorldChange, end: int) -> Recovery:
    attainable = attainable_steps(event.changed, run.settings, run.seed)
    episodes, steps = until_recovered(run.steps[event.after : end], attainable)
    again = train(event.changed, run.algorithm, replace(run.settings, episodes=end - event.after), run.seed)
    fresh_episodes, fresh_steps = until_recovered(again.steps, attainable)
    return Recovery(
        event.after, event.what, _shortest(event.before), _shortest(event.changed), attainable,
        episodes, steps, fresh_episodes, fresh_steps,
    )  # fmt: skip


def attainable_steps(model: HybridMDP, settings: LearnSettings, seed: int = 0) -> float:
    """Mean steps of an episode of the optimal policy that explores as the settings say."""
    told = replace(settings, episodes=SAMPLE, policy="optimal", alpha=0.1)
    return float(train(model, "td", told, seed).steps.mean())


def until_recovered(steps: NDArray[np.int64], attainable: float) -> tuple[int, int] | tuple[None, None]:
    """(episodes, their steps) before the first WINDOW episodes of ``steps`` that are good enough on average."""
    sums = np.concatenate([[0], np.cumsum(steps)])
    good = np.flatnonzero(sums[WINDOW:] - sums[:-WINDOW] <= WINDOW * (1 + WITHIN) * attainable)
    return (int(good[0]), int(sums[good[0]])) if good.size else (None, None)


def _shortest(model: HybridMDP) -> int | None:
    return None if model.start is None else int(model.grid.steps_to_goal[model.start])
