"""The hybrid MDP exactly as the paper defines it (Definition 3), to be looked at.

N qualitative states QS, S metric states; HS = QS + S, the qualitative ones first, H = N + S.  Q names of qualitative
actions QA, A metric ones; HA = QA + A, M = Q + A.  Matrices are sparse; nothing S x S is ever dense.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from qualrl.errors import SettingError, UnknownNameError, did_you_mean
from qualrl.models.semi_mdp import SemiMDP
from qualrl.models.tabular_mdp import TabularMDP


@dataclass(frozen=True, eq=False)
class HybridDefinition:
    """{HS, HA, P, R, V}: the MDP below, the SMDP above, and nothing across.

    Built by ``HybridMDP.definition``.
    """

    upper: SemiMDP
    """Its qualitative abstraction: QS, QA and their laws."""
    lower: TabularMDP
    """The MDP {S, A(i), p_ij(a), r(i,a)}."""
    lower_names: tuple[str, ...]
    """(S,)"""
    landmark_names: tuple[str, ...]
    landmark_of: NDArray[np.int32]
    """(S,) landmark of each metric state, -1 for none: the landmark states l, which tie QS to S."""

    @cached_property
    def states(self) -> tuple[str, ...]:
        """(H,) HS = QS + S."""
        return self.upper.state_names + self.lower_names

    @cached_property
    def qualitative_actions(self) -> tuple[str, ...]:
        """(Q,) QA, the union over all qualitative states, in order of appearance."""
        return tuple(dict.fromkeys(self.upper.action_names))

    @cached_property
    def actions(self) -> tuple[str, ...]:
        """(M,) HA = QA + A."""
        return self.qualitative_actions + self.lower.action_names

    @cached_property
    def allowed(self) -> sparse.csr_array:
        """(H, M) 1 where an action may be chosen: QA(i) for i in QS, A(i) for i in S (none in terminal states)."""
        n, q = len(self.upper), len(self.qualitative_actions)
        above = sparse.csr_array((np.ones(len(self._action_of)), (self.upper.source, self._action_of)), shape=(n, q))
        below = np.repeat(~self.lower.terminal[:, None], self.lower.n_actions, axis=1).astype(np.float64)
        return sparse.csr_array(sparse.block_diag([above, sparse.csr_array(below)], format="csr"))

    @cached_property
    def rewards(self) -> sparse.csr_array:
        """(H, M) R: r(u,i,qa,j,tau), expected, for i in QS; r(i,a) for i in S; 0 where an action is not allowed."""
        n, q = len(self.upper), len(self.qualitative_actions)
        above = sparse.csr_array((self.upper.reward, (self.upper.source, self._action_of)), shape=(n, q))
        below = np.where(self.lower.terminal[:, None], 0.0, self.lower.expected_reward)
        return sparse.csr_array(sparse.block_diag([above, sparse.csr_array(below)], format="csr"))

    def transition(self, action: str, *, discounted: bool = False) -> sparse.csr_array:
        """(H, H) P of one action: p_ij(qa) inside QS, p_ij(a) inside S, 0 across.

        discounted: E[gamma^tau; j] above and gamma p_ij(a) below, so that one Bellman equation serves both levels.
        The rows of states in which the action is not allowed are empty.
        """
        n, s = len(self.upper), len(self.lower)
        if action in self.qualitative_actions:
            chosen = np.flatnonzero(self._action_of == self.qualitative_actions.index(action))
            of = (self.upper.discounted if discounted else self.upper.transition)[chosen]
            place = sparse.csr_array(
                (np.ones(len(chosen)), (self.upper.source[chosen], np.arange(len(chosen)))), shape=(n, len(chosen))
            )
            above, below = sparse.csr_array(place @ of), sparse.csr_array((s, s))
        elif action in self.lower.action_names:
            going = np.flatnonzero(~self.lower.terminal)
            kept = sparse.csr_array((np.ones(len(going)), (going, going)), shape=(s, s))
            weight = self.lower.gamma if discounted else 1.0
            above, below = sparse.csr_array((n, n)), sparse.csr_array(kept @ self.lower.transition(action) * weight)
        else:
            raise UnknownNameError(f"no action is called {action!r}; {did_you_mean(action, self.actions)}")
        return sparse.csr_array(sparse.block_diag([above, below], format="csr"))

    def reward(self, action: str) -> NDArray[np.float64]:
        """(H,) one column of ``rewards``."""
        if action not in self.actions:
            raise UnknownNameError(f"no action is called {action!r}; {did_you_mean(action, self.actions)}")
        return self.rewards[:, [self.actions.index(action)]].toarray().ravel()

    def policy(self, pi: NDArray[np.integer], q_pi: NDArray[np.integer]) -> sparse.csr_array:
        """(H, M) H_pi = pi + Q_pi: 1 where the policy chooses an action.

        pi (S,): the metric action of each metric state; q_pi (N,): the pair of the SMDP that each qualitative state
        chooses, as ``solving.semi_mdp_values`` gives it.  Terminal states choose nothing.
        """
        n, s = len(self.upper), len(self.lower)
        if pi.shape != (s,) or q_pi.shape != (n,):
            raise SettingError(f"pi needs {s} actions and q_pi {n}, got {pi.shape} and {q_pi.shape}")
        up, down = np.flatnonzero(~self.upper.terminal), np.flatnonzero(~self.lower.terminal)
        if np.any(self.upper.source[q_pi[up]] != up) or np.any((pi[down] < 0) | (pi[down] >= self.lower.n_actions)):
            raise SettingError("a policy chooses an action that its state does not have")
        rows = np.concatenate([up, n + down])
        columns = np.concatenate([self._action_of[q_pi[up]], len(self.qualitative_actions) + pi[down]])
        return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n + s, len(self.actions)))

    @cached_property
    def _action_of(self) -> NDArray[np.int64]:
        """(P,) index among QA of each pair's action."""
        number = {name: i for i, name in enumerate(self.qualitative_actions)}
        return np.array([number[name] for name in self.upper.action_names], np.int64)
