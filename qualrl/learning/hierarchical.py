"""Learners that choose where to go before they choose a move: options, MAXQ-Q, HAMQ, and societies of sub-agents.

S states, A moves, O options ("go to landmark l within region g", see ``models.landmark_ways``).

How each means it on a hybrid MDP
---------------------------------
option-q, intra-option-q   an option follows the shortest way to its landmark.
maxq-q                     such a task learns its moves too.  Ending elsewhere than at its landmark or where the
                           episode ends costs its own choices a pseudo-reward below all it could lose otherwise.
                           Completions are learned where a call was made, not all along the way.
hamq                       the machine chooses a landmark, then at each step a move that most often leads to another
                           place no farther from it.
switch                     one sub-agent an option; each is paid 1 at its landmark and nothing else, so that its values
                           are the chance of arriving, discounted.  The switch learns, on the world's rewards, whom to
                           obey, anew at each step.
w-learning                 sub-agents are paid the world's rewards, on arriving also gamma times what their landmark is
                           worth (the best that any sub-agent there hopes for), and the worst possible return for
                           ending elsewhere.  The one that would mind most not being obeyed is obeyed.

Single moves are offered beside options, tasks and sub-agents where nothing else leads on, and everywhere when
``primitives`` is set.  W-learning has none: where no sub-agent lives it moves at random.
An episode cut off by ``max_steps`` teaches nothing about the choice it was cut off in.

Learning rates: k of a formula for alpha counts the updates of each value that is learned: of what an option, a
sub-agent or a move is worth in a state and to whom, of each completion, and for maxq-q also of each move's reward.

What maxq-q asks for: a completion is measured while what was called still explores, so its limit holds when exploring
fades or is rare.  With a constant epsilon, values tend elsewhere, even with a falling learning rate, and may exceed
the optimum: V(j, s) counts on the best way, and C(i, s, j) is an average over all the ways that were taken.  A task
that may end in a bad place needs a pseudo-reward.

What switch does not promise: where two moves are as good for a sub-agent, it makes now the one and now the other, and
what obeying it is worth may come to lie anywhere between what the two are worth.

What w-learning does not promise: each Q_i tends to the optimum of its own task, but which of them wins is a
compromise.  In a world without slip what an agent minds is proportional to gamma to the length of the way by its
landmark, so the shortest way tends to win; nothing keeps two agents from undoing each other's moves.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import task_graph as graph_kernel
from qualrl.kernels import tasks as kernel
from qualrl.kernels.polling import poll
from qualrl.kernels.task_polling import poll_tasks
from qualrl.learning import polling
from qualrl.learning.learner import (
    Learned,
    Seeded,
    counting,
    fresh_progress,
    kernel_world,
    rates_of,
    table_of,
    visits_of,
)
from qualrl.learning.rules import Hierarchy, LearningRule
from qualrl.learning.settings import LearnSettings
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.landmark_ways import NONE, LandmarkWays
from qualrl.models.once import once
from qualrl.models.task_graph import TaskGraph, open_rows

LISTED_POWERS = 64
"""Powers of gamma that need not be worked out: for calls of fewer steps, which most are."""


def task_learner(model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> "LandmarkLearner | MaxqLearner":
    """The learner of a row of ``Loop.TASKS``."""
    if rule.hierarchy is Hierarchy.MAXQ:
        return MaxqLearner(model, settings)
    return LandmarkLearner(model, rule, settings)


class LandmarkLearner(Seeded):
    """A learner of the loop in ``kernels.tasks``."""

    def __init__(self, model: HybridMDP, rule: LearningRule, settings: LearnSettings) -> None:
        self.model = model
        self.ways = _ways(model)
        self.hierarchy = rule.hierarchy
        self._episodes = settings.episodes
        self._world = kernel_world(model)
        self._actions = (0,) * model.world.n_actions
        self._rows, self._may, self.policy = _layout(model, self.hierarchy, settings.primitives)
        self.first = self._rows.first
        self._rates, self._table = rates_of(model, settings), table_of(settings.alpha)
        agents = self.hierarchy in (Hierarchy.SWITCH, Hierarchy.W)
        self._how = (
            () if self.hierarchy is Hierarchy.INTRA_OPTION else None,
            () if self.hierarchy is Hierarchy.MACHINE else None,
            kernel.Agents(self.ways.landmark, model.landmarks.landmark_of) if agents else None,
            worst_return(model) if self.hierarchy is Hierarchy.W else None,
        )
        self._kept_from = -1 if model.start is None or self.hierarchy is Hierarchy.SWITCH else model.start

    def _begin(self, seed: int) -> None:
        self._tries: NDArray[np.uint32] | None = None
        self.progress = fresh_progress(self._episodes, seed)
        self.q = np.where(self._may, 0.0, -np.inf)
        self._visits = visits_of(self._table, len(self.q))

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        made: int = kernel.run_steps(
            *self._world, self._rows, self.policy, *self._how, self._visits, self._tries, self._rates, self._actions,
            self.model.starts, self.q, self.progress, n_steps,
        )  # fmt: skip
        return made

    def count_visits(self) -> None:
        """See Counting."""
        self._tries = np.zeros(len(self.model) * len(self._actions), np.uint32)

    def learned(self) -> Learned:
        """See Learner."""
        if self.hierarchy is Hierarchy.W:
            return Learned(polling.of_winners(self.ways, self.first, self.q), visits=self._made())
        polled = np.empty(self.ways.likely.shape)
        poll(
            self._rows, self.policy, self.ways.terminal, self.ways.likely, self._actions, self._kept_from, self.q,
            np.zeros(len(polled), np.bool_), polled,
        )  # fmt: skip
        return Learned(polled, visits=self._made())

    def _made(self) -> NDArray[np.uint32] | None:
        """(S, A) how often each move was made; None where that was not counted."""
        return None if self._tries is None else self._tries.reshape(len(self.model), -1).copy()


class MaxqLearner(Seeded):
    """A learner of the loop in ``kernels.task_graph``: on the model's own task graph, or on that of its landmarks."""

    def __init__(self, model: HybridMDP, settings: LearnSettings) -> None:
        self.model = model
        self.graph = model.tasks or landmark_tasks(model, settings.primitives)
        self._episodes = settings.episodes
        self._world = kernel_world(model)
        self._actions = (0,) * model.world.n_actions
        self._graph, self._pseudo = self.graph.for_loop
        self._moves = len(model) * len(self._actions)
        self._calls_kept = self._moves + int(np.diff(self.graph.bottom_up[0])[self.graph.kind_of].sum())
        self._rates, self._table = rates_of(model, settings), table_of(settings.alpha)

    def _begin(self, seed: int) -> None:
        self.progress = fresh_progress(self._episodes, seed)
        stack = np.zeros((4, self.graph.depth), np.int64)
        self._calls = graph_kernel.Calls(stack[0], stack[1], stack[2], stack[3])
        self.own = np.where(self.graph.open, 0.0, -np.inf)
        """(W,) completions as each task goes by them."""
        self.outer = self.own.copy() if self.graph.has_pseudo_rewards else None
        """(W,) completions as others see them; None where the two are the same."""
        self._kept = graph_kernel.Kept(
            np.zeros(self._calls_kept), np.ones(len(self.model), np.bool_), np.empty(LISTED_POWERS)
        )
        self._is_settled = False
        self._visits = visits_of(self._table, self.own.size + self._moves)

    def advance(self, n_steps: int) -> int:
        """See Learner."""
        self._is_settled = False
        made: int = graph_kernel.run_steps(
            *self._world, self._graph, self._pseudo, self._calls, self._visits, self._rates, self._actions,
            self.model.starts, self.own, self.outer, self._kept, self.progress, n_steps,
        )  # fmt: skip
        return made

    def count_visits(self) -> None:
        """See Counting.  Each move's reward is learned whenever it is made, so its updates count that."""
        self._visits = counting(self._visits, self._rates.alpha, len(self.own) + len(self.model) * len(self._actions))

    def learned(self) -> Learned:
        """See Learner."""
        q = polling.keep_to_choices(self._poll(), self.model, self.greedy_step)
        tries = None if self._visits is None else self._visits.counts[len(self.own) :].reshape(q.shape).copy()
        return Learned(q, visits=tries)

    def _poll(self) -> NDArray[np.float64]:
        """What ``kernels.task_polling.poll_tasks`` finds; from then on V of every task is known in every state."""
        polled = np.empty((len(self.model), len(self._actions)))
        begins = np.empty(len(self._actions) + len(self.graph), np.int64)
        poll_tasks(self._graph, self.own, self.outer, self._kept, self._actions, begins, polled)
        self._is_settled = True
        return polled

    @property
    def move_value(self) -> NDArray[np.float64]:
        """(S, A) expected reward of each move."""
        found: NDArray[np.float64] = self._kept.value[self.graph.value_first[:, None] + np.arange(len(self._actions))]
        return found

    def value_of(self, state: int, call: int) -> float:
        """V of what an entry of a state's row calls."""
        return float(self._values(state, call, call + 1)[0])

    def _values(self, state: int, begin: int, end: int) -> NDArray[np.float64]:
        """V of what some entries of a state's row call."""
        if not self._is_settled:
            self._poll()
        graph = self.graph
        start = graph.child_start[graph.kind_of[state]]
        found: NDArray[np.float64] = self._kept.value[
            graph.value_first[state] + graph.slot[start + begin : start + end]
        ]
        return found

    def _best_entry(self, task: int, state: int) -> int:
        """The entry of a task in a state that is worth most, after the first of the row; -1 where the task is over."""
        graph, kind, row = self.graph, self.graph.kind_of[state], self.graph.first[state]
        begin, end = graph.begin[kind, task], graph.end[kind, task]
        if begin == end:
            return -1
        worth = self._values(state, begin, end) + self.own[row + begin : row + end]
        best = int(worth.argmax())
        return int(begin) + best if worth[best] > -np.inf else -1

    def greedy_step(self, state: int, running: tuple[int, ...] | None) -> tuple[tuple[int, ...], int, bool]:
        """The greedy step: (tasks that run now below the root, move, whether the first was chosen just now)."""
        graph, stack = self.graph, [0, *(running or ())]
        while (entry := self._best_entry(stack[-1], state)) < 0:
            stack.pop()
        fresh = len(stack) == 1
        while True:
            child = int(graph.child[graph.child_start[graph.kind_of[state]] + entry])
            if child < graph.n_actions:
                return tuple(stack[1:]), child, fresh
            stack.append(child - graph.n_actions)
            entry = self._best_entry(stack[-1], state)


