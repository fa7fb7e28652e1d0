"""Exact optimal values by dynamic programming: what every learner is measured against.

S states, A actions.  See ``kernels.bellman`` for the shift that keeps far places apart in float64.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import bellman
from qualrl.models.grid_world import GridWorld
from qualrl.models.tabular_mdp import TabularMDP

World = GridWorld | TabularMDP

TOLERANCE = 1e-12
MAX_SWEEPS = 1_000_000
STATES_A_CALL = 2_000_000


@dataclass(frozen=True, eq=False)
class ExactValues:
    """V* of every state, once plain and once shifted."""

    value: NDArray[np.float64]
    """(S,) optimal value; 0 in terminal states."""
    shifted: NDArray[np.float64]
    """(S,) value + shift, exact to a relative 1e-12 / (1 - gamma) even where ``value`` has no digits left."""
    shift: float
    sweeps: int


def shift_of(world: World) -> float:
    """K = -r_min / (1 - gamma): what must be added to a value to make it at least 0.

    Where no move slips, r_min is the reward of a straight step: nobody has to take the dearer diagonals.
    """
    lowest = min(world.reward_bounds[0], 0.0)
    if isinstance(world, GridWorld) and world.slip == 0:
        lowest = world.step_reward
    return -lowest / (1 - world.gamma)


def exact_values(world: World) -> ExactValues:
    """Optimal values of a world, by Gauss-Seidel value iteration outward from the goal.

    Raises SettingError if the sweeps do not settle (only for gamma extremely near 1).
    """
    shift = shift_of(world)
    if isinstance(world, GridWorld):
        shifted, sweeps = _solve_grid(world, shift)
        value = shifted - shift
        value[world.goal] = 0.0
    else:
        shifted, sweeps = _solve_table(world, shift)
        value = np.where(world.terminal, 0.0, shifted - shift)
    return ExactValues(value, shifted, shift, sweeps)


def _solve_grid(world: GridWorld, shift: float) -> tuple[NDArray[np.float64], int]:
    cut_off = np.flatnonzero(world.steps_to_goal < 0)
    value = np.zeros(len(world))
    value[cut_off] = world.step_reward / (1 - world.gamma) + shift  # straight on for ever
    slides = world.slip > 0 and world.directions == 8  # but where moves may slip to the dearer diagonals
    made = [
        swept(len(order), bellman.solve_grid,
              world.successor, world.move_reward + shift * (1 - world.gamma), world.goal, world.goal_reward + shift,
              world.gamma, world.slip, order, value, TOLERANCE)
        for order in ((world.outward, cut_off) if slides else (world.outward,))
    ]  # fmt: skip
    value[world.goal] = shift
    return value, max(made)


def _solve_table(world: TabularMDP, shift: float) -> tuple[NDArray[np.float64], int]:
    value = np.where(world.terminal, shift, 0.0)
    sweeps = swept(
        len(world), bellman.solve_table,
        world.row_start, world.target, world.probability, world.reward + shift * (1 - world.gamma), world.terminal,
        world.gamma, np.arange(len(world))[::-1].copy(), value, world.n_actions, TOLERANCE,
    )  # fmt: skip
    return value, sweeps


def swept(n_states: int, solver: Callable[..., int], *arguments: Any) -> int:
    """Let a solver sweep till its values settle; returns how often it did.

    A few sweeps a call, so that Ctrl-C is answered within a second.  Raises SettingError if they do not settle.
    """
    most, made = int(np.clip(STATES_A_CALL // max(n_states, 1), 1, 10_000)), 0
    while made < MAX_SWEEPS:
        settled = int(solver(*arguments, most))
        if settled >= 0:
            return made + settled
        made += most
    raise SettingError(f"values did not settle in {MAX_SWEEPS} sweeps; choose a smaller gamma")


def crossings_to_goal(world: GridWorld, exact: ExactValues, region_of: NDArray[np.int32]) -> NDArray[np.int32]:
    """(S,) how often an optimal way to the goal must change region: tells apart ways that are equally good."""
    crossings: NDArray[np.int32] = bellman.fewest_crossings(
        world.successor, world.move_reward + exact.shift * (1 - world.gamma), world.goal,
        world.goal_reward + exact.shift, world.gamma, world.slip, world.outward, exact.shifted, region_of,
    )  # fmt: skip
    return crossings


def action_values(world: World, shifted: NDArray[np.float64], shift: float, state: int) -> NDArray[np.float64]:
    """(A,) shifted Q values of one state, by one backup of shifted state values."""
    q = np.empty(world.n_actions)
    if isinstance(world, GridWorld):
        bellman.grid_backup(
            world.successor, world.move_reward + shift * (1 - world.gamma), world.goal, world.goal_reward + shift,
            world.gamma, world.slip, shifted, state, q,
        )  # fmt: skip
    else:
        bellman.table_backup(
            world.row_start, world.target, world.probability, world.reward + shift * (1 - world.gamma), world.gamma,
            shifted, state, q,
        )  # fmt: skip
    return q
