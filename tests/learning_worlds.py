"""Worlds that compiled learners and their textbook twins both take, and hypothesis strategies for random tables."""

import numba
import numpy as np
from hypothesis import strategies as st

from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP
from tests import oracles
from tests.oracles_learning import DenseMDP
from tests.worlds import PUZZLE, grid_of


def from_python(part):
    """A part of a compiled loop, which has no way in from Python, with one."""
    return numba.njit(part.py_func)


def rooms(text: str = PUZZLE, goal=(6, 6), start=(11, 1), slip=0.0, gamma=0.9, directions=4) -> HybridMDP:
    """A hybrid model of a drawn map with its natural regions."""
    import qualrl

    return qualrl.build(
        qualrl.segment(grid_of(text)), list(goal), start=None if start is None else list(start), gamma=gamma, slip=slip,
        directions=directions,
    )  # fmt: skip


class World:
    """A model's world as the twins want it, from the model's own arrays by plain look-up."""

    def __init__(self, model: HybridMDP):
        self.model, world = model, model.world
        self.n_states, self.n_actions = len(world), world.n_actions
        self.starts = model.starts.tolist()
        if isinstance(world, GridWorld):
            self.twin = oracles.GridTwin(
                world.free, world.goal_cell, world.directions, world.slip, world.step_reward, world.goal_reward
            )
            self.step, self.terminal = self.step_on_grid, lambda s: s == world.goal
            self.lands = [[self.twin.cells.index(self.twin.lands(cell, m)) for m in range(self.n_actions)]
                          for cell in self.twin.cells]  # fmt: skip
        else:
            self.step, self.terminal = self.step_in_table, lambda s: bool(world.terminal[s])

    def step_on_grid(self, s, a, draws):
        world, moved, outcome = self.model.world, a, s * self.n_actions + a
        if world.slip:
            x = (next(draws) >> 11) / 2**53
            if x < world.slip:
                moved = (a + 1 + min(int(x / world.slip * (self.n_actions - 1)), self.n_actions - 2)) % self.n_actions
            outcome = outcome * self.n_actions + moved
        s2 = self.lands[s][moved]
        length = 1.0 if moved < 4 else 2**0.5
        return s2, world.goal_reward if s2 == world.goal else world.step_reward * length, outcome

    def step_in_table(self, s, a, draws):
        world, row = self.model.world, s * self.n_actions + a
        x, last = (next(draws) >> 11) / 2**53, world.row_start[row + 1] - 1
        for entry in range(world.row_start[row], last + 1):
            if x < world.cumulative[entry] or entry == last:
                return int(world.target[entry]), float(world.reward[entry]), entry
        raise AssertionError

    def outcomes(self, s, a):
        """[(probability, next state, reward, number)] of an action, in the order of their numbers."""
        world, row = self.model.world, s * self.n_actions + a
        if isinstance(world, GridWorld):
            found = [(p, self.twin.cells.index(cell), reward) for p, cell, reward in
                     self.twin.outcomes(self.twin.cells[s], a)]  # fmt: skip
            if not world.slip:
                return [(1.0, *found[a][1:], row)]
            return [(*one, row * self.n_actions + moved) for moved, one in enumerate(found)]
        return [
            (float(world.probability[e]), int(world.target[e]), float(world.reward[e]), e)
            for e in range(int(world.row_start[row]), int(world.row_start[row + 1]))
        ]

    def before(self):
        """{next state: [(s, a, outcome)]} in the order of the outcomes' numbers."""
        found = {}
        for s in range(self.n_states):
            for a in range(self.n_actions):
                for _, s2, _, number in self.outcomes(s, a):
                    if not self.terminal(s):
                        found.setdefault(s2, []).append((s, a, number))
        return found

    def dense(self) -> DenseMDP:
        return DenseMDP.of_outcomes(
            self.n_states, self.n_actions, lambda s, a: [one[:3] for one in self.outcomes(s, a)], self.terminal,
            self.model.gamma,
        )  # fmt: skip


def random_table(seed: int, n_states=12, n_actions=3, gamma=0.9, terminals=2, most_outcomes=3, positive=0.2):
    """A table with real-valued rewards, some positive on the way, several terminal rewards, self loops, dead ends."""
    chance = np.random.default_rng(seed)
    rows = {}
    for s in range(n_states):
        rows[s] = {}
        for a in range(n_actions):
            n = int(chance.integers(1, most_outcomes + 1))
            targets = chance.choice(n_states, n, replace=False)
            if chance.random() < 0.1:
                targets[0] = s
            targets = np.unique(targets)
            shares = chance.dirichlet(np.ones(len(targets)))
            rows[s][a] = [
                (
                    float(p),
                    int(t),
                    float(
                        chance.normal(5, 5)
                        if t >= n_states - terminals
                        else chance.uniform(0, 2)
                        if chance.random() < positive
                        else -chance.uniform(0, 2)
                    ),
                    bool(t >= n_states - terminals),
                )
                for p, t in zip(shares, targets, strict=True)
            ]
    rows[0][0] = [(1.0, n_states - 1, float(chance.normal()), True)]  # some way leads to the end
    return TabularMDP.from_outcomes(rows, gamma)


def table_model(table: TabularMDP, parts=3, start=0) -> HybridMDP:
    """A hybrid model of a table; its regions are the remainders of the states' numbers."""
    return HybridMDP.from_table(table, [f"part {s % parts}" for s in range(len(table))], start)


@st.composite
def table_models(draw, most_outcomes=3, gamma=None):
    """Random small tables, whose first state can reach an end."""
    table = random_table(
        draw(st.integers(0, 2**32)), draw(st.integers(4, 14)), draw(st.integers(1, 4)),
        draw(st.sampled_from([0.5, 0.9, 0.95])) if gamma is None else gamma, draw(st.integers(1, 3)), most_outcomes,
        draw(st.sampled_from([0.0, 0.3])),
    )  # fmt: skip
    return table_model(table, draw(st.integers(1, 4)), 0)
