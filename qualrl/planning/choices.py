"""What a qualitative action is worth: the best way out of a region through one given door.

n cells of the region.  The region is solved on its own, all its other doors shut, with the values beyond the door as
its boundary (paper, equation (10)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.one_doorway import Room
from qualrl.planning.values import PlanValues
from qualrl.spatial.region_map import Doorway, RegionMap


@dataclass(frozen=True)
class Choice:
    """One qualitative action at one state."""

    door: Doorway | None
    """None for staying in the goal's region."""
    to_region: int
    shifted: float
    """Its shifted value."""


@dataclass(frozen=True, eq=False)
class Chooser:
    """The choices of a model, by the values of a plan."""

    model: HybridMDP
    regions: RegionMap
    values: PlanValues

    def at(self, state: int, taken: Doorway | None) -> list[Choice]:
        """What can be done in a state's region, best first: to leave it by a doorway, or, where the goal is, to stay.

        Doorways that lead on to the goal without coming back, and the one taken, if any; without those that cannot be
        reached inside the region.
        """
        region = int(self.model.region_of[state])
        ways: list[tuple[Doorway | None, int]] = [*self._onward(region, taken)]
        if region == int(self.model.region_of[self.model.grid.goal]):
            ways.append((None, region))
        at = int(np.searchsorted(self.states[region], state))
        worth = [float(values[at]) for values in self._values_through(region, [door for door, _ in ways])]
        found = [Choice(door, to, value) for (door, to), value in zip(ways, worth, strict=True) if np.isfinite(value)]
        return sorted(found, key=lambda choice: -choice.shifted)

    def throughout(self, region: int) -> tuple[list[Doorway], NDArray[np.float64]]:
        """The D doors of a region that lead on to the goal without coming back, and (D, n) what each is worth.

        Shifted values of the region's n states; 0 where a door cannot be reached inside the region.
        """
        doors = [door for door, _ in self._onward(region)]
        values = np.array(self._values_through(region, doors)).reshape(len(doors), len(self.states[region]))
        return doors, np.where(np.isfinite(values), values, 0.0)

    def can_come_back(self, region: int) -> bool:
        """Whether ways lead out of a region by one of its doorways, and back by another."""
        for _, beyond in self._doors[region]:
            around = self._regions_around(beyond, region)
            if sum(there in around for _, there in self._doors[region]) > 1:
                return True
        return False

    def _onward(self, region: int, taken: Doorway | None = None) -> list[tuple[Doorway, int]]:
        onward = self._regions_of_the_goal_without(region)
        return [(door, beyond) for door, beyond in self._doors[region] if beyond in onward or door is taken]

    def _values_through(self, region: int, doors: Sequence[Doorway | None]) -> list[NDArray[np.float64]]:
        room = Room.of(self.model, self.regions, self.states[region])
        values, slip = self.values, self.model.grid.slip
        return [room.left_by(door).values(values.shifted, values.shift, slip) for door in doors]

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
        return set(range(len(self._doors))) if goal == left else self._regions_around(goal, left)

    def _regions_around(self, region: int, left: int) -> set[int]:
        """Regions from which one can be reached without passing another."""
        reached, edge = {region}, [region]
        while edge:
            new = {beyond for region in edge for _, beyond in self._doors[region]} - reached - {left}
            reached |= new
            edge = list(new)
        return reached
