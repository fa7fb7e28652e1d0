"""Semi-Markov decision processes: actions that take a random time tau (paper, Definition 2).

N states, P pairs of a state and one of its actions, E arcs.  The actions of state i are the pairs
action_start[i] .. action_start[i + 1]; the arcs of pair p, one for each state it may lead to, are
arc_start[p] .. arc_start[p + 1].  With E[gamma^tau] on its arcs and the discounted reward of a whole action,
an SMDP is solved as an MDP (equations (7) to (10)): see ``solving.semi_mdp_values``.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from qualrl.errors import SettingError, UnknownNameError, did_you_mean

Law = Callable[[int, int], Iterator[tuple[float, float]]]
"""From a pair and a next state to P(j, tau) for tau = 1, 2, ..., each with the probability of still being under way."""

LEAST_REST = 1e-12
MOST_STEPS = 1_000_000


@dataclass(frozen=True, eq=False)
class TauLaw:
    """The law of the time an action takes when it leads to one particular state: P(j, tau | i, a)."""

    taus: NDArray[np.int64]
    """(T,) times of positive probability, rising."""
    probabilities: NDArray[np.float64]
    """(T,) they sum to p_ij(a), not to 1, less what was cut off."""
    rest: float
    """Probability of the later times that were cut off, or a bound on it."""

    @property
    def mean(self) -> float:
        """E[tau | j] of the times that are listed."""
        return float(self.taus @ self.probabilities / self.probabilities.sum())

    def discount(self, gamma: float) -> float:
        """E[gamma^tau; j], short by at most ``rest``."""
        return float(self.probabilities @ float(gamma) ** self.taus.astype(np.float64))


@dataclass(frozen=True, eq=False)
class SemiMDP:
    """A finite SMDP.  Raises SettingError when it contradicts itself."""

    state_names: tuple[str, ...]
    """(N,)"""
    action_names: tuple[str, ...]
    """(P,) name of the action of each pair."""
    action_start: NDArray[np.int64]
    """(N + 1,)"""
    arc_start: NDArray[np.int64]
    """(P + 1,)"""
    target: NDArray[np.int64]
    """(E,)"""
    probability: NDArray[np.float64]
    """(E,) p_ij(a), of any time; what is missing from 1 is the probability that the action never ends."""
    discount: NDArray[np.float64]
    """(E,) E[gamma^tau; j] = sum over tau of gamma^tau P(j, tau | i, a)."""
    reward: NDArray[np.float64]
    """(P,) expected r_1 + gamma r_2 + ... + gamma^(tau-1) r_tau."""
    duration: NDArray[np.float64]
    """(P,) E[tau], infinite where the action may never end."""
    terminal: NDArray[np.bool_]
    """(N,) True for states that end an episode; they have no actions."""
    gamma: float
    law: Law | None = None
    """Where the law of tau comes from, on demand; None if only its discount is known."""

    def __post_init__(self) -> None:
        n, pairs, arcs = len(self.state_names), len(self.action_names), len(self.target)
        if not 0 <= self.gamma < 1:
            raise SettingError(f"gamma must be at least 0 and less than 1, got {self.gamma}")
        for name, start, length, end in (
            ("action_start", self.action_start, n, pairs),
            ("arc_start", self.arc_start, pairs, arcs),
        ):
            if start.shape != (length + 1,) or start[0] != 0 or start[-1] != end or np.any(np.diff(start) < 0):
                raise SettingError(f"{name} must rise from 0 to {end} in {length + 1} entries")
        if np.any(np.diff(self.action_start)[self.terminal] > 0) or np.any(
            np.diff(self.action_start)[~self.terminal] == 0
        ):
            raise SettingError("every state needs an action, but for those that end an episode")
        if np.any((self.target < 0) | (self.target >= n)):
            raise SettingError(f"targets must lie in 0 .. {n - 1}")
        if np.any(self.probability < 0) or np.any(self._sums(self.probability) > 1 + 1e-9):
            raise SettingError("probabilities must not be negative, nor sum to more than 1")
        if np.any(self.discount < 0) or np.any(self.discount > self.gamma * self.probability + 1e-9):
            raise SettingError("E[gamma^tau] lies between 0 and gamma times the probability: an action takes a step")
        if not np.isfinite(self.reward).all():
            raise SettingError("rewards must be finite")

    def __len__(self) -> int:
        return len(self.state_names)

    @cached_property
    def source(self) -> NDArray[np.int64]:
        """(P,) the state of each pair."""
        return np.repeat(np.arange(len(self)), np.diff(self.action_start))

    @cached_property
    def transition(self) -> sparse.csr_array:
        """(P, N) p_ij(a)."""
        return self._matrix(self.probability)

    @cached_property
    def discounted(self) -> sparse.csr_array:
        """(P, N) E[gamma^tau; j]: the p_ij(qa) of equations (7) to (10)."""
        return self._matrix(self.discount)

    def actions(self, state: str) -> tuple[str, ...]:
        """Names of the actions of a state."""
        i = self.state_index(state)
        return self.action_names[self.action_start[i] : self.action_start[i + 1]]

    def state_index(self, name: str) -> int:
        """Index of a state; UnknownNameError when there is none of that name."""
        if name not in self._index:
            raise UnknownNameError(f"no state is called {name!r}; {did_you_mean(name, self._index)}")
        return self._index[name]

    def pair_index(self, state: str, action: str) -> int:
        """Index of a state's action; UnknownNameError when it has none of that name."""
        names = self.actions(state)
        if action not in names:
            raise UnknownNameError(f"{state} has no action {action!r}; {did_you_mean(action, names)}")
        return int(self.action_start[self.state_index(state)]) + names.index(action)

    def arc(self, state: str, action: str, following: str) -> tuple[float, float]:
        """(probability, E[gamma^tau; j]) of an arc; (0, 0) where the action does not lead to that state."""
        pair, j = self.pair_index(state, action), self.state_index(following)
        return float(self.transition[pair, j]), float(self.discounted[pair, j])

    def tau_law(
        self, state: str, action: str, following: str, *, rest: float = LEAST_REST, most: int = MOST_STEPS
    ) -> TauLaw:
        """The law of tau of an arc, computed now, up to where less than ``rest`` is left, or ``most`` steps."""
        if self.law is None:
            raise SettingError("this semi-MDP knows E[gamma^tau] of its arcs, but not the law of tau")
        pair, j = self.pair_index(state, action), self.state_index(following)
        missing = float(self.transition[pair, j])
        taus, found = list[int](), list[float]()
        for tau, (probability, under_way) in enumerate(self.law(pair, j), 1):
            if probability > 0:
                taus.append(tau)
                found.append(probability)
            missing = min(max(missing - probability, 0.0), under_way)
            if missing <= rest or tau >= most:
                break
        return TauLaw(np.array(taus, np.int64), np.array(found), missing)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.state_names)}

    def _matrix(self, weight: NDArray[np.float64]) -> sparse.csr_array:
        return sparse.csr_array((weight, self.target, self.arc_start), shape=(len(self.action_names), len(self)))

    def _sums(self, weight: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P,) sum over the arcs of each pair."""
        return np.asarray(self._matrix(weight).sum(axis=1), np.float64)
