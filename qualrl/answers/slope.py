"""Walking up values: which moves are best at a state, and where one comes by them when none slips.

S states, A actions.  See ``kernels.bellman`` for shifted values.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import NoPlanError
from qualrl.kernels.bellman import grid_backup
from qualrl.models.grid_world import GridWorld
from qualrl.planning.planner import why_alike
from qualrl.solving.exact import shifted_rewards


@dataclass(frozen=True, eq=False)
class Slope:
    """Values of a world, or of one in which moves lead elsewhere."""

    world: GridWorld
    successor: NDArray[np.uint32]
    """(S, A) where moves lead."""
    shifted: NDArray[np.float64]
    """(S,)"""
    shift: float
    has_goal: bool = True
    """Whether moves that lead to the goal are paid for it, and not by its value."""

    def best_moves(self, state: int) -> NDArray[np.bool_]:
        """(A,) which moves are best, to a relative 1e-12."""
        world, q = self.world, np.empty(self.world.n_actions)
        goal, goal_value = (world.goal, world.goal_reward + self.shift) if self.has_goal else (-1, 0.0)
        reward = shifted_rewards(world.move_reward, self.shift, world.gamma)
        grid_backup(self.successor, reward, goal, goal_value, world.gamma, world.slip, self.shifted, state, q)
        good: NDArray[np.bool_] = q >= q.max() - 1e-12 * abs(q.max())
        return good

    def walk(self, start: int, reached: NDArray[np.bool_]) -> list[int]:
        """States from a start to the first one that is ``reached`` (S,), straight on where that is as good.

        Raises NoPlanError where values fade.
        """
        found = self._follow(self.best_moves, start, reached)
        if found is None and self.world.slip > 0:
            found = self._follow(self._moves_ahead, start, reached)
        if found is None:
            raise NoPlanError(f"moves are too much alike on the way: {why_alike(self.world.gamma)}")
        return found

    def _moves_ahead(self, state: int) -> NDArray[np.bool_]:
        """(A,) which moves aim at what is worth most: where moves mostly slip, aiming there is not the way there."""
        ahead = self.shifted[self.successor[state]]
        if self.has_goal:
            ahead[self.successor[state] == self.world.goal] = np.inf
        good: NDArray[np.bool_] = ahead == ahead.max()
        return good

    def _follow(
        self, good_moves: Callable[[int], NDArray[np.bool_]], start: int, reached: NDArray[np.bool_]
    ) -> list[int] | None:
        """The walk by good moves; None where they do not lead there."""
        walk, last = [start], 0
        while not reached[walk[-1]]:
            good = good_moves(walk[-1])
            last = last if good[last] else int(good.argmax())
            walk.append(int(self.successor[walk[-1], last]))
            if len(walk) > len(self.world):
                return None
        return walk
