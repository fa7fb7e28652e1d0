"""The one trainer: it starts the learner of a name, lets it run in slices, and packs up what was learned."""

import time
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

from qualrl.errors import SettingError
from qualrl.kernels import stepping
from qualrl.learning.changes import Change, world_changes
from qualrl.learning.learner import Adaptive, Learner, until
from qualrl.learning.rules import Loop, rule_named
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP

SLICE_S = 0.1
"""Aim of one call of the compiled loop: short enough for a progress bar and for Ctrl-C."""


Starter = Callable[[int], Learner]
"""Who starts a learner with a seed."""
Run = TypeVar("Run", bound=LearningRun)
"""What a run is told as."""


class Milestone(NamedTuple):
    """Where a run stands, for whoever watches it."""

    episode: int
    episodes: int
    total_steps: int
    last_steps: int | None
    """Steps of the last finished episode."""
    last_return: float | None


def start_learner(model: HybridMDP, algorithm: str, settings: LearnSettings, seed: int = 0) -> Learner:
    """A learner that has made no step yet, for whoever wants to look at it on its way.

    Raises UnknownNameError for an unknown algorithm, SettingError for a seed out of its range.
    """
    return learner_starter(model, algorithm, settings)(seed)


def learner_starter(model: HybridMDP, algorithm: str, settings: LearnSettings) -> Starter:
    """``start_learner`` for many seeds: what does not depend on the seed is made here.

    Only the compiled loop that is needed is loaded, to be quick to start.
    """
    rule = rule_named(algorithm)
    if rule.loop is Loop.ONE_STEP:
        from qualrl.learning.one_step import OneStepLearner

        return OneStepLearner(model, rule, settings).with_seed
    if rule.loop is Loop.AHEAD:
        from qualrl.learning.ahead import AheadLearner

        return AheadLearner(model, rule, settings).with_seed
    if rule.loop is Loop.PLANNING:
        from qualrl.learning.planners import PlanningLearner

        return PlanningLearner(model, rule, settings).with_seed
    from qualrl.learning.hierarchical import task_learner

    return task_learner(model, rule, settings).with_seed


class Runner:
    """Lets a learner go on, in slices, and tells whoever watches."""

    def __init__(self, learner: Learner, watch: Callable[[Milestone], None] | None = None) -> None:
        self.learner = learner
        self.total = 0
        """Steps made so far."""
        self._watch = watch
        self._progress = learner.progress
        self._slice_steps = 1000  # few at first: a learner that plans may take long over each

    @property
    def episode(self) -> int:
        """How many episodes are over."""
        found: int = self._progress.whole.item(stepping.EPISODE)
        return found

    def steps(self, count: int) -> None:
        """Go on for so many steps, or to the end."""
        self.total += self.learner.advance(count)
        if self._watch is not None:
            self._watch(_milestone(self._progress, self.total))

    def to_episode(self, episode: int) -> None:
        """Go on to the end of an episode, and not a step further."""
        whole = episode == len(self._progress.steps)
        self.learner.progress = self._progress if whole else until(self._progress, episode)
        at = time.perf_counter()
        self.steps(self._slice_steps)
        while self.episode < episode:
            before, at = at, time.perf_counter()
            aim = self._slice_steps * SLICE_S / max(at - before, 1e-6)
            self._slice_steps = int(min(max(aim, self._slice_steps // 4), self._slice_steps * 4)) + 1000
            self.steps(self._slice_steps)
        self.learner.progress = self._progress


class Trainer(Generic[Run]):
    """Runs of one learner, with any seeds: what does not depend on the seed is made once, when it is first needed."""

    def __init__(self, model: HybridMDP, algorithm: str, settings: LearnSettings, kind: type[Run]) -> None:
        self.model, self.algorithm, self.settings, self.kind = model, algorithm, settings, kind

    @cached_property
    def start(self) -> Starter:
        """See ``learner_starter``."""
        return learner_starter(self.model, self.algorithm, self.settings)

    def run(self, seed: int, watch: Callable[[Milestone], None] | None = None, changes: Sequence[Change] = ()) -> Run:
        """See ``train``."""
        begun = time.perf_counter()
        learner = self.start(seed)
        events = world_changes(self.model, changes, self.settings.episodes) if changes else ()
        runner = Runner(learner, watch)
        for event in events:
            if not isinstance(learner, Adaptive):
                raise SettingError(
                    f"{self.algorithm} walks by ways found on the map beforehand, so its world cannot change"
                )
            runner.to_episode(event.after)
            learner.change_world(event.changed.grid)
        runner.to_episode(self.settings.episodes)
        learned, progress = learner.learned(), learner.progress
        return self.kind(
            events[-1].changed if events else self.model, self.algorithm, seed, self.settings, progress.steps,
            progress.returns, learned.q, learned.arc_q, learned.arc_visits, time.perf_counter() - begun,
            learned.shifted_q, events, visits=learned.visits,
        )  # fmt: skip


def train(
    model: HybridMDP,
    algorithm: str,
    settings: LearnSettings,
    seed: int = 0,
    watch: Callable[[Milestone], None] | None = None,
    changes: Sequence[Change] = (),
) -> LearningRun:
    """Run a learner to the end of its episodes.  The same seed gives the same result, watched or not.

    changes: doors that close and open on the way, without the learner being told; see ``learning.changes``.
    Raises UnknownNameError for an unknown algorithm or door, NoPlanError when the goal cannot be reached, SettingError.
    """
    return Trainer(model, algorithm, settings, LearningRun).run(seed, watch, changes)


def _milestone(progress: stepping.Progress, total: int) -> Milestone:
    episode, episodes = progress.whole.item(stepping.EPISODE), len(progress.steps)
    if episode == 0:
        return Milestone(0, episodes, total, None, None)
    return Milestone(episode, episodes, total, progress.steps.item(episode - 1), progress.returns.item(episode - 1))
