"""A robot on a grid: one state a free cell, four or eight moves, which may slip (paper, Definition 1).

S free cells in image order (row by row), A moves.  No S x S matrix is built unless ``table`` is asked for.
Rewards: ``step_reward`` times the length of the move (1, or sqrt 2 for a diagonal one), and
``goal_reward`` instead for the move that reaches the goal, which ends the episode (paper, section 4.1.1).
"""

import math
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import PlaceError, SettingError
from qualrl.kernels import grid as kernel
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.spatial.occupancy_grid import Cell

MOVES: dict[int, tuple[tuple[str, int, int], ...]] = {
    4: (("up", -1, 0), ("down", 1, 0), ("left", 0, -1), ("right", 0, 1)),
}
MOVES[8] = MOVES[4] + (("up-left", -1, -1), ("up-right", -1, 1), ("down-left", 1, -1), ("down-right", 1, 1))
LARGEST_VALUE = 1e100
Wall = tuple[Cell, Cell]
"""Two cells side by side that no move leads between, in either direction."""


@dataclass(frozen=True, eq=False)
class GridWorld:
    """The lower, quantitative level on a map.

    Raises SettingError for a number out of its range, PlaceError for a goal that is not free.
    """

    free: NDArray[np.bool_]
    """(H, W), True where the robot may stand."""
    goal_cell: Cell
    gamma: float
    slip: float = 0.0
    """Probability that another move than the chosen one happens, each of the others as likely."""
    directions: int = 4
    """4, or 8: diagonal moves, which never cut a corner."""
    step_reward: float = -1.0
    goal_reward: float = 100.0
    closed: tuple[Wall, ...] = ()
    """Steps that a closed door blocks, as a wall would; a diagonal move is blocked where a way round it is."""

    def __post_init__(self) -> None:
        if not 0 <= self.gamma < 1:
            raise SettingError(f"gamma must be at least 0 and less than 1, got {self.gamma}")
        if not 0 <= self.slip < 1:
            raise SettingError(f"slip must be at least 0 and less than 1, got {self.slip}")
        if self.directions not in MOVES:
            raise SettingError(f"directions must be 4 or 8, got {self.directions}")
        if not (math.isfinite(self.step_reward) and self.step_reward < 0):
            raise SettingError(f"the reward of a step must be negative, got {self.step_reward}")
        if not (math.isfinite(self.goal_reward) and self.goal_reward >= self.step_reward):
            raise SettingError(
                f"the reward of the goal must be at least that of a step ({self.step_reward}), got {self.goal_reward}"
            )
        if max(-self.step_reward / (1 - self.gamma), abs(self.goal_reward)) > LARGEST_VALUE:
            raise SettingError(
                f"values would exceed {LARGEST_VALUE:g} with rewards {self.step_reward:g} and {self.goal_reward:g} "
                f"at gamma {self.gamma}; scale both rewards down"
            )
        row, column = self.goal_cell
        inside = 0 <= row < self.free.shape[0] and 0 <= column < self.free.shape[1]
        if not inside or not self.free[row, column]:
            raise PlaceError(f"the goal must be a free cell; {self.goal_cell} is not")

    def __len__(self) -> int:
        return len(self.cells)

    def differs_in(self, other: "GridWorld") -> frozenset[str]:
        """The names of the fields in which two worlds differ."""
        plain = [of.name for of in fields(self) if of.name != "free"]
        found = {name for name in plain if getattr(self, name) != getattr(other, name)}
        return frozenset(found if np.array_equal(self.free, other.free) else {*found, "free"})

    @property
    def n_actions(self) -> int:
        """A."""
        return self.directions

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the moves, as seen on the image: "up" is towards row 0."""
        return tuple(name for name, _, _ in MOVES[self.directions])

    @property
    def cells(self) -> NDArray[np.int32]:
        """(S, 2) row and column of each state."""
        return self._states[0]

    @property
    def state_of(self) -> NDArray[np.int32]:
        """(H, W) state of each cell, -1 where not free."""
        return self._states[1]

    @cached_property
    def _states(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        cells, state_of = kernel.cells_and_states(self.free)
        return cells, state_of

    @cached_property
    def successor(self) -> NDArray[np.uint32]:
        """(S, A) where each move leads; a blocked move leads back to s."""
        offsets = np.array([(dr, dc) for _, dr, dc in MOVES[self.directions]], np.int32)
        found: NDArray[np.uint32] = kernel.successors(self.state_of, self.cells, offsets)
        for wall in self.closed:
            self._shut(found, wall)
        return found

    def _shut(self, successor: NDArray[np.uint32], wall: Wall) -> None:
        """Block the step between two cells, and the diagonal moves past either end of the wall between them."""
        moves = {(down, right): a for a, (_, down, right) in enumerate(MOVES[self.directions])}
        (row, column), (to_row, to_column) = wall
        along = to_column - column, to_row - row
        states = self._states_around(row, column)
        for side in (-1, 0, 1):
            down, right = side * along[0], side * along[1]
            for ends in (
                ((row, column), (to_row + down, to_column + right)),
                ((row + down, column + right), (to_row, to_column)),
            ):
                for start, end in (ends, ends[::-1]):
                    move = moves.get((end[0] - start[0], end[1] - start[1]))
                    if move is not None and start in states:
                        successor[states[start], move] = states[start]

    def _states_around(self, row: int, column: int) -> dict[Cell, int]:
        """States of the free cells up to two cells away."""
        near = self.state_of[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        return {
            (max(row - 2, 0) + r, max(column - 2, 0) + c): int(near[r, c]) for r, c in np.argwhere(near >= 0).tolist()
        }

    @cached_property
    def move_length(self) -> NDArray[np.float64]:
        """(A,) length of each move in cells: 1 or sqrt 2."""
        return np.array([math.hypot(dr, dc) for _, dr, dc in MOVES[self.directions]])

    @property
    def move_reward(self) -> NDArray[np.float64]:
        """(A,) reward of each move that does not reach the goal."""
        return self.step_reward * self.move_length

    @property
    def goal(self) -> int:
        """State of the goal."""
        return int(self.state_of[self.goal_cell])

    @property
    def reward_bounds(self) -> tuple[float, float]:
        """Smallest and largest reward."""
        rewards = (*self.move_reward.tolist(), self.goal_reward)
        return min(rewards), max(rewards)

    @cached_property
    def steps_to_goal(self) -> NDArray[np.int32]:
        """(S,) least number of moves to the goal, -1 where no way leads there."""
        return self._from_goal[1]

    @cached_property
    def outward(self) -> NDArray[np.int64]:
        """States that can reach the goal, nearest first, the goal itself left out."""
        return self._from_goal[0][1:]

    @cached_property
    def _from_goal(self) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        order, steps = kernel.breadth_first(self.successor, np.array([self.goal]))
        return order, steps

    def table(self) -> TabularMDP:
        """The same world as an explicit table, for those who want to see the matrices."""
        n_states, n_actions = self.successor.shape
        probability = np.full((n_actions, n_actions), self.slip / (n_actions - 1))
        np.fill_diagonal(probability, 1.0 - self.slip)
        used = probability > 0
        columns = np.nonzero(used)[1].reshape(n_actions, -1)
        target = self.successor.astype(np.int64)[:, columns]
        reward = np.where(target == self.goal, self.goal_reward, self.move_reward[columns])
        per_row = columns.shape[1]
        terminal = np.zeros(n_states, np.bool_)
        terminal[self.goal] = True
        return TabularMDP(
            row_start=np.arange(n_states * n_actions + 1, dtype=np.int64) * per_row,
            target=target.ravel().astype(np.uint32),
            probability=np.tile(probability[used], n_states),
            reward=reward.ravel(),
            terminal=terminal,
            gamma=self.gamma,
            action_names=self.action_names,
        )
