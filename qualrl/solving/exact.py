"""Exact optimal values by dynamic programming: what every learner is measured against.

S states, A actions.  See ``kernels.bellman`` for the shift that keeps far places apart in float64.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import bellman
from qualrl.models.grid_world import GridWorld
from qualrl.models.tabular_mdp import TabularMDP

World = GridWorld | TabularMDP
Values = TypeVar("Values", float, NDArray[np.float64])

TOLERANCE = 1e-12
NOTHING = 1e-12
"""A shifted reward below this share of what was added is 0."""
OFF = 1e-12
"""Share by which a shifted value may be off that is summed up along a way."""
FLOOR = 1e-300
"""Smaller values, where float64 has fewer digits, settle no better than this one."""
MAX_SWEEPS = 1_000_000
STATES_A_CALL = 2_000_000
LEAST_RELAXATION = 1.2
"""Nearer 1 it costs more than it saves."""


@dataclass(frozen=True, eq=False)
class ExactValues:
    """V* of every state, once plain and once shifted."""

    value: NDArray[np.float64]
    """(S,) optimal value; 0 in terminal states."""
    shifted: NDArray[np.float64]
    """(S,) value + shift, within a relative 1e-12 of its own backup even where ``value`` has no digits left."""
    shift: float


def shift_of(world: World) -> float:
    """K = -r_min / (1 - gamma): what must be added to a value to make it at least 0.

    Where no move slips, r_min is the reward of a straight step: nobody has to take the dearer diagonals.
    """
    lowest = min(world.reward_bounds[0], 0.0)
    if isinstance(world, GridWorld) and world.slip == 0:
        lowest = world.step_reward
    return -lowest / (1 - world.gamma)


def shifted_rewards(rewards: NDArray[np.float64], shift: float, gamma: float) -> NDArray[np.float64]:
    """Rewards such that values are ``shift`` larger.  What is worth 0 does not grow out of a rounding error."""
    added = shift * (1 - gamma)
    found = rewards + added
    return np.where(np.abs(found) <= NOTHING * added, 0.0, found)


def exact_values(world: World, error: float | None = None) -> ExactValues:
    """Optimal values of a world, by Gauss-Seidel value iteration outward from the goal.

    error: no value may be off by more; by default, and at most, values settle to a relative 1e-12 of their backups.
    Given an error, places so far away that it hides their value may all be worth the same.
    Raises SettingError for an error that is not above 0, and if the sweeps do not settle (only for gamma extremely
    near 1).
    """
    shift = shift_of(world)
    floor = _floor(world, shift, error)
    if isinstance(world, GridWorld):
        shifted = _solve_grid(world, shift, floor)
        value = shifted - shift
        value[world.goal] = 0.0
    else:
        shifted = _solve_table(world, shift, floor)
        value = np.where(world.terminal, 0.0, shifted - shift)
    return ExactValues(value, shifted, shift)


def error_at(world: GridWorld, shifted: Values, shift: float) -> Values:
    """By how much settled shifted values may be off at most, and those built on settled values, too.

    No value settles further than 1e-12 of itself from its backup, so each is off by at most so much of the values met
    on the way, discounted and added up.  Where steps pay nothing once shifted, these are all that the goal is worth,
    with P = E[gamma ** T] = gamma value / goal: the value itself times the steps to the goal, weighted by gamma ** T.
    Of those there are at most log P / log gamma, for log P is convex in log gamma.  Else no value is larger than the
    largest, and (1 - P) / (1 - gamma) steps are left, of which P follows from the largest shifted reward c of a step:
    value <= c (1 - P) / (1 - gamma) + goal P / gamma.
    """
    gamma, goal = world.gamma, world.goal_reward + shift
    on_the_way = float(shifted_rewards(world.move_reward, shift, gamma).max()) / (1 - gamma)
    if goal <= gamma * on_the_way:
        left: Values = 0.0 * shifted
    else:
        left = np.clip(gamma * (shifted - on_the_way) / (goal - gamma * on_the_way), 0.0, gamma)
    if on_the_way > 0 or goal <= 0:
        return 2 * TOLERANCE * max(goal, on_the_way) * (1 - left) / (1 - gamma)
    steps: Values = np.log(np.maximum(left, FLOOR)) / np.log(gamma)
    return 2 * TOLERANCE * shifted * steps


def off_of(world: GridWorld, shifted: Values, shift: float) -> Values:
    """By how much shifted values are off at most: added up along a way, or, where moves slip, settled."""
    return OFF * abs(shifted) if world.slip == 0 else error_at(world, shifted, shift)


def _floor(world: World, shift: float, error: float | None) -> float:
    """Up to which value all may be as far from their backups as this one, so that none is off by more than the error.

    Where no value is further than d from its backup, none is off by more than d / (1 - gamma).
    """
    if error is None:
        return FLOOR
    if not error > 0:
        raise SettingError(f"the error of values must be above 0, got {error}")
    most = max(world.reward_bounds[1], 0.0)
    largest = shift + (most if isinstance(world, GridWorld) else most / (1 - world.gamma))
    return min(error * (1 - world.gamma), 1e-3 * largest) / TOLERANCE if largest > 0 else FLOOR


def _solve_grid(world: GridWorld, shift: float, floor: float) -> NDArray[np.float64]:
    value = np.zeros(len(world))
    reward = shifted_rewards(world.move_reward, shift, world.gamma)
    value[world.steps_to_goal < 0] = _for_ever(reward, world.slip) / (1 - world.gamma)
    settle_outward(
        world.successor, world.outward, world.steps_to_goal[world.outward], reward, world.goal,
        world.goal_reward + shift, world.gamma, world.slip, value, floor,
    )  # fmt: skip
    value[world.goal] = shift
    return value


def _for_ever(reward: NDArray[np.float64], slip: float) -> float:
    """What a step of a walk that never ends is worth at best; a move is worth the same wherever it is made."""
    worth = (1 - slip) * reward + slip * (reward.sum() - reward) / (len(reward) - 1)
    return float(worth.max())


def settle_outward(
    successor: NDArray[np.uint32], order: NDArray[np.int64], layer: NDArray[np.int32], reward: NDArray[np.float64],
    goal: int, goal_value: float, gamma: float, slip: float, value: NDArray[np.float64], floor: float = FLOOR,
) -> None:  # fmt: skip
    """Solve for the shifted values of the states of ``order`` (N,) and put them in value (S,); the others stay.

    successor (S, A); order: outward from what stays; layer (N,): how far each is; reward (A,) shifted; goal: -1 for
    none.  A move and those that slip from it must be possible backwards.
    floor: smaller values need not settle any better.
    """
    if not len(order):
        return
    stays = np.ones(len(value), np.bool_)
    stays[order] = False
    states = np.concatenate([order, np.flatnonzero(stays)])
    near = np.empty((len(order), successor.shape[1]), np.uint32)
    number = np.empty(len(states), np.uint32)
    bellman.number_outward(successor, states, number, near)
    ordered = value[states]
    swept(
        len(order), bellman.settle_grid,
        near, np.flatnonzero(np.diff(layer, append=-1)) + 1, tuple(reward.tolist()),
        int(number[goal]) if goal >= 0 else -1, goal_value, gamma, float(slip),
        relaxation(slip, gamma, successor.shape[1]), ordered, np.ones(len(states), np.bool_), np.zeros(4, np.int64),
        TOLERANCE, floor,
    )  # fmt: skip
    value[states] = ordered


def relaxation(slip: float, gamma: float, n_actions: int) -> float:
    """How far to go beyond backups: the best factor for such a walk on a line across endless layers, if it pays.

    Young's 2 / (1 + sqrt(1 - r^2)) for the radius r of the Jacobi iteration: steps forward and backward between
    layers, and steps along them.
    """
    aside = slip / (n_actions - 1)
    radius = gamma * (2 * np.sqrt((1 - slip) * aside) + (n_actions - 2) * aside)
    factor = float(2 / (1 + np.sqrt(max(1 - radius**2, 0.0))))
    return factor if factor > LEAST_RELAXATION else 1.0


def _solve_table(world: TabularMDP, shift: float, floor: float) -> NDArray[np.float64]:
    value = np.where(world.terminal, shift, 0.0)
    swept(
        len(world), bellman.solve_table,
        world.row_start, world.target, world.probability, shifted_rewards(world.reward, shift, world.gamma),
        world.terminal, world.gamma, np.arange(len(world))[::-1].copy(), value, world.n_actions, TOLERANCE, floor,
    )  # fmt: skip
    return value


def swept(n_states: int, solver: Callable[..., int], *arguments: Any) -> None:
    """Let a solver sweep till its values settle.

    A few sweeps a call, so that Ctrl-C is answered within a second.  Raises SettingError if they do not settle.
    """
    most = int(np.clip(STATES_A_CALL // max(n_states, 1), 1, 10_000))
    for _ in range(0, MAX_SWEEPS, most):
        if solver(*arguments, most) >= 0:
            return
    raise SettingError(f"values did not settle in {MAX_SWEEPS} sweeps; choose a smaller gamma")


def crossings_to_goal(world: GridWorld, exact: ExactValues, region_of: NDArray[np.int32]) -> NDArray[np.int32]:
    """(S,) how often an optimal way to the goal must change region: tells apart ways that are equally good."""
    crossings: NDArray[np.int32] = bellman.fewest_crossings(
        world.successor, shifted_rewards(world.move_reward, exact.shift, world.gamma), world.goal,
        world.goal_reward + exact.shift, world.gamma, world.slip, world.outward, exact.shifted, region_of,
    )  # fmt: skip
    return crossings


def all_action_values(world: World, shifted: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
    """(S, A) shifted Q values of all states, by one backup of shifted state values; of terminal ones they mean nothing.

    They may differ in the last digit from ``action_values``, which adds up in another order.
    """
    if isinstance(world, TabularMDP):
        worth = shifted_rewards(world.reward, shift, world.gamma) + world.gamma * shifted[world.target]
        return np.add.reduceat(world.probability * worth, world.row_start[:-1]).reshape(len(world), -1)
    worth = shifted_rewards(world.move_reward, shift, world.gamma) + world.gamma * shifted[world.successor]
    worth[world.successor == world.goal] = world.goal_reward + shift
    other = world.slip / (world.n_actions - 1)
    found: NDArray[np.float64] = (1 - world.slip - other) * worth + other * worth.sum(axis=1, keepdims=True)
    return found


def action_values(world: World, shifted: NDArray[np.float64], shift: float, state: int) -> NDArray[np.float64]:
    """(A,) shifted Q values of one state, by one backup of shifted state values."""
    q = np.empty(world.n_actions)
    if isinstance(world, GridWorld):
        bellman.grid_backup(
            world.successor, shifted_rewards(world.move_reward, shift, world.gamma), world.goal,
            world.goal_reward + shift, world.gamma, world.slip, shifted, state, q,
        )  # fmt: skip
    else:
        bellman.table_backup(
            world.row_start, world.target, world.probability, shifted_rewards(world.reward, shift, world.gamma),
            world.gamma, shifted, state, q,
        )  # fmt: skip
    return q
