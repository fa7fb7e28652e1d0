"""Coarser abstractions of a folded world: macro states lumped into one, and what is lost by it.

N macro states, G groups, P pairs, K pairs of a group and one of its actions.  Every state of a group must have the same
actions in the same order, as the states of one part have.  Lumping is exact (strong lumpability) where all members of
a group have the same discounts into each group and the same reward, for each action.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from qualrl.models.semi_mdp import SemiMDP
from qualrl.solving.semi_mdp_values import BETTER, semi_values

ALIKE = 1e-9
"""Discounts and rewards that differ by less, relatively, are the same: rounding leaves 1e-12 or so."""
MOST_SWEEPS = 20_000


@dataclass(frozen=True, eq=False)
class Lumping:
    """A semi-MDP, and groups of its states."""

    smdp: SemiMDP
    shifted_reward: NDArray[np.float64]
    """(P,)"""
    terminal_value: float
    group: NDArray[np.int64]
    """(N,) group of each state, -1 for a state that is left out (no action may lead there)."""
    names: tuple[str, ...]
    """(G,)"""

    @property
    def used(self) -> NDArray[np.int64]:
        """Pairs whose state is in a group."""
        return np.flatnonzero(self.group[self.smdp.source] >= 0)

    @property
    def keys(self) -> NDArray[np.int64]:
        """Of each used pair, the pair of its group and action: 0 .. K - 1, by group, then action."""
        owner = self.smdp.source[self.used]
        ordinal = self.used - self.smdp.action_start[owner]
        rank = self.group[owner] * (int(ordinal.max(initial=0)) + 1) + ordinal
        return np.unique(rank, return_inverse=True)[1].ravel()

    def into_groups(self, matrix: sparse.csr_array) -> sparse.csr_array:
        """The used rows of a (P, N) matrix, its columns summed by group."""
        inside = np.flatnonzero(self.group >= 0)
        ones = np.ones(len(inside))
        member = sparse.csr_array((ones, (inside, self.group[inside])), shape=(len(self.smdp), len(self.names)))
        return sparse.csr_array(matrix[self.used] @ member)

    def averaged(self) -> tuple[SemiMDP, NDArray[np.float64]]:
        """The semi-MDP over groups whose members all count alike, and its shifted rewards."""
        keys = self.keys
        share = 1.0 / np.bincount(keys)[keys]
        return self._mixed(
            sparse.csr_array((share, (keys, np.arange(len(keys)))), shape=(keys.max(initial=-1) + 1, len(keys)))
        )

    def values(self) -> NDArray[np.float64]:
        """(G,) optimal shifted values when the members of a group all count alike."""
        smdp, reward = self.averaged()
        return semi_values(smdp, reward, self.terminal_value).value

    def greatest_values(self) -> NDArray[np.float64]:
        """(G,) as if the robot always entered where that is best: no weighing of the members gives more."""
        order = np.argsort(self.keys, kind="stable")
        smdp, reward = self._mixed(sparse.csr_array(sparse.eye_array(len(order), format="csr")[order]))
        return semi_values(smdp, reward, self.terminal_value).value

    def least_values(self) -> NDArray[np.float64]:
        """(G,) as if it always entered where that is worst for what it will do: no weighing gives less.

        By sweeps from below, so that it is a bound even if they have not settled.
        """
        keys, matrix, reward = self.keys, self.into_groups(self.smdp.discounted), self.shifted_reward[self.used]
        owner = np.zeros(keys.max(initial=-1) + 1, np.int64)
        owner[keys] = self.group[self.smdp.source[self.used]]
        ended = np.unique(self.group[self.smdp.terminal])
        value = np.full(len(self.names), min(0.0, float(reward.min(initial=0.0))) / (1 - self.smdp.gamma))
        for _ in range(MOST_SWEEPS):
            value[ended] = self.terminal_value
            worst = np.full(len(owner), np.inf)
            np.minimum.at(worst, keys, reward + matrix @ value)
            new = np.full(len(value), -np.inf)
            np.maximum.at(new, owner, worst)
            new[ended] = self.terminal_value
            settled = np.abs(new - value).max() <= BETTER * np.abs(new).max()
            value = new
            if settled:
                break
        return value

    def is_exact(self) -> NDArray[np.bool_]:
        """(K,) whether all members of a group have the same discounts and reward for an action."""
        keys, matrix, reward = self.keys, self.into_groups(self.smdp.discounted), self.shifted_reward[self.used]
        first = np.unique(keys, return_index=True)[1][keys]
        apart = np.asarray(abs(matrix - matrix[first]).max(axis=1).todense()).ravel()
        scale = np.zeros(keys.max(initial=-1) + 1)
        np.maximum.at(scale, keys, np.asarray(matrix.sum(axis=1)).ravel())
        reward_scale = np.zeros_like(scale)
        np.maximum.at(reward_scale, keys, np.abs(reward))
        same = (apart <= ALIKE * scale[keys]) & (np.abs(reward - reward[first]) <= ALIKE * reward_scale[keys])
        found = np.ones(len(scale), np.bool_)
        np.logical_and.at(found, keys, same)
        return found

    def _mixed(self, mix: sparse.csr_array) -> tuple[SemiMDP, NDArray[np.float64]]:
        """The semi-MDP over groups whose rows are mixtures of the members'.  mix (rows, used pairs), by group."""
        discount, probability = (
            sparse.csr_array(mix @ self.into_groups(of)) for of in (self.smdp.discounted, self.smdp.transition)
        )
        arcs = sparse.csr_array(probability + 1j * discount)  # both at once, so that they have the same arcs
        arcs.sort_indices()
        first = self.used[mix.indices[mix.indptr[:-1]]]
        owner = self.group[self.smdp.source[first]]
        terminal = np.zeros(len(self.names), np.bool_)
        terminal[self.group[self.smdp.terminal]] = True
        smdp = SemiMDP(
            state_names=self.names,
            action_names=tuple(self.smdp.action_names[pair] for pair in first.tolist()),
            action_start=np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(self.names)))]).astype(
                np.int64
            ),
            arc_start=arcs.indptr.astype(np.int64),
            target=arcs.indices.astype(np.int64),
            probability=np.minimum(arcs.data.real, 1.0),
            discount=arcs.data.imag.copy(),
            reward=np.asarray(mix @ self.smdp.reward[self.used]),
            duration=np.asarray(mix @ self.smdp.duration[self.used]),
            terminal=terminal,
            gamma=self.smdp.gamma,
        )
        return smdp, np.asarray(mix @ self.shifted_reward[self.used])
