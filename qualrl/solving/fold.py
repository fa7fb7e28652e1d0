"""Folding an MDP into a semi-MDP (paper, Theorem 1), exactly, one part of the world after the other.

A macro state is a state by which a part (a region, a wing) is entered, or the start, or the goal; N of them.  A
qualitative action leaves the part by one exit, by the policy that does so best (``Part.policy_for``).  Within a part
the policy is a Markov chain, and with P_in its steps inside, P_out those that leave:
F = (I - gamma P_in)^-1 gamma P_out = E[gamma^tau; j], rho = (I - gamma P_in)^-1 r, P = (I - P_in)^-1 P_out.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import GOAL, HybridMDP
from qualrl.models.levels import QualitativeLevel
from qualrl.models.semi_mdp import SemiMDP
from qualrl.solving.crossings import TO_GOAL, Crossings, crossings
from qualrl.solving.exact import ExactValues, exact_values
from qualrl.solving.parts import Chain, Part, Policy, reached_from, terminals
from qualrl.solving.semi_mdp_values import SemiValues, semi_values

COLUMNS = 64
"""So many right-hand sides are solved at once: bounds the memory."""
STAY = "stay"
NOWHERE = -2
"""The exit of a part that has none: its one action is to stay for ever."""


@dataclass(frozen=True, eq=False)
class Ways:
    """How the qualitative actions are carried out: what each pair of the semi-MDP stands for."""

    state: NDArray[np.int64]
    """(N,) state of the world of each macro state; -1 for the goal, the last one, which stands for all terminals."""
    part: NDArray[np.int64]
    """(N,) part it lies in; -1 for the goal."""
    entry: NDArray[np.int64]
    """(N,) exit by which the part was entered; -1 for a start that is no such state, and the goal."""
    macro_of: NDArray[np.int32]
    """(S,) macro state of each state, -1 for most."""
    parts: dict[int, Part] = field(default_factory=dict, repr=False)
    policies: dict[tuple[int, int], Policy] = field(default_factory=dict, repr=False)
    """By part and exit."""
    exit_of_pair: list[int] = field(default_factory=list, repr=False)
    """(P,) the exit that a qualitative action leaves by."""
    owner: list[int] = field(default_factory=list, repr=False)
    """(P,) the macro state whose action it is."""

    def chain_of(self, part: int, way: int, states: NDArray[np.int64]) -> Chain:
        """The chain of a qualitative action from some states of a part."""
        return self.parts[part].chain(self.policies[part, way], states, self.macro_of, len(self.state))

    def law(self, pair: int, following: int) -> Iterator[tuple[float, float]]:
        """P(j, tau) for tau = 1, 2, ... of a pair, by powers of its chain, with what is still inside."""
        macro = self.owner[pair]
        chain = self.chain_of(int(self.part[macro]), self.exit_of_pair[pair], self.state[[macro]])
        backwards = sparse.csr_array(chain.inside.T)
        leaving = chain.out[:, [following]].toarray().ravel()
        here = np.zeros(chain.inside.shape[0])
        here[chain.at] = 1.0
        while True:
            arrived = float(leaving @ here)
            here = backwards @ here
            yield arrived, float(here.sum())


@dataclass(frozen=True, eq=False)
class Fold:
    """A model, and the semi-MDP over the states by which its parts are entered."""

    model: HybridMDP
    crossings: Crossings
    smdp: SemiMDP
    exact: ExactValues
    """The flat optimum, whose values beyond an exit decide which way there is the best."""
    shifted_reward: NDArray[np.float64]
    """(P,) rewards that make values shifted ones, as ``exact.shifted``."""
    ways: Ways

    def solve(self) -> SemiValues:
        """Optimal (shifted) values of the semi-MDP, equation (10)."""
        return semi_values(self.smdp, self.shifted_reward, self.exact.shift)


def fold(model: HybridMDP, level: QualitativeLevel | None = None, start: int | None = None) -> Fold:
    """Fold a level of a model (by default the regions) exactly.  start: a state to make a macro state as well.

    Raises NoPlanError when no way leads from that start to the goal.
    """
    if start is None:
        start = model.start
    if start is not None:
        model.check_reachable(start)
    exact = exact_values(model.world)
    steps = crossings(model, level)
    ways = _ways(model, steps, start)
    blocks, names = list[_Block](), list[str]()
    for part in np.unique(ways.part[:-1]).tolist():
        block, of_each = _fold_part(Part(model.world, steps, part, exact), part, ways, steps, model.gamma)
        blocks.append(block)
        names += of_each
    smdp, shifted_reward = _semi_mdp(model, steps, ways, blocks, names, exact.shift)
    return Fold(model, steps, smdp, exact, shifted_reward, ways)


def _fold_part(part: Part, number: int, ways: Ways, steps: Crossings, gamma: float) -> tuple["_Block", list[str]]:
    """All pairs of one part, and the names of their actions; ``ways`` is told of them."""
    macros = np.flatnonzero(ways.part == number)
    exits = steps.exits_from(number) + ([part.goal_exit] if part.ends_here else [])
    exits = exits or [NOWHERE]
    ways.parts[number] = part
    folded = list[_Block]()
    for way in exits:
        ways.policies[number, way] = part.policy_for(way)
        folded.append(_folded(ways.chain_of(number, way, ways.state[macros]), gamma))
    ways.exit_of_pair.extend(exits * len(macros))
    ways.owner.extend(np.repeat(macros, len(exits)).tolist())
    return _Block.interleaved(folded), [_action_name(steps, number, way) for way in exits] * len(macros)


def _ways(model: HybridMDP, steps: Crossings, start: int | None) -> Ways:
    """The macro states, part by part and door by door, the goal last; no actions yet."""
    state, entry = steps.entries, steps.entered_by.astype(np.int64)
    over = terminals(model.world)
    state, entry = state[~over[state]], entry[~over[state]]
    if start is not None and start not in state and not over[start]:
        state, entry = np.append(state, start), np.append(entry, -1)
    order = np.lexsort((state, entry, steps.level.part_of[state]))
    state, entry = np.append(state[order], -1).astype(np.int64), np.append(entry[order], -1).astype(np.int64)
    macro_of = np.full(len(model), -1, np.int32)
    macro_of[state[:-1]] = np.arange(len(state) - 1)
    macro_of[over] = len(state) - 1
    part = np.append(steps.level.part_of[state[:-1]], -1).astype(np.int64)
    return Ways(state, part, entry, macro_of)


@dataclass(frozen=True, eq=False)
class _Block:
    """Rows of the semi-MDP: for each state of a part, one for each of its actions."""

    discount: sparse.csr_array
    probability: sparse.csr_array
    reward: NDArray[np.float64]
    duration: NDArray[np.float64]

    @classmethod
    def interleaved(cls, blocks: list["_Block"]) -> "_Block":
        """Blocks of one action each, put together so that the actions of a state stand side by side."""
        order = np.arange(len(blocks) * len(blocks[0].reward)).reshape(len(blocks), -1).T.ravel()
        return cls(
            sparse.csr_array(sparse.vstack([block.discount for block in blocks], format="csr")[order]),
            sparse.csr_array(sparse.vstack([block.probability for block in blocks], format="csr")[order]),
            np.concatenate([block.reward for block in blocks])[order],
            np.concatenate([block.duration for block in blocks])[order],
        )


def _folded(chain: Chain, gamma: float) -> _Block:
    """F, P, rho and E[tau] of a chain, from the states that it was reached from."""
    m = chain.inside.shape[0]
    solver = factorised(chain.inside * gamma)
    discount = _solved_at(solver, chain.out * gamma, chain.at)
    ends = reached_from(sparse.csr_array(chain.inside.T), np.unique(chain.out.nonzero()[0]))
    probability, duration = sparse.csr_array(discount.shape), np.full(len(chain.at), np.inf)
    if len(ends):
        position = np.full(m, -1)
        position[ends] = np.arange(len(ends))
        may_stay = np.zeros(m, np.bool_)
        if len(ends) < m:
            may_stay[reached_from(sparse.csr_array(chain.inside.T), np.flatnonzero(position < 0))] = True
        undiscounted = factorised(chain.inside[ends][:, ends])
        leaving = np.flatnonzero(position[chain.at] >= 0)
        at = position[chain.at[leaving]]
        some = _solved_at(undiscounted, chain.out[ends], at)
        back = sparse.csr_array(
            (np.ones(len(leaving)), (leaving, np.arange(len(leaving)))), (len(chain.at), len(leaving))
        )
        probability = sparse.csr_array(back @ some)
        steps = undiscounted.solve(np.ones(len(ends)))
        duration[leaving] = np.where(may_stay[chain.at[leaving]], np.inf, steps[at])
    return _Block(discount, probability, solver.solve(chain.reward)[chain.at], duration)


def factorised(inside: sparse.csr_array) -> SuperLU:
    """The sparse LU factors of I - inside."""
    matrix = sparse.csc_array(sparse.eye_array(inside.shape[0], format="csc") - sparse.csc_array(inside))
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)


def _solved_at(solver: SuperLU, out: sparse.csr_array, at: NDArray[np.int64]) -> sparse.csr_array:
    """Rows ``at`` of (I - inside)^-1 out: only the columns that are not empty, some at a time."""
    columns = np.unique(out.indices)
    narrow = sparse.csc_array(out[:, columns])
    rows = np.empty((len(at), len(columns)))
    for first in range(0, len(columns), COLUMNS):
        some = slice(first, first + COLUMNS)
        rows[:, some] = solver.solve(narrow[:, some].toarray())[at]
    found = sparse.coo_array(np.maximum(rows, 0.0))
    return sparse.csr_array((found.data, (found.row, columns[found.col])), shape=(len(at), out.shape[1]))


def _semi_mdp(
    model: HybridMDP, steps: Crossings, ways: Ways, blocks: list[_Block], names: list[str], shift: float
) -> tuple[SemiMDP, NDArray[np.float64]]:
    """The semi-MDP of all parts' rows, and its shifted rewards."""
    n = len(ways.state)
    # both at once, so that they have the same arcs: a discount may fade to 0 where the probability does not
    both = [sparse.csr_array(block.probability + 1j * block.discount) for block in blocks]
    arcs = sparse.csr_array(sparse.vstack([sparse.csr_array((0, n), dtype=np.complex128), *both], format="csr"))
    arcs.sort_indices()
    shifted = np.concatenate([np.zeros(0), *(block.reward for block in blocks)])
    total = np.asarray(arcs.sum(axis=1)).ravel().imag
    smdp = SemiMDP(
        state_names=tuple(_state_names(model, steps, ways)),
        action_names=tuple(names),
        action_start=np.concatenate([[0], np.cumsum(np.bincount(ways.owner, minlength=n))]).astype(np.int64),
        arc_start=arcs.indptr.astype(np.int64),
        target=arcs.indices.astype(np.int64),
        probability=np.minimum(arcs.data.real, 1.0),
        discount=arcs.data.imag.copy(),
        reward=shifted - shift * (1 - total),
        duration=np.concatenate([np.zeros(0), *(block.duration for block in blocks)]),
        terminal=np.arange(n) == n - 1,
        gamma=model.gamma,
        law=ways.law,
    )
    return smdp, shifted


def _state_names(model: HybridMDP, steps: Crossings, ways: Ways) -> Iterator[str]:
    """Names such as "corridor 1 entered by door 1 at row 70, column 44"."""
    for s, part, x in zip(ways.state[:-1].tolist(), ways.part[:-1].tolist(), ways.entry[:-1].tolist(), strict=True):
        by = f" entered by {steps.exit_names[x]}" if x >= 0 else ", the start"
        yield f"{steps.level.names[part]}{by} at {place_of(model, s)}"
    yield GOAL


def place_of(model: HybridMDP, state: int) -> str:
    """A state within its region: its cell, or its name or number."""
    if isinstance(model.world, GridWorld):
        row, column = model.cell_of(state)
        return f"row {row}, column {column}"
    names = model.world.state_names
    return names[state] if names else f"state {state}"


def _action_name(steps: Crossings, part: int, way: int) -> str:
    if way == NOWHERE:
        return STAY
    return TO_GOAL if way == len(steps.exit_names) else steps.action_name(part, way)
