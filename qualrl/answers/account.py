"""What a way earns, by region and by kind of reward: every discounted reward, booked where its step begins; the
goal's, where the goal is.

S states, A actions.  Without slips that is a walk's own rewards; where moves slip, what is expected of them.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from qualrl.errors import SettingError
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP

STRAIGHT, DIAGONAL, GOAL = "steps", "diagonal steps", "the goal"
Account = Mapping[tuple[str, str], float]
"""Discounted reward by region and kind; the sum is the value."""
LEFT = 1e-13
"""What is still under way when the count ends, as a probability."""
TINY = 1e-15
"""Rewards that are this little certain are not booked."""
MOST_STEPS = 1_000_000


def account_of_walk(model: HybridMDP, walk: Sequence[int]) -> Account:
    """The account of a walk to the goal on which no move slips."""
    world, booked, discount = model.grid, dict[tuple[str, str], float](), 1.0
    for here, there in pairwise(walk):
        move = int(np.flatnonzero(world.successor[here] == there)[0])
        reward = world.goal_reward if there == world.goal else float(world.move_reward[move])
        key = _place(model, there if there == world.goal else here), _kind(world, move, there == world.goal)
        booked[key] = booked.get(key, 0.0) + discount * reward
        discount *= world.gamma
    return booked


def account_of_policy(
    model: HybridMDP, successor: NDArray[np.int64], moves: NDArray[np.int64], state_of: NDArray[np.int64], start: int
) -> Account:
    """The account of following a policy in a world of N states, each standing for one of the model's.

    successor (N, A); moves (N,) what the policy aims at; state_of (N,) the model's state.  Raises SettingError where
    the policy does not end at the goal in a million steps.
    """
    world = model.grid
    ends = state_of[successor] == world.goal
    made = moves_made(world, successor, moves, ends, start)
    earned = made * np.where(ends, world.goal_reward, world.move_reward)
    region = model.region_of[state_of]
    booked: dict[tuple[str, str], float] = {}
    for at in np.unique(region[made.any(axis=1)]).tolist():
        here = region == at
        for kind, share in _by_kind(world, earned[here], ends[here]).items():
            if abs(share) > TINY:
                key = _place(model, world.goal if kind == GOAL else int(state_of[here][0])), kind
                booked[key] = booked.get(key, 0.0) + share
    return booked


def moves_made(
    world: GridWorld, successor: NDArray[np.integer], moves: NDArray[np.integer], ends: NDArray[np.bool_], start: int,
    most_steps: int = MOST_STEPS,
) -> NDArray[np.float64]:  # fmt: skip
    """(N, A) how often, discounted, each move happens in each state on the way of a policy; all but LEFT of it.

    successor (N, A); moves (N,) what the policy aims at; ends (N, A) which moves reach the goal.  Raises SettingError
    where more steps than ``most_steps`` have to be looked at.
    """
    chance = np.full((world.n_actions, world.n_actions), world.slip / (world.n_actions - 1))
    np.fill_diagonal(chance, 1.0 - world.slip)
    chances = chance[moves]
    onward = np.where(ends, -1, successor.astype(np.int64))
    made: NDArray[np.float64] = _visits(onward, chances, world.gamma, start, most_steps)[:, None] * chances
    return made


def _by_kind(world: GridWorld, earned: NDArray[np.float64], ends: NDArray[np.bool_]) -> dict[str, float]:
    onward = np.where(ends, 0.0, earned).sum(axis=0)
    is_straight = world.move_length == 1
    return {
        STRAIGHT: float(onward[is_straight].sum()), DIAGONAL: float(onward[~is_straight].sum()),
        GOAL: float(earned[ends].sum()),
    }  # fmt: skip


def _visits(
    successor: NDArray[np.int64], chances: NDArray[np.float64], gamma: float, start: int, most_steps: int
) -> NDArray[np.float64]:
    """(N,) discounted number of times that a walk of chance is in each state; -1 for the end."""
    n = len(successor)
    kept = successor >= 0
    source = np.broadcast_to(np.arange(n)[:, None], successor.shape)[kept]
    onward = csr_array((chances[kept], (successor[kept], source)), shape=(n, n))
    at = np.zeros(n)
    at[start] = 1.0
    visits, discount = at.copy(), 1.0
    for _ in range(most_steps):
        at = np.asarray(onward @ at)
        discount *= gamma
        visits += discount * at
        if discount * at.sum() < LEFT:
            return visits
    raise SettingError(f"at gamma {gamma:g} and so many slips the way takes over {most_steps} steps: no account of it")


def _kind(world: GridWorld, move: int, is_end: bool) -> str:
    if is_end:
        return GOAL
    return STRAIGHT if world.move_length[move] == 1 else DIAGONAL


def _place(model: HybridMDP, state: int) -> str:
    return model.region_names[int(model.region_of[state])]
