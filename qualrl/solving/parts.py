"""One part of a world (a region, a wing) on its own: its best way out by one exit, and the Markov chain of that way.

n states of the part, A actions, e outcomes, m states that the chain reaches, N macro states (see ``solving.fold``).
Rewards and values are shifted: see ``kernels.bellman``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from qualrl.kernels import bellman
from qualrl.models.grid_world import GridWorld
from qualrl.solving.crossings import Crossings
from qualrl.solving.exact import FLOOR, TOLERANCE, ExactValues, World, shifted_rewards, swept

Policy = NDArray[np.int16]
"""(n,) action in each state of a part."""


@dataclass(frozen=True, eq=False)
class Chain:
    """The Markov chain of a policy inside a part, as far as it is reached from some states."""

    inside: sparse.csr_array
    """(m, m) P_in: steps that stay in the part."""
    out: sparse.csr_array
    """(m, N) P_out: steps into a macro state."""
    reward: NDArray[np.float64]
    """(m,) expected shifted reward of a step."""
    at: NDArray[np.int64]
    """Rows of the states that it was reached from."""


class Part:
    """The states of one part that do not end an episode, with all outcomes of their actions."""

    def __init__(self, world: World, crossings: Crossings, part: int, exact: ExactValues) -> None:
        members = np.flatnonzero(crossings.level.part_of == part)
        over = terminals(world)
        self.world = world
        self.inside = members[~over[members]]
        self.row_start, self.target, self.probability, reward = _outcomes(world, self.inside)
        self.reward = shifted_rewards(reward, exact.shift, world.gamma)
        position = np.minimum(np.searchsorted(self.inside, self.target), len(self.inside) - 1)
        stays = self.inside[position] == self.target
        self.local = np.where(stays, position, len(self.inside)).astype(np.uint32)
        states = np.repeat(np.arange(len(self.inside)), np.diff(self.row_start[:: world.n_actions]))
        self.source = states
        exits = crossings.exit_at(self.inside[states], self.target)
        self.goal_exit = len(crossings.exit_names)
        self.exit_of = np.where(~stays & (exits < 0), self.goal_exit, exits)
        """(e,) exit that an outcome leaves by, -1 where it stays; ``goal_exit`` if it ends the episode in the part."""
        self.beyond = world.gamma * exact.shifted[self.target]
        for array in (self.row_start, self.local, self.probability):
            array.setflags(write=False)

    @property
    def ends_here(self) -> bool:
        """Whether some step ends the episode within the part."""
        return bool(np.any(self.exit_of == self.goal_exit))

    def policy_for(self, exit_index: int) -> Policy:
        """The policy that leaves by an exit best: greatest rewards on the way and exact value of the state beyond.

        Leaving by any other exit counts as the worst there is, never to arrive: a shifted value of 0.
        """
        n, gamma = len(self.inside), self.world.gamma
        reward = self.reward + np.where(self.exit_of == exit_index, self.beyond, 0.0)
        terminal = np.zeros(n + 1, np.bool_)
        terminal[n] = True
        terminal.setflags(write=False)
        value = np.zeros(n + 1)
        swept(
            n, bellman.solve_table,
            self.row_start, self.local, self.probability, reward, terminal, gamma, self._outward(exit_index), value,
            self.world.n_actions, TOLERANCE, FLOOR,
        )  # fmt: skip
        q = np.add.reduceat(self.probability * (reward + gamma * value[self.local]), self.row_start[:-1])
        found: Policy = q.reshape(n, -1).argmax(axis=1).astype(np.int16)
        return found

    def _outward(self, exit_index: int) -> NDArray[np.int64]:
        """All states of the part, those from which an exit is near first."""
        n = len(self.inside)
        stays, leaves = self.local < n, self.exit_of == exit_index
        ends = np.concatenate([self.local[stays], np.full(leaves.sum(), n, np.uint32)])
        starts = np.concatenate([self.source[stays], self.source[leaves]])
        backwards = sparse.csr_array((np.ones(len(ends)), (ends, starts)), shape=(n + 1, n + 1))
        near: NDArray[np.int64] = breadth_first_order(backwards, n, return_predecessors=False)[1:].astype(np.int64)
        seen = np.zeros(n, np.bool_)
        seen[near] = True
        return np.concatenate([near, np.flatnonzero(~seen)])

    def chain(self, policy: Policy, starts: NDArray[np.int64], macro_of: NDArray[np.int32], macros: int) -> Chain:
        """The chain of a policy from some states of the part.  macro_of (S,): the macro state of each state."""
        n = len(self.inside)
        rows = np.arange(n) * self.world.n_actions + policy
        counts = np.diff(self.row_start)[rows]
        entries = np.repeat(self.row_start[rows] - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
        states, p = np.repeat(np.arange(n), counts), self.probability[entries]
        stays = self.local[entries] < n
        inside = sparse.csr_array((p[stays], (states[stays], self.local[entries][stays])), shape=(n, n))
        beyond = macro_of[self.target[entries[~stays]]]
        out = sparse.csr_array((p[~stays], (states[~stays], beyond)), shape=(n, macros))
        reward = np.bincount(states, p * self.reward[entries], minlength=n).astype(np.float64)
        first = np.searchsorted(self.inside, starts)
        reached = reached_from(inside, first)
        return Chain(inside[reached][:, reached], out[reached], reward[reached], np.searchsorted(reached, first))


def reached_from(steps: sparse.csr_array, starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The states to which positive entries lead from some states, these included, in rising order."""
    n = steps.shape[0]
    first = sparse.csr_array((np.ones(len(starts)), (np.zeros(len(starts), np.int64), starts)), shape=(1, n))
    whole = sparse.vstack([steps, first], format="csr")
    whole.resize((n + 1, n + 1))
    found = breadth_first_order(whole, n, return_predecessors=False)[1:]
    return np.sort(found).astype(np.int64)


def terminals(world: World) -> NDArray[np.bool_]:
    """(S,) True for states that end an episode."""
    if not isinstance(world, GridWorld):
        return world.terminal
    over = np.zeros(len(world), np.bool_)
    over[world.goal] = True
    return over


Outcomes = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]


def _outcomes(world: World, states: NDArray[np.int64]) -> Outcomes:
    """(row_start, target, probability, reward) of some states: the rows that a whole table would hold for them."""
    n, n_actions = len(states), world.n_actions
    if not isinstance(world, GridWorld):
        rows = (states[:, None] * n_actions + np.arange(n_actions)).ravel()
        counts = np.diff(world.row_start)[rows]
        ends = np.cumsum(counts)
        entries = np.repeat(world.row_start[rows] - ends + counts, counts) + np.arange(counts.sum())
        start = np.concatenate([[0], ends]).astype(np.int64)
        possible = world.probability[entries] > 0
        reward = np.where(possible, world.reward[entries], 0.0)
        own = np.repeat(np.repeat(states, n_actions), counts)  # what cannot happen must not look like a way out
        target = np.where(possible, world.target[entries].astype(np.int64), own)
        return start, target, world.probability[entries], reward
    likely = np.full((n_actions, n_actions), world.slip / (n_actions - 1))
    np.fill_diagonal(likely, 1.0 - world.slip)
    moves = np.nonzero(likely > 0)[1].reshape(n_actions, -1)
    target = world.successor[states].astype(np.int64)[:, moves]
    reward = np.where(target == world.goal, world.goal_reward, world.move_reward[moves])
    start = np.arange(n * n_actions + 1, dtype=np.int64) * moves.shape[1]
    return start, target.ravel(), np.tile(likely[likely > 0], n), reward.ravel()
