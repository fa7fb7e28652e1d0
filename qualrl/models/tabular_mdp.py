"""A Markov decision process as a table (paper, Definition 1).

S states, A actions, E entries.  Row s * A + a holds the outcomes of action a in state s:
entries row_start[row] .. row_start[row + 1], each a target, its probability and its reward.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError, UnknownNameError, did_you_mean

if TYPE_CHECKING:
    from scipy import sparse

Outcome = tuple[float, int, float, bool]
"""(probability, next state, reward, whether the next state ends the episode)."""


@dataclass(frozen=True, eq=False)
class TabularMDP:
    """Any finite MDP.  Raises SettingError when rows do not sum to 1 or indices point nowhere."""

    row_start: NDArray[np.int64]
    """(S * A + 1,)"""
    target: NDArray[np.uint32]
    """(E,)"""
    probability: NDArray[np.float64]
    """(E,)"""
    reward: NDArray[np.float64]
    """(E,)"""
    terminal: NDArray[np.bool_]
    """(S,) True for states that end an episode; their rows are never used."""
    gamma: float
    action_names: tuple[str, ...]
    state_names: tuple[str, ...] = field(default=())
    """(S,) names, or empty."""

    def __post_init__(self) -> None:
        rows = len(self.terminal) * len(self.action_names)
        if not 0 <= self.gamma < 1:
            raise SettingError(f"gamma must be at least 0 and less than 1, got {self.gamma}")
        if self.row_start.shape != (rows + 1,) or self.row_start[0] != 0 or self.row_start[-1] != len(self.target):
            raise SettingError(f"row_start must run from 0 to {len(self.target)} in {rows + 1} entries")
        if np.any(np.diff(self.row_start) < 1):
            raise SettingError("every state and action needs at least one outcome")
        if len(self.target) and self.target.max() >= len(self.terminal):
            raise SettingError(f"a target is {self.target.max()}, but there are {len(self.terminal)} states")
        if np.any(self.probability < 0) or not np.isfinite(self.reward).all():
            raise SettingError("probabilities must not be negative, and rewards must be finite")
        sums = np.add.reduceat(self.probability, self.row_start[:-1])
        if np.abs(sums - 1).max(initial=0) > 1e-9:
            row = int(np.abs(sums - 1).argmax())
            state, action = divmod(row, len(self.action_names))
            raise SettingError(f"the outcomes of action {action} in state {state} sum to {sums[row]}, not to 1")
        if self.state_names and len(self.state_names) != len(self.terminal):
            raise SettingError(f"{len(self.state_names)} names for {len(self.terminal)} states")
        for array in (self.row_start, self.target, self.probability, self.reward, self.terminal):
            array.setflags(write=False)

    @classmethod
    def from_outcomes(
        cls,
        outcomes: Mapping[int, Mapping[int, Sequence[Outcome]]],
        gamma: float,
        action_names: Sequence[str] = (),
    ) -> "TabularMDP":
        """From the convention of Gymnasium's toy text worlds, ``P[state][action] = [(p, next, reward, over)]``.

        A state is terminal when a transition into it says that the episode is over.
        """
        if not outcomes or set(outcomes) != set(range(len(outcomes))) or not outcomes[0]:
            raise SettingError("outcomes must be {state: {action: [...]}} with states and actions numbered from 0")
        n_states, n_actions = len(outcomes), len(outcomes[0])
        terminal = np.zeros(n_states, np.bool_)
        start, entries = [0], list[tuple[float, int, float]]()
        for s in range(n_states):
            for a in range(n_actions):
                for probability, target, reward, over in outcomes[s][a]:
                    entries.append((probability, target, reward))
                    terminal[target] |= over
                start.append(len(entries))
        names = tuple(action_names) or tuple(f"action {a}" for a in range(n_actions))
        columns = np.array(entries, np.float64).reshape(-1, 3)
        return cls(
            np.array(start, np.int64),
            columns[:, 1].astype(np.uint32),
            columns[:, 0].copy(),
            columns[:, 2].copy(),
            terminal,
            gamma,
            names,
        )

    def __len__(self) -> int:
        return len(self.terminal)

    @property
    def n_actions(self) -> int:
        """A."""
        return len(self.action_names)

    @property
    def reward_bounds(self) -> tuple[float, float]:
        """Smallest and largest reward."""
        return float(self.reward.min()), float(self.reward.max())

    @cached_property
    def cumulative(self) -> NDArray[np.float64]:
        """(E,) probabilities summed up within each row."""
        summed = np.cumsum(self.probability)
        before = np.repeat(summed[self.row_start[:-1]] - self.probability[self.row_start[:-1]], np.diff(self.row_start))
        return summed - before

    @cached_property
    def source(self) -> NDArray[np.int64]:
        """(E,) the state each entry belongs to."""
        return np.repeat(np.arange(len(self.row_start) - 1) // self.n_actions, np.diff(self.row_start))

    def transition(self, action: int | str) -> "sparse.csr_array":
        """(S, S) p_ij(a) of one action, by number or name; rows of terminal states are as stored, and never used."""
        from scipy import sparse  # it loads slowly, and learning needs none

        a = self.action_index(action) if isinstance(action, str) else action
        if not 0 <= a < self.n_actions:
            raise SettingError(f"there are actions 0 to {self.n_actions - 1}, got {a}")
        rows = np.arange(len(self.row_start) - 1)
        entries = np.flatnonzero(np.repeat(rows % self.n_actions, np.diff(self.row_start)) == a)
        cells = (self.source[entries], self.target[entries].astype(np.int64))
        return sparse.csr_array(sparse.coo_array((self.probability[entries], cells), shape=(len(self), len(self))))

    @cached_property
    def expected_reward(self) -> NDArray[np.float64]:
        """(S, A) r(i, a)."""
        expected = np.add.reduceat(self.probability * self.reward, self.row_start[:-1])
        return expected.reshape(len(self), self.n_actions)

    def action_index(self, name: str) -> int:
        """Index of an action; UnknownNameError when there is none of that name."""
        if name not in self.action_names:
            raise UnknownNameError(f"no action is called {name!r}; {did_you_mean(name, self.action_names)}")
        return self.action_names.index(name)