@once
def _ways(model: HybridMDP) -> LandmarkWays:
    return LandmarkWays.of(model)


@once
def _layout(
    model: HybridMDP, hierarchy: Hierarchy, primitives: bool
) -> tuple[kernel.Rows, NDArray[np.bool_], NDArray[np.uint8] | None]:
    """Where all stands, (W,) which entries may be chosen, and (W,) the moves of options that have a policy."""
    ways = _ways(model)
    blocks = hierarchy not in (Hierarchy.OPTION, Hierarchy.INTRA_OPTION)
    first = _first(ways, blocks)
    single = ways.helpless if hierarchy is Hierarchy.W else ways.stuck | primitives
    may = open_rows(ways, first, single, hierarchy is Hierarchy.MACHINE, blocks)
    base = ways.kind_of * np.int64(ways.position.shape[1])
    policy = None if blocks else _policy(ways, first, may)
    first_after = _by_move(model, first[:-1])
    if policy is not None and isinstance(model.world, GridWorld) and not model.world.slip:
        first_after = _by_choice(first_after, ways, first, policy)
    rows = kernel.Rows(
        first, ways.kind_of, ways.option_start, ways.option, ways.position.ravel(), _by_move(model, base), first_after
    )
    return rows, may, policy


@once
def landmark_tasks(model: HybridMDP, primitives: bool = False) -> TaskGraph:
    """The task graph of a model's landmarks; a task that fails is paid less than anything else could cost it."""
    ways, failing = _ways(model), 0.0
    lost = (ways.steps < 0) & ~np.repeat(ways.terminal, ways.options_of)
    if (ways.position < 0).any() or lost.any():  # otherwise no task can fail
        failing = worst_return(model) - max(model.world.reward_bounds[1], 0.0)
    return TaskGraph.from_landmarks(ways, model.landmarks.landmark_of, failing, primitives)


