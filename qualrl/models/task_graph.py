"""Task graphs: which task calls what, where it is over, what its own choices are paid for (Dietterich 2000).

S states, A moves, T tasks (task 0 is the root), C kinds of states, W entries.  Each call that a task may make has
one entry in each state in which the task lives; states of one kind have the same calls, in the same order.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError, UnknownNameError, did_you_mean
from qualrl.kernels.task_graph import MOVES, MOVES_IN_ORDER, TASKS, Graph, Pseudo
from qualrl.models.grid_world import GridWorld
from qualrl.models.landmark_ways import LandmarkWays
from qualrl.models.tabular_mdp import TabularMDP


@dataclass(frozen=True)
class Task:
    """One task of a graph written by hand."""

    name: str
    calls: tuple[str, ...]
    """Names of tasks and of moves."""
    ends: Collection[int] = ()
    """States in which it is over, besides those that end the episode."""
    only: Mapping[str, Collection[int]] = field(default_factory=dict)
    """For a call, the only states in which it may be made."""
    pseudo: Mapping[int, float] = field(default_factory=dict)
    """For a state in which it may end, what its own choices are paid for that; 0 elsewhere."""


@dataclass(frozen=True, eq=False)
class TaskGraph:
    """A task graph, laid out for a compiled loop."""

    names: tuple[str, ...]
    """(T,) the root first."""
    n_actions: int
    """A; call ``child`` below A is a move, else task child - A."""
    kind_of: NDArray[np.int32]
    """(S,)"""
    first: NDArray[np.int64]
    """(S + 1,) the entries of state s are first[s] .. first[s + 1]."""
    begin: NDArray[np.int32]
    """(C, T) the entries of task i in a state of kind c are begin[c, i] .. end[c, i] after its first."""
    end: NDArray[np.int32]
    child_start: NDArray[np.int64]
    """(C + 1,) what entry x of kind c calls is child[child_start[c] + x]."""
    child: NDArray[np.int32]
    open: NDArray[np.bool_]
    """(W,) whether the call may be made; a task is over where it may make none."""
    pseudo_otherwise: NDArray[np.float64]
    """(T,) what a task's own choices are paid for ending in a state not listed."""
    pseudo: tuple[Mapping[int, float], ...]
    """(T,) and in those that are."""

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def has_pseudo_rewards(self) -> bool:
        """Whether some task goes by more than the world's rewards."""
        return bool(self.pseudo_otherwise.any()) or any(any(listed.values()) for listed in self.pseudo)

    @cached_property
    def depth(self) -> int:
        """Most calls that can be open at once, the root's included."""
        return int(nx.dag_longest_path_length(self._called)) + 1

    @cached_property
    def reach(self) -> NDArray[np.uint8]:
        """(T,) how far down a task calls: TASKS, MOVES, or MOVES_IN_ORDER for all moves wherever it lives."""
        task, x, child = self._entries
        lacking = ((self.end - self.begin) % self.n_actions != 0).any(axis=0)
        found = np.where(lacking, MOVES, MOVES_IN_ORDER).astype(np.uint8)
        found[task[x != child]] = MOVES
        found[task[child >= self.n_actions]] = TASKS
        return found

    @cached_property
    def _entries(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
        """For each entry of each kind: (the task whose it is, its number among those of the task, what it calls)."""
        count = (self.end - self.begin).ravel()
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        start = (self.child_start[:-1, None] + self.begin).ravel()
        task = np.tile(np.arange(len(self)), len(self.begin))
        return np.repeat(task, count), number, self.child[np.repeat(start, count) + number]

    @cached_property
    def _called(self) -> "nx.DiGraph[int]":
        """Which task calls which."""
        task, _, child = self._entries
        pairs = np.unique(np.stack([task, child.astype(np.int64) - self.n_actions])[:, child >= self.n_actions], axis=1)
        found: nx.DiGraph[int] = nx.DiGraph()
        found.add_nodes_from(range(len(self)))
        found.add_edges_from(pairs.T.tolist())
        return found

    @cached_property
    def bottom_up(self) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """(start, order): the tasks besides the root that live in kind c, order[start[c]] .. order[start[c + 1]].

        Each comes after all that it calls.
        """
        order = [task for task in reversed([*nx.topological_sort(self._called)]) if task > 0]
        lives = (self.end > self.begin)[:, order]
        start = np.concatenate([[0], np.cumsum(lives.sum(axis=1))])
        return start, np.array(order, np.int32)[np.nonzero(lives)[1]]

    @property
    def place(self) -> NDArray[np.int32]:
        """(C, T) where the value of a task stands among what a state of a kind has: the moves, then those of bottom_up.

        A task that does not live in a kind has a place there all the same, that of another.
        """
        start, order = self.bottom_up
        kind = np.repeat(np.arange(len(self.begin)), np.diff(start))
        found = np.full(self.begin.shape, self.n_actions, np.int32)
        found[kind, order] = self.n_actions + np.arange(len(order)) - start[kind]
        return found

    @cached_property
    def slot(self) -> NDArray[np.int32]:
        """(like child) the place of the value of what an entry calls."""
        kind = np.repeat(np.arange(len(self.begin)), np.diff(self.child_start))
        return np.where(
            self.child < self.n_actions, self.child, self.place[kind, np.maximum(self.child - self.n_actions, 0)]
        )

    @cached_property
    def value_first(self) -> NDArray[np.int64]:
        """(S,) where the values of each state begin in a loop's: of the A moves, then of the tasks of bottom_up."""
        many = self.n_actions + np.diff(self.bottom_up[0])[self.kind_of]
        found: NDArray[np.int64] = np.cumsum(many) - many
        return found

    @cached_property
    def for_loop(self) -> tuple[Graph, Pseudo | None]:
        """The graph as a compiled loop takes it."""
        spot = np.stack([self.kind_of, self.first[:-1], self.value_first], axis=1).ravel()
        begin = np.where(self.end > self.begin, self.begin, -1).ravel().astype(np.int32)
        graph = Graph(
            spot, begin, self.end.ravel(), self.child_start[:-1], self.slot, *self.bottom_up, self.reach
        )  # fmt: skip
        return graph, self._listed_pseudo() if self.has_pseudo_rewards else None

    def _listed_pseudo(self) -> Pseudo:
        listed = [sorted(amounts.items()) for amounts in self.pseudo]
        start = np.concatenate([[0], np.cumsum([len(pairs) for pairs in listed])])
        state = np.array([state for pairs in listed for state, _ in pairs], np.int64)
        amount = np.array([amount for pairs in listed for _, amount in pairs], np.float64)
        return Pseudo(self.pseudo_otherwise, start, state, amount)

    @classmethod
    def from_tasks(cls, tasks: Sequence[Task], world: GridWorld | TabularMDP) -> "TaskGraph":
        """The graph of some tasks, the root first.

        A task is also over where it may call nothing.  Raises UnknownNameError for a call of nothing known, and
        SettingError for a name given twice, a task that calls itself, or a root that does not know what to do.
        """
        names = tuple(task.name for task in tasks)
        terminal = np.zeros(len(world), np.bool_)
        terminal[world.goal if isinstance(world, GridWorld) else world.terminal] = True
        _check_names(names, world.action_names)
        open_of: dict[str, NDArray[np.bool_]] = {}
        for name in _bottom_up(tasks, world.action_names):
            open_of[name] = _open_calls(tasks[names.index(name)], open_of, world.action_names, terminal)
        helpless = np.flatnonzero(~open_of[names[0]].any(axis=1) & ~terminal)
        if len(helpless):
            raise SettingError(f"task {names[0]!r}, the root, has nothing to call in state {helpless[0]}")
        child = [_child(call, world.action_names, names) for task in tasks for call in task.calls]
        ends = np.cumsum([len(task.calls) for task in tasks]).astype(np.int32)
        begins = np.concatenate([[0], ends[:-1]]).astype(np.int32)
        return cls(
            names, world.n_actions, np.zeros(len(world), np.int32),
            np.arange(len(world) + 1, dtype=np.int64) * len(child), begins[None], ends[None],
            np.array([0, len(child)]), np.array(child, np.int32),
            np.concatenate([open_of[name] for name in names], axis=1).ravel(),
            np.zeros(len(tasks)), tuple(dict(task.pseudo) for task in tasks),
        )  # fmt: skip

    @classmethod
    def from_landmarks(
        cls, ways: LandmarkWays, landmark_of: NDArray[np.int32], failing: float, primitives: bool = False
    ) -> "TaskGraph":
        """The root calls "go to landmark l within region g", which calls moves.

        Kinds of states in none of which the root may make a single move have no entries for that.

        failing: pseudo-reward of such a task for ending neither at its landmark nor where the episode ends.
        primitives: whether the root may also make single moves everywhere, or only where no task leads on.
        """
        n_actions, moves = ways.n_actions, np.arange(ways.n_actions)
        n_kinds, k_of = len(ways.option_start) - 1, np.diff(ways.option_start)
        single = (ways.stuck | primitives) & ~ways.terminal
        moved = (np.bincount(ways.kind_of[single], minlength=n_kinds) > 0) | (k_of == 0)
        width = k_of * (1 + n_actions) + n_actions * moved
        begin = np.zeros((n_kinds, 1 + len(ways)), np.int32)
        end, child = np.zeros_like(begin), list[NDArray[np.int64]]()
        for kind, k in enumerate(k_of.tolist()):
            options = ways.option[ways.option_start[kind] : ways.option_start[kind + 1]]
            end[kind, 0] = k + n_actions * moved[kind]
            begin[kind, 1 + options] = end[kind, 0] + np.arange(k) * n_actions
            end[kind, 1 + options] = begin[kind, 1 + options] + n_actions
            child.append(np.concatenate([n_actions + 1 + options, np.tile(moves, moved[kind] + k)]))
        first = np.concatenate([[0], np.cumsum(width[ways.kind_of])])
        ended = {int(s): 0.0 for s in np.flatnonzero(ways.terminal)}
        at = [dict.fromkeys(np.flatnonzero(landmark_of == mark).tolist(), 0.0) for mark in ways.landmark.tolist()]
        return cls(
            ("root", *ways.names), n_actions, ways.kind_of, first, begin, end,
            np.concatenate([[0], np.cumsum(width)]), np.concatenate(child).astype(np.int32),
            open_rows(ways, first, single, moved=moved), np.array([0.0] + [failing] * len(ways)),
            ({}, *(ended | here for here in at)),
        )  # fmt: skip


def open_rows(
    ways: LandmarkWays,
    first: NDArray[np.int64],
    single: NDArray[np.bool_],
    towards: bool = False,
    blocks: bool = True,
    moved: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """(W,) for rows of K options, A moves and (``blocks``) K times A moves of an option: what may be chosen.

    single (S,): where single moves may be chosen; nothing may in a terminal state.
    moved (C,): in which kinds rows have the A moves, when not in all.
    towards: whether an option may only make moves that most often lead nearer to its landmark, or elsewhere but
    not farther from it; without it, it may make any.
    """
    n_actions, found = ways.n_actions, np.zeros(first[-1], np.bool_)
    for kind, k in enumerate(np.diff(ways.option_start).tolist()):
        states = ways.states_of_kind(kind)
        row = first[states][:, None]
        steps = ways.table(ways.steps, kind)
        may = (steps > 0) & ~ways.terminal[states][:, None]
        found[row + np.arange(k)] = may
        top = k
        if moved is None or moved[kind]:
            found[row + k + np.arange(n_actions)] = (single & ~ways.terminal)[states][:, None]
            top += n_actions
        if blocks:
            allowed = np.repeat(may[:, :, None], n_actions, axis=2)
            if towards:
                allowed &= _no_farther(ways, kind, states)
            found[row + top + np.arange(k * n_actions)] = allowed.reshape(len(states), -1)
    return found


def _no_farther(ways: LandmarkWays, kind: int, states: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(states, K, A) whether a move leads to another state from which the landmark is no farther."""
    options = ways.option[ways.option_start[kind] : ways.option_start[kind + 1]]
    here = ways.table(ways.steps, kind)[:, :, None]
    to = ways.likely[states].astype(np.int64)[:, None, :]
    place = ways.position[ways.kind_of[to], options[None, :, None]]
    slot = np.minimum(ways.slot_start[to] + np.maximum(place, 0), max(len(ways.steps) - 1, 0))
    steps = np.where(place >= 0, ways.steps[slot], -1)
    nearer: NDArray[np.bool_] = (steps >= 0) & (steps <= here) & (to != states[:, None, None])
    return nearer


def _check_names(names: tuple[str, ...], moves: tuple[str, ...]) -> None:
    if not names:
        raise SettingError("a task graph needs a root")
    for name in names:
        if names.count(name) > 1 or name in moves:
            raise SettingError(f"a task graph has two things called {name!r}")


def _child(call: str, moves: tuple[str, ...], names: tuple[str, ...]) -> int:
    if call in moves:
        return moves.index(call)
    if call not in names:
        raise UnknownNameError(f"no task or move is called {call!r}; {did_you_mean(call, (*names, *moves))}")
    return len(moves) + names.index(call)


def _bottom_up(tasks: Sequence[Task], moves: tuple[str, ...]) -> list[str]:
    """Names of the tasks, each after all it calls.  Raises SettingError for a task that ends up calling itself."""
    by_name = {task.name: task for task in tasks}
    order, on_the_way = list[str](), list[str]()

    def visit(name: str) -> None:
        if name in on_the_way:
            raise SettingError(f"task {name!r} ends up calling itself: {' > '.join([*on_the_way, name])}")
        if name in order:
            return
        on_the_way.append(name)
        for call in by_name[name].calls:
            if _child(call, moves, tuple(by_name)) >= len(moves):
                visit(call)
        on_the_way.pop()
        order.append(name)

    for task in tasks:
        visit(task.name)
    return order


def _open_calls(
    task: Task, open_of: Mapping[str, NDArray[np.bool_]], moves: tuple[str, ...], terminal: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(S, calls) where each call of a task may be made, given those of the tasks it calls."""
    for listed in (task.ends, task.pseudo, *task.only.values()):
        if any(not 0 <= state < len(terminal) for state in listed):
            raise SettingError(f"task {task.name!r} names a state outside 0 to {len(terminal) - 1}")
    for call in task.only:
        if call not in task.calls:
            raise UnknownNameError(f"task {task.name!r} does not call {call!r}; {did_you_mean(call, task.calls)}")
    found = np.empty((len(terminal), len(task.calls)), np.bool_)
    for i, call in enumerate(task.calls):
        found[:, i] = True if call in moves else open_of[call].any(axis=1)
        if call in task.only:
            allowed = np.zeros(len(terminal), np.bool_)
            allowed[list(task.only[call])] = True
            found[:, i] &= allowed
    found[terminal] = False
    found[list(task.ends)] = False
    return found
