"""A region that is left by one doorway only, all its others shut (paper, equation (10)).

n cells of the region, m cells just beyond the doorway, S states, A moves.  A way must lead out: into the goal it leads
through the doorway only, and a move that would lead out by another, or into a goal within, stays where it is.  Or all
doorways are shut and a way must lead to the goal within; then that is what lies beyond.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.grid import breadth_first
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import doors_of_moves
from qualrl.solving.exact import settle_outward, shifted_rewards
from qualrl.spatial.region_map import Doorway, RegionMap


@dataclass(frozen=True, eq=False)
class OneDoorway:
    """The region as a small world of its own, with the cells beyond the doorway, or the goal."""

    world: GridWorld
    inside: NDArray[np.int64]
    """(n,) states, in rising order."""
    beyond: NDArray[np.int64]
    """(m,) states, in rising order; none where the doorway leads nowhere."""
    successor: NDArray[np.uint32]
    """(n + m, A) where moves lead, numbered as (*inside, *beyond); from beyond: back in, where a move led out."""

    def values(self, shifted: NDArray[np.float64], shift: float, slip: float) -> NDArray[np.float64]:
        """(n,) shifted values when cells beyond are worth ``shifted`` (S,); -inf where no way leads out."""
        world, n = self.world, len(self.inside)
        order, steps = breadth_first(self.successor, np.arange(n, len(self.successor)))
        order = order[order < n]
        value = np.concatenate([np.full(n, -np.inf), shifted[self.beyond]])
        value[order] = 0.0
        goal = np.flatnonzero(self.beyond == world.goal)
        settle_outward(
            self.successor, order, steps[order], shifted_rewards(world.move_reward, shift, world.gamma),
            n + int(goal[0]) if len(goal) else -1, world.goal_reward + shift, world.gamma, slip, value,
        )  # fmt: skip
        return value[:n]

    @cached_property
    def of_world(self) -> NDArray[np.uint32]:
        """(n, A) where moves of the region lead, as states of the world."""
        states = np.concatenate([self.inside, self.beyond]).astype(np.uint32)
        return states[self.successor[: len(self.inside)]]


@dataclass(frozen=True, eq=False)
class Room:
    """A region, and which doorway each of its moves passes."""

    world: GridWorld
    regions: RegionMap
    inside: NDArray[np.int64]
    target: NDArray[np.int64]
    """(n, A) states that moves lead to."""
    door_of: NDArray[np.int32]
    """(n, A) doorway that a move passes, -1 where it does not leave the region."""

    @classmethod
    def of(cls, model: HybridMDP, regions: RegionMap, inside: NDArray[np.int64]) -> "Room":
        """A region by its states, in rising order."""
        target = model.grid.successor[inside].astype(np.int64)
        return cls(model.grid, regions, inside, target, doors_of_moves(model, regions, inside))

    def left_by(self, door: Doorway | None) -> OneDoorway:
        """The region when it is left by one doorway of it; None: when it is not left but for the goal."""
        if door is None:
            out = (self.target == self.world.goal) & (self.door_of < 0)
        else:
            number = [of.name for of in self.regions.doorways].index(door.name)
            out = (self.door_of == number) & (self.world.steps_to_goal[self.target] >= 0)
        at_goal = self.inside == self.world.goal
        out[at_goal] = False  # no way leads over the goal
        n, n_actions = self.target.shape
        own = np.arange(n)[:, None]
        stays = (self.door_of >= 0) | (self.target == self.world.goal)
        position = np.where(stays, own, np.searchsorted(self.inside, np.where(stays, self.inside[own], self.target)))
        beyond = np.unique(self.target[out])
        position[out] = n + np.searchsorted(beyond, self.target[out])
        back = np.tile(np.arange(n, n + len(beyond))[:, None], n_actions)
        self._lead_back(beyond, back, np.nonzero(out)[0], position[out])
        position[at_goal] = own[at_goal]
        return OneDoorway(self.world, self.inside, beyond, np.concatenate([position, back]).astype(np.uint32))

    def _lead_back(
        self, beyond: NDArray[np.int64], back: NDArray[np.int64], near: NDArray[np.int64], far: NDArray[np.int64]
    ) -> None:
        """Let moves from beyond lead to the cells ``near`` (K,) from which moves lead to the exits ``far`` (K,)."""
        for here, exit_number in zip(near.tolist(), far.tolist(), strict=True):
            row = exit_number - len(self.inside)
            back[row, self.world.successor[beyond[row]] == self.inside[here]] = here
