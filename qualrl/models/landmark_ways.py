"""From each place to the landmarks around it: the options between landmarks (Sutton, Precup and Singh 1999).

S states, A moves, L landmarks, O options, C kinds of states, W ways: one for each state and option of it.
An option is "go to landmark l within region g", for every region that l lies in or joins.  Region g is taken with
the landmarks that join it, so a doorway belongs to both of its rooms.  An option may be taken in any state of
its region that is not at l and from which moves within the region lead to l; it ends at l, on leaving the
region, and where no way leads on.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import option_ways as kernel
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP

Scalar = TypeVar("Scalar", bound=np.generic)
NONE = kernel.NONE


@dataclass(frozen=True, eq=False)
class LandmarkWays:
    """The options of a model, and the shortest way of each, move by move as moves most often end."""

    names: tuple[str, ...]
    """(O,) such as "go to doorway A-B in room A"; options in order of region, then landmark."""
    landmark: NDArray[np.int32]
    """(O,)"""
    kind_of: NDArray[np.int32]
    """(S,) states of one kind have the same options."""
    option_start: NDArray[np.int64]
    """(C + 1,) the options of kind c are option[option_start[c]] .. option[option_start[c + 1]]."""
    option: NDArray[np.int32]
    position: NDArray[np.int32]
    """(C, O) place of an option among those of a kind, -1 where it does not live."""
    slot_start: NDArray[np.int64]
    """(S + 1,) the ways of state s are slot_start[s] .. slot_start[s + 1], one for each option of its kind."""
    steps: NDArray[np.int32]
    """(W,) moves to the landmark; 0 at it, -1 where no way leads there within the region."""
    move: NDArray[np.uint8]
    """(W,) first move of the shortest way, the first of several; NONE where the option may not be taken."""
    likely: NDArray[np.uint32]
    """(S, A) where each move leads most often."""
    stuck: NDArray[np.bool_]
    """(S,) True where no option leads on towards the goal, so that single moves must be offered."""
    terminal: NDArray[np.bool_]
    """(S,)"""

    @classmethod
    def of(cls, model: HybridMDP) -> "LandmarkWays":
        """The ways of a model."""
        level, likely, terminal = model.landmarks, likely_targets(model), terminal_states(model)
        pairs = sorted((region, mark) for mark, joined in enumerate(level.regions) for region in set(joined))
        landmark = np.array([mark for _, mark in pairs], np.int32)
        kind_of, lives = _kinds(model, pairs)
        position = np.where(lives, np.cumsum(lives, axis=1) - 1, -1).astype(np.int32)
        option_start = np.concatenate([[0], np.cumsum(lives.sum(axis=1))])
        slot_start = np.concatenate([[0], np.cumsum(lives.sum(axis=1)[kind_of])])
        by_mark = np.argsort(level.landmark_of, kind="stable")
        source_start = np.searchsorted(level.landmark_of[by_mark], np.arange(len(level.names) + 1))
        steps, move = kernel.find_ways(
            likely, by_mark, source_start, landmark, terminal, slot_start, kind_of, position.ravel()
        )
        names = tuple(f"go to {level.names[mark]} in {model.region_names[region]}" for region, mark in pairs)
        option = np.nonzero(lives)[1].astype(np.int32)
        stuck = _stuck(_Slots(slot_start, steps, landmark, option_start, option, kind_of), level.landmark_of, terminal)
        return cls(
            names, landmark, kind_of, option_start, option, position, slot_start, steps, move, likely, stuck, terminal
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def n_actions(self) -> int:
        """A."""
        return int(self.likely.shape[1])

    @cached_property
    def options_of(self) -> NDArray[np.int64]:
        """(S,) how many options live in each state."""
        return np.diff(self.slot_start)

    def states_of_kind(self, kind: int) -> NDArray[np.int64]:
        """The states of a kind."""
        return np.flatnonzero(self.kind_of == kind)

    @cached_property
    def helpless(self) -> NDArray[np.bool_]:
        """(S,) where no option may be taken."""
        may = np.concatenate([[0], np.cumsum(self.steps > 0)])
        found: NDArray[np.bool_] = (may[self.slot_start[1:]] == may[self.slot_start[:-1]]) & ~self.terminal
        return found

    def table(self, of: NDArray[Scalar], kind: int) -> NDArray[Scalar]:
        """(states of the kind, K) view by state of a (W,) array."""
        states, k = self.states_of_kind(kind), int(np.diff(self.option_start)[kind])
        found: NDArray[Scalar] = of[self.slot_start[states][:, None] + np.arange(k)]
        return found


def likely_targets(model: HybridMDP) -> NDArray[np.uint32]:
    """(S, A) where each move leads most often, the first of several."""
    world = model.world
    if isinstance(world, GridWorld):
        return world.successor
    row = np.repeat(np.arange(len(world.row_start) - 1), np.diff(world.row_start))
    order = np.lexsort((np.arange(len(row)), -world.probability, row))
    return world.target[order[world.row_start[:-1]]].reshape(len(world), -1)


def terminal_states(model: HybridMDP) -> NDArray[np.bool_]:
    """(S,) True where an episode ends."""
    if not isinstance(model.world, GridWorld):
        return model.world.terminal
    terminal = np.zeros(len(model), np.bool_)
    terminal[model.world.goal] = True
    return terminal


def _kinds(model: HybridMDP, pairs: list[tuple[int, int]]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """(kind of each state, (C, O) which options live in a kind): by region, and at landmarks by all they join."""
    level = model.landmarks
    n_marks = len(level.names)
    code = model.region_of.astype(np.int64) * (n_marks + 1) + level.landmark_of + 1
    codes, kind_of = np.unique(code, return_inverse=True)
    lives = np.zeros((len(codes), len(pairs)), np.bool_)
    region_of_option = np.array([region for region, _ in pairs], np.int32)
    for kind, found in enumerate(codes.tolist()):
        region, mark = divmod(found, n_marks + 1)
        joined = {region, *(level.regions[mark - 1] if mark else ())}
        lives[kind] = np.isin(region_of_option, list(joined))
    return kind_of.ravel().astype(np.int32), lives


@dataclass(frozen=True, eq=False)
class _Slots:
    """What is needed to ask, for many states at once, which options lead where."""

    start: NDArray[np.int64]
    steps: NDArray[np.int32]
    landmark: NDArray[np.int32]
    option_start: NDArray[np.int64]
    option: NDArray[np.int32]
    kind_of: NDArray[np.int32]

    def leads_to(self, good: NDArray[np.bool_], states: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether some option that may be taken in a state goes to a good landmark."""
        counts = self.start[states + 1] - self.start[states]
        owner = np.repeat(np.arange(len(states)), counts)
        place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
        option = self.option[self.option_start[self.kind_of[states]][owner] + place]
        open_way = self.steps[self.start[states][owner] + place] > 0
        found = np.zeros(len(states), np.bool_)
        found[owner[open_way & good[self.landmark[option]]]] = True
        return found


def _stuck(slots: _Slots, landmark_of: NDArray[np.int32], terminal: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where no option goes to a landmark from which options lead on, landmark by landmark, to the goal."""
    marked = np.flatnonzero(landmark_of >= 0)
    count = int(max(slots.landmark.max(initial=-1), landmark_of.max(initial=-1))) + 1
    good = np.zeros(count, np.bool_)
    while True:
        onward = slots.leads_to(good, marked) | terminal[marked]
        now = np.zeros(count, np.bool_)
        now[landmark_of[marked]] = True
        now[landmark_of[marked[~onward]]] = False
        if (now == good).all():
            break
        good = now
    stuck: NDArray[np.bool_] = ~slots.leads_to(good, np.arange(len(landmark_of))) & ~terminal
    return stuck
