"""Counting visits afterwards: the same run once more, by a learner that counts."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.learning.learner import Learner
from qualrl.learning.run import LearningRun
from qualrl.learning.trainer import Runner, start_learner


@runtime_checkable
class Counting(Learner, Protocol):
    """A learner that counts how often it tries each action only when asked to."""

    def count_visits(self) -> None:
        """Count from now on; what is learned stays the same to the last bit."""


def visits_again(run: LearningRun) -> NDArray[np.uint32]:
    """``LearningRun.visits`` of a run that did not count: it takes about as long as the run did.

    Raises SettingError for a run that does not come out the same again.
    """
    learner = start_learner(run.model, run.algorithm, run.settings, run.seed)
    if isinstance(learner, Counting):
        learner.count_visits()
    Runner(learner, lambda _: None).to_episode(run.settings.episodes)
    learned = learner.learned()
    if learned.visits is None or not np.array_equal(learned.q, run.q):
        raise SettingError(
            "learning again gave other values, as where doors changed or the map was unknown, so visits are not known"
        )
    return learned.visits
