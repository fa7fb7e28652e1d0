"""What a qualitative action is worth: the best way out of a region through one given door.

n cells of the region, m cells beyond the door, A moves.  The region is solved on its own, all its
other doors shut, with the values beyond the door as its boundary (paper, equation (10)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.values import PlanValues
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import settle_outward
from qualrl.spatial.region_map import Doorway, RegionMap


@dataclass(frozen=True)
class Choice:
    """One qualitative action at one state."""

    door: Doorway
    to_region: int
    shifted: float
    """Its shifted value."""


@dataclass(frozen=True, eq=False)
class Chooser:
    """The choices of a model, by the values of a plan."""

    model: HybridMDP
    regions: RegionMap
    values: PlanValues

    def at(self, state: int, taken: Doorway) -> list[Choice]:
        """The doors of a state's region that lead on to the goal without coming back, and the one taken; best first."""
        region = int(self.model.region_of[state])
        doors = self._onward(region, taken)
        at = int(np.searchsorted(self.states[region], state))
        through = self._values_through(region, doors)
        found = [Choice(door, beyond, float(values[at])) for (door, beyond), values in zip(doors, through, strict=True)]
        return sorted(found, key=lambda choice: -choice.shifted)

    def throughout(self, region: int) -> tuple[list[Doorway], NDArray[np.float64]]:
        """The D doors of a region that lead on to the goal without coming back, and (D, n) what each is worth.

        Shifted values of the region's n states; 0 where a door cannot be reached inside the region.
        """
        doors = self._onward(region)
        values = self._values_through(region, doors)
        return [door for door, _ in doors], np.array(values).reshape(len(doors), len(self.states[region]))

    def _onward(self, region: int, taken: Doorway | None = None) -> list[tuple[Doorway, int]]:
        onward = self._regions_of_the_goal_without(region)
        return [(door, beyond) for door, beyond in self._doors[region] if beyond in onward or door is taken]

    def _values_through(self, region: int, doors: Sequence[tuple[Doorway, int]]) -> list[NDArray[np.float64]]:
        room = _Room(self.model, self.states[region])
        return [room.values_through(self._cells_beyond(door, beyond), self.values) for door, beyond in doors]

    @cached_property
    def _doors(self) -> list[list[tuple[Doorway, int]]]:
        """Doors of each region, with the region beyond."""
        doors: list[list[tuple[Doorway, int]]] = [[] for _ in self.regions.regions]
        for door in self.regions.doorways:
            doors[door.pair[0]].append((door, door.pair[1]))
            doors[door.pair[1]].append((door, door.pair[0]))
        return doors

    @cached_property
    def states(self) -> list[NDArray[np.int64]]:
        """States of each region, in rising order."""
        order = np.argsort(self.model.region_of, kind="stable")
        return np.split(order, np.cumsum([region.cells for region in self.regions.regions])[:-1])

    def _regions_of_the_goal_without(self, left: int) -> set[int]:
        """Regions from which the goal's can be reached without passing a region (all, if that is the goal's)."""
        goal = int(self.model.region_of[self.model.grid.goal])
        if goal == left:
            return set(range(len(self._doors)))
        reached, edge = {goal}, [goal]
        while edge:
            new = {beyond for region in edge for _, beyond in self._doors[region]} - reached - {left}
            reached |= new
            edge = list(new)
        return reached

    def _cells_beyond(self, door: Doorway, region: int) -> list[int]:
        """States on the far side of a door that are not the goal, unless it is the only one."""
        side = door.pair.index(region)
        world = self.model.grid
        states = sorted({int(world.state_of[pair[side]]) for pair in crossings_of(self.regions, door)})
        return [state for state in states if state != world.goal] or states


class _Room:
    """A region as a small world of its own, its cells numbered from 0."""

    def __init__(self, model: HybridMDP, inside: NDArray[np.int64]) -> None:
        self.world = model.grid
        self.inside = inside
        target = self.world.successor[inside].astype(np.int64)
        position = np.minimum(np.searchsorted(inside, target), len(inside) - 1)
        own = np.arange(len(inside))[:, None]
        shut = (inside[position] != target) | (target == self.world.goal)
        self.successor = np.where(shut, own, position).astype(np.uint32)

    def values_through(self, beyond: Sequence[int], values: PlanValues) -> NDArray[np.float64]:
        """(n,) shifted values when the only way out leads to the states ``beyond``."""
        n, world = len(self.inside), self.world
        successor = np.concatenate([self.successor, np.tile(np.arange(n, n + len(beyond)), (world.n_actions, 1)).T])
        successor = successor.astype(np.uint32)
        for exit_number, outside in enumerate(beyond, n):
            for back, near in enumerate(world.successor[outside].tolist()):
                at = int(np.searchsorted(self.inside, near))
                if at < n and self.inside[at] == near:  # a door leads both ways
                    successor[at, world.successor[near] == outside] = exit_number
                    successor[exit_number, back] = at
        value = np.concatenate([np.zeros(n), values.shifted[list(beyond)]])
        best = n + int(np.argmax(value[n:]))  # a door is narrow: nearly all ways lead over its best cell
        order, steps = breadth_first(successor, np.array([best]))
        order = order[order < n]
        settle_outward(
            successor, order, steps[order], world.move_reward + values.shift * (1 - world.gamma), -1, 0.0,
            world.gamma, world.slip, value,
        )  # fmt: skip
        return value[:n]