def worst_return(model: HybridMDP) -> float:
    """The least that any policy may earn, discounted."""
    return min(model.world.reward_bounds[0], 0.0) / (1 - model.gamma)


def _first(ways: LandmarkWays, blocks: bool) -> NDArray[np.int64]:
    """(S + 1,) where rows begin."""
    width = ways.options_of * (1 + blocks * ways.n_actions) + ways.n_actions
    return np.concatenate([[0], np.cumsum(width)])


def _by_move(model: HybridMDP, places: NDArray[np.int64]) -> NDArray[np.unsignedinteger]:
    """(S * A,) of places (S,), that of the state which each move of a grid leads to; (1,) for a table."""
    if not isinstance(model.world, GridWorld):
        return np.zeros(1, np.uint32)
    kind: type[np.unsignedinteger] = np.uint32 if places.max() <= np.iinfo(np.uint32).max else np.uint64
    return places.astype(kind)[model.world.successor.ravel()]


def _by_choice(
    by_move: NDArray[np.unsignedinteger], ways: LandmarkWays, first: NDArray[np.int64], policy: NDArray[np.uint8]
) -> NDArray[np.unsignedinteger]:
    """(W,) of what is known by move (S * A,) of a grid, that of the move of each open top choice."""
    found = np.zeros(first[-1], by_move.dtype)
    for kind, k in enumerate(np.diff(ways.option_start).tolist()):
        states = ways.states_of_kind(kind)[:, None]
        choice = first[states] + np.arange(k + ways.n_actions)
        move = np.where(policy[choice] == NONE, 0, policy[choice])
        found[choice] = by_move[states * ways.n_actions + move]
    return found


def _policy(ways: LandmarkWays, first: NDArray[np.int64], may: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(W,) the move of each top choice; NONE for those that may not be made."""
    policy = np.full(first[-1], NONE, np.uint8)
    for kind, k in enumerate(np.diff(ways.option_start).tolist()):
        row = first[ways.states_of_kind(kind)][:, None]
        policy[row + np.arange(k)] = ways.table(ways.move, kind)
        policy[row + k + np.arange(ways.n_actions)] = np.arange(ways.n_actions)
    policy[~may] = NONE
    return policy
