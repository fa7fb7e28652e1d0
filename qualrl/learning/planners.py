"""Learners that plan with what they have seen: Dyna-Q, prioritized sweeping, and hql-replay.

S states, A actions, K outcomes (see ``kernels.stepping.happened`` for how they are numbered).

hql-replay: why its values tend to Q*
-------------------------------------
Its action values solve, up to what still waits, the MDP of the frequencies seen: Q(s, a) is the mean of
r + gamma max Q(s', .) over all outcomes of a in s so far, tried actions only.  (1) With epsilon > 0 every action of
every state that can be come back to is tried infinitely often, so the frequencies tend to the true probabilities
with probability 1 (the strong law; as a Robbins-Monro step this is alpha_k = 1/k, which meets Theorem 2).  (2) The
optimal values of a finite discounted MDP depend continuously on its probabilities.  (3) A state whose value changed
by more than the tolerance waits in its region; regions are replayed at every qualitative transition, at the end of
every episode and at the latest after S steps, within a budget that never runs out for good; and each backup is a
contraction by gamma: asynchronous value iteration (Bertsekas and Tsitsiklis 1989, section 4.3) follows the moving
fixed point. Unlike the eta of Algorithm 2, nothing handed down by the qualitative level is an estimate of its own: it
only says which regions are replayed, in which order, and where to explore.  So no bias is left to fade, under slip
either.  With epsilon 0 an action of chance is tried ``tries`` times and then believed, which may have been bad luck.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import dyna, replay, sweeping
from qualrl.kernels.experience import Experience
from qualrl.kernels.planning import run_planning
from qualrl.learning.learner import (
    KernelWorld,
    Learned,
    Seeded,
    fresh_progress,
    kernel_world,
    rates_of,
    rewired,
    table_of,
    visits_of,
)
from qualrl.learning.levels_anew import regions_anew
from qualrl.learning.relevant import relevant_regions
from qualrl.learning.rules import LearningRule, Planner
from qualrl.learning.settings import LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.once import once
from qualrl.solving.exact import shift_of, shifted_rewards


class PlanningLearner(Seeded):
    """A learner of the loop in ``kernels.planning``."""

    def __init__(self, model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> None:
        self.model = model
        self._settings, self._planner = settings, rule.planner
        self._world = kernel_world(model)
        self._shape = len(model), model.world.n_actions
        self._shift = shift_of(model.world) if rule.planner is Planner.REGIONS else 0.0
        ends = np.flatnonzero(_terminal(model))
        self._terminal = int(ends[0]) if len(ends) == 1 else ends  # a number is quicker to index by
        self._successors = (model.world.successor,) if isinstance(model.world, GridWorld) else ()
        self._seen = experience(model, self._world, self._shift)
        self._levels = _levels(model, settings, self._shift) if rule.planner is Planner.REGIONS else None
        self._rates = rates_of(model, settings)
        self._table = table_of(settings.alpha) if rule.planner is Planner.DYNA else None
        self._actions = (0,) * model.world.n_actions

    def _begin(self, seed: int) -> None:
        n_states, n_rows = self._shape[0], self._shape[0] * self._shape[1]
        self.progress = fresh_progress(self._settings.episodes, seed)
        self._seen = _nothing_seen(self._seen)
        self._q = np.zeros(n_rows)
        self._value = np.zeros(n_states)
        self._value[self._terminal] = self._shift
        self._visits = visits_of(self._table, n_rows)
        self._dyna = self._heap = None
        if self._planner is Planner.DYNA:
            self._dyna = dyna.Dyna(np.zeros(n_rows, np.uint32), self._settings.planning_steps)
        if self._planner is Planner.HEAP:
            self._heap = _heap(n_states, self._settings)
        if self._levels is not None:
            self._levels = _nothing_waits(self._levels)

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        made: int = run_planning(
            *self._world, self._seen, self._dyna, self._heap, self._levels, self._visits, self._rates, self._actions,
            self.model.starts, self._q, self._value, self.progress, n_steps,
        )  # fmt: skip
        return made

    def change_world(self, world: GridWorld) -> None:
        """See Adaptive.  What was seen stays; ``before`` is an index, which has to hold whatever may be seen."""
        self._world = rewired(self._world, world)
        self._successors = (*self._successors, world.successor)
        start, before = _before(self.model, [_targets(found, world.slip > 0) for found in self._successors])
        self._seen = self._seen._replace(before_start=start, before=before)

    def change_levels(self, model: HybridMDP) -> None:
        """See Exploring."""
        if self._levels is not None:
            best = self._q.reshape(len(model), -1).max(axis=1)
            self._levels = regions_anew(
                self._levels, model.region_of, model.landmarks.landmark_of, relevant_regions(model),
                np.abs(best - self._value),
            )  # fmt: skip
            notes = self._levels.notes
            notes[replay.PATH_LEFT], notes[replay.RETRY_AT], notes[replay.PATIENCE] = 0, 0, 1

    def visited(self) -> NDArray[np.bool_]:
        """See Exploring.  None is missed."""
        found: NDArray[np.bool_] = self._seen.tries.reshape(len(self.model), -1).max(axis=1) > 0
        return found

    def learned(self) -> Learned:
        """See Learner."""
        shifted = self._q.reshape(self._shape).copy()
        q = shifted - self._shift
        q[self._terminal] = 0.0
        visits = self._seen.tries.reshape(self._shape).copy()
        return Learned(q, shifted if self._levels is not None else None, visits=visits)


def experience(model: HybridMDP, world: KernelWorld, shift: float) -> Experience:
    """Counts of nothing seen yet; rewards shifted so that values are ``shift`` larger.

    What is updated is the model's own or still to be made: each learner needs arrays of its own, see ``_nothing_seen``.
    """
    grid, slip, table = world
    n_rows = len(model) * model.world.n_actions
    several = slip is not None or table is not None
    row_of = np.zeros(1, np.uint32)
    if table is not None:
        row_of = np.repeat(np.arange(n_rows, dtype=np.uint32), np.diff(table.row_start))
        n_outcomes, reward, goal_reward = len(table.target), table.reward, 0.0
    else:
        assert grid is not None
        n_outcomes = n_rows * (model.world.n_actions if several else 1)
        reward, goal_reward = grid.step_reward, grid.goal_reward + shift * (1 - model.gamma)
    before_start, before = _before_any_change(model)
    return Experience(
        np.zeros(n_rows, np.uint32), np.zeros(n_outcomes if several else 1, np.uint32),
        shifted_rewards(reward, shift, model.gamma), goal_reward,
        np.zeros(1, np.uint32) if grid is None else model.grid.successor.ravel(), before_start, before, row_of,
    )  # fmt: skip


def _nothing_seen(seen: Experience) -> Experience:
    """The same with arrays of its own for what is updated."""
    tries, counts = np.zeros(len(seen.tries), np.uint32), np.zeros(len(seen.counts), np.uint32)
    return Experience(
        tries, counts, seen.reward, seen.goal_reward, seen.leads_to.copy(), seen.before_start, seen.before, seen.row_of
    )


def _targets(successor: NDArray[np.uint32], slips: bool) -> NDArray[np.uint32]:
    """(K,) where each outcome on a grid leads."""
    return np.repeat(successor, successor.shape[1], axis=0).ravel() if slips else successor.ravel()


@once
def _before_any_change(model: HybridMDP) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """``_before`` of the world as it is at first."""
    world = model.world
    return _before(model, [_targets(world.successor, world.slip > 0) if isinstance(world, GridWorld) else world.target])


def _before(model: HybridMDP, targets: list[NDArray[np.uint32]]) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Outcomes by the states they lead to, in compressed rows; ``targets``: one (K,) array a version of the world."""
    size = len(targets[0])
    world = model.world
    live = ~_terminal(model)
    acting = live.repeat(size // len(world)) if isinstance(world, GridWorld) else live[world.source]
    target, outcome = _by_target(np.flatnonzero(acting).astype(np.uint32), targets)
    is_new = np.ones(len(target), np.bool_)
    is_new[1:] = (target[1:] != target[:-1]) | (outcome[1:] != outcome[:-1])
    start = np.searchsorted(target[is_new], np.arange(len(model) + 1, dtype=np.uint32))
    return start.astype(np.int64, copy=False), outcome[is_new]


def _by_target(
    outcomes: NDArray[np.uint32], targets: list[NDArray[np.uint32]]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """(targets, outcomes) of all versions of the world, sorted; what sorting takes is given back, for large maps."""
    target = np.concatenate([leads_to[outcomes] for leads_to in targets])
    outcome = np.tile(outcomes, len(targets))
    order = np.lexsort((outcome, target))
    return target[order], outcome[order]


@once
def _terminal(model: HybridMDP) -> NDArray[np.bool_]:
    if isinstance(model.world, GridWorld):
        terminal = np.zeros(len(model), np.bool_)
        terminal[model.world.goal] = True
        return terminal
    return model.world.terminal


def _heap(n_states: int, settings: LearnSettings) -> sweeping.Heap:
    return sweeping.Heap(
        np.zeros(n_states, np.uint32), np.full(n_states, -1, np.int32), np.zeros(n_states),
        settings.planning_threshold, settings.planning_steps,
    )  # fmt: skip


def _levels(model: HybridMDP, settings: LearnSettings, shift: float) -> replay.Levels:
    """The level in which nothing waits yet; each learner needs arrays of its own, see ``_nothing_waits``."""
    n_states, n_regions = len(model), len(model.region_names)
    promise, best_step = _promises(model, shift)
    notes, budget = np.zeros(replay.NOTES, np.int64), np.zeros(replay.BUDGET)
    notes[replay.NEEDED] = notes[replay.PATIENCE] = 1
    budget[replay.LET_GO] = replay.TOLERANCE
    return replay.Levels(
        model.region_of, model.landmarks.landmark_of, relevant_regions(model), np.zeros(n_states, np.uint32),
        _ring_start(model), np.zeros(n_regions, np.int64), np.zeros(n_regions, np.int64),
        np.zeros(n_states, np.bool_), np.zeros(n_regions), np.zeros(n_states, np.int64), np.zeros(n_states, np.int64),
        np.zeros(n_states, np.uint32), np.zeros(n_states, np.uint32), np.zeros(n_states, np.uint32),
        np.zeros(model.world.n_actions**2, np.int64), notes, budget,
        promise, best_step, settings.tries, settings.planning_steps,
    )  # fmt: skip


def _nothing_waits(levels: replay.Levels) -> replay.Levels:
    """The same with arrays of its own for what is updated: rows of few blocks, which are quicker to make."""
    n_states, n_regions = len(levels.waits), len(levels.due)
    ring, queue, parent, path = np.zeros((4, n_states), np.uint32)
    since, mark = np.zeros((2, n_states), np.int64)
    head, length = np.zeros((2, n_regions), np.int64)
    return replay.Levels(
        levels.region_of, levels.landmark_of, levels.relevant, ring, levels.ring_start, head, length,
        np.zeros(n_states, np.bool_), np.zeros(n_regions), since, mark, queue, parent, path,
        np.zeros(len(levels.undoes), np.int64), levels.notes.copy(), levels.budget.copy(),
        levels.promise, levels.best_step, levels.tries, levels.steps,
    )  # fmt: skip


@once
def _ring_start(model: HybridMDP) -> NDArray[np.int64]:
    """(R + 1,) where the states of each region begin in a list of all by region."""
    return np.concatenate([[0], np.cumsum(np.bincount(model.region_of, minlength=len(model.region_names)))])


@once
def _promises(model: HybridMDP, shift: float) -> tuple[float, float]:
    """(the most an action can be worth, the largest reward of a step on the way), both shifted.

    Optimism in the face of uncertainty, from the bounds of the rewards alone (as R-max, Brafman and Tennenholtz 2002).
    """
    world = model.world
    if isinstance(world, GridWorld):
        on_the_way, at_the_end = float(world.move_reward.max()), world.goal_reward
    else:
        live = ~world.terminal[world.source]
        ends = world.terminal[world.target] & live
        on_the_way = float(world.reward[live & ~ends].max(initial=world.reward.min()))
        at_the_end = float(world.reward[ends].max(initial=world.reward.min()))
    most = max(at_the_end, on_the_way / (1 - world.gamma))  # at once, or never: between them the worth is monotone
    return most + shift, shifted_rewards(np.array([on_the_way]), shift, world.gamma).item()
