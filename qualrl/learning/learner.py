"""What the trainer asks of every learner: to go on for a number of steps, and to say what it has learned.

S states, A actions, E arcs between landmarks.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import stepping
from qualrl.learning.schedule import schedule_of
from qualrl.learning.settings import LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.once import once

NO_LIMIT = 2**62
NO_ARCS, NO_TRAVELS = np.empty(0), np.empty(0, np.int64)
NO_ARCS.setflags(write=False)
NO_TRAVELS.setflags(write=False)


class Learned(NamedTuple):
    """What a learner knows so far."""

    q: NDArray[np.float64]
    """(S, A) values of the actions, by which the greedy policy chooses; terminal rows stay 0."""
    shifted_q: NDArray[np.float64] | None = None
    """(S, A) q plus the shift of ``solving.exact``, from learners that keep digits where q has none left."""
    arc_q: NDArray[np.float64] = NO_ARCS
    """(E,) values of the arcs between landmarks; empty for learners without that level."""
    arc_visits: NDArray[np.int64] = NO_TRAVELS
    """(E,) how often each arc was travelled."""
    visits: NDArray[np.uint32] | None = None
    """(S, A) how often each action was tried, (S, 1) how often each state was left by a policy that is evaluated; None
    from learners that do not count."""


class Learner(Protocol):
    """A learner on its way.  Advancing in slices of any size gives the same result."""

    progress: stepping.Progress
    """Where it stands; its arrays are updated in place.  It stops at the end of ``progress.steps``."""

    def advance(self, n_steps: int) -> int:
        """Make up to n_steps steps; fewer only when all episodes are done.  Returns how many."""

    def learned(self) -> Learned:
        """What it knows by now; arrays of its own, that later steps do not change."""


class Seeded(ABC):
    """What makes learners that differ in their seeds only: the constructor lays out what they share, once for all.

    It is read only.  Whoever learns is made by ``with_seed``.
    """

    progress: stepping.Progress

    def with_seed(self, seed: int) -> Self:
        """A learner that has made no step yet.  Raises SettingError for a seed out of its range."""
        learner = object.__new__(type(self))
        learner.__dict__.update(self.__dict__)
        learner._begin(seed)
        return learner

    @abstractmethod
    def _begin(self, seed: int) -> None:
        """Make the arrays that a learner updates."""


@runtime_checkable
class Adaptive(Learner, Protocol):
    """A learner under whom the world may change."""

    def change_world(self, world: GridWorld) -> None:
        """Go on in a world with other doors closed; the learner is not told, and has to find out."""


@runtime_checkable
class Exploring(Learner, Protocol):
    """A learner that may find out about its qualitative level on its way."""

    def change_levels(self, model: HybridMDP) -> None:
        """Go on with other regions and landmarks over the same states; what was learned of those is kept."""

    def visited(self) -> NDArray[np.bool_]:
        """(S,) states that it surely acted in; it may miss some, as the learner says."""


KernelWorld = tuple[stepping.Grid | None, float | None, stepping.Table | None]


@once
def kernel_world(model: HybridMDP) -> KernelWorld:
    """What the compiled loops need of a world: (grid, slip, None) or (None, None, table)."""
    world = model.world
    if isinstance(world, GridWorld):
        grid = stepping.Grid(_next_row(world), world.move_reward, world.goal, float(world.goal_reward))
        return grid, world.slip or None, None
    table = stepping.Table(world.row_start, world.target, world.cumulative, world.reward, world.terminal)
    return None, None, table


def rewired(kernels: KernelWorld, world: GridWorld) -> KernelWorld:
    """The same with moves that lead where they do in another world of the same states."""
    grid, slip, table = kernels
    assert grid is not None
    return grid._replace(next_row=_next_row(world)), slip, table


def _next_row(world: GridWorld) -> NDArray[np.uint32]:
    return world.successor.ravel() * np.uint32(world.n_actions)


def until(progress: stepping.Progress, episode: int) -> stepping.Progress:
    """The same progress, at whose end a learner stops after so many episodes."""
    return progress._replace(steps=progress.steps[:episode], returns=progress.returns[:episode])


def rates_of(model: HybridMDP, settings: LearnSettings) -> stepping.Rates:
    """The numbers of the learning rule; alpha is 0 where it changes, see ``table_of``."""
    alpha = schedule_of(settings.alpha).constant or 0.0
    return stepping.Rates(alpha, model.gamma, settings.epsilon, settings.max_steps or NO_LIMIT)


def table_of(alpha: float | str) -> NDArray[np.float64] | None:
    """The table of a learning rate that changes; None for a constant one."""
    schedule = schedule_of(alpha)
    return schedule.table() if schedule.constant is None else None


def visits_of(table: NDArray[np.float64] | None, rows: int) -> stepping.Visits | None:
    """No update of any row yet, where the learning rate changes with how many there were; else None.

    k counts the updates of each row, as Theorem 2 asks.
    """
    return None if table is None else stepping.Visits(np.zeros(rows, np.uint32), table)


def counting(visits: stepping.Visits | None, alpha: float, rows: int) -> stepping.Visits:
    """The same learning rate, of which each use is counted."""
    return stepping.Visits(np.zeros(rows, np.uint32), np.array([alpha])) if visits is None else visits


def tried(visits: stepping.Visits | None, n_states: int) -> NDArray[np.uint32] | None:
    """(S, A) how often each action was tried, where the learning rate of each action counts that; else None."""
    return None if visits is None else visits.counts.reshape(n_states, -1).copy()


def fresh_progress(episodes: int, seed: int) -> stepping.Progress:
    """The beginning of a run.  Raises SettingError for a seed out of its range."""
    if not 0 <= seed < 2**63:
        raise SettingError(f"seed must be a whole number from 0 to 2**63 - 1, got {seed}")
    whole, real = np.zeros(stepping.SLOTS, np.int64), np.zeros(stepping.SLOTS)
    return stepping.Progress(seed_stream(seed), whole, real, np.zeros(episodes, np.int64), np.zeros(episodes))


def seed_stream(seed: int) -> NDArray[np.uint64]:
    """(4,) state of xoshiro256++ for a seed, by splitmix64 as its authors advise."""
    mask, words = 2**64 - 1, []
    for _ in range(4):
        seed = (seed + 0x9E3779B97F4A7C15) & mask
        z = ((seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        words.append(z ^ (z >> 31))
    return np.array(words, np.uint64)
