"""A scenario to start from, for a map that came without one."""

import numpy as np

from qualrl.io.scenario import Scenario
from qualrl.io.scenario_learn import LearnSettings
from qualrl.kernels.grid import breadth_first
from qualrl.models.grid_world import GridWorld
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.place import Place, PlaceCell, PlaceName
from qualrl.spatial.region_map import RegionMap

SLOWEST_GAMMA_DIGITS = 6
EPISODES = 200
"""Enough for hql-replay on every map tried: it sees what it needs in the first few, whatever the map's size."""


def suggested_scenario(regions: RegionMap, map_file: str, resolution_m: float | None = None) -> Scenario:
    """From the first region to the one whose centre is the longest walk away, with settings that fit that length.

    Rate 1 is for the other learners: moves that never slip leave nothing to average.
    """
    start, goal, steps = farthest_places(regions)
    learn = LearnSettings(gamma=gamma_for(steps), alpha=1.0, epsilon=0.02, episodes=EPISODES)
    return Scenario(map=map_file, start=start, goal=goal, learn=learn, resolution_m=resolution_m)


def gamma_for(steps: int) -> float:
    """The smallest of 0.9, 0.99, 0.999, ... that leaves at least a tenth of the goal's reward that many steps away.

    At 0.9, values 350 steps apart differ by less than float64 can hold beside the cost of the way.
    """
    for digits in range(1, SLOWEST_GAMMA_DIGITS):
        gamma = 1 - 10.0**-digits
        if gamma**steps >= 0.1:
            return round(gamma, digits)
    return round(1 - 10.0**-SLOWEST_GAMMA_DIGITS, SLOWEST_GAMMA_DIGITS)


def farthest_places(regions: RegionMap) -> tuple[Place, Place, int]:
    """(start, goal, steps between them): the first region's centre and the centre farthest from it.

    On a map of one region, the cell farthest from the centre is the goal.
    """
    first = regions.regions[0]
    world = GridWorld(regions.grid.free, first.centre, gamma=0.0)
    order, steps = breadth_first(world.successor, np.array([world.goal]))
    far = [int(steps[world.state_of[region.centre]]) for region in regions.regions]
    best = int(np.argmax(far))
    if far[best] > 0:
        return PlaceName(first.name), PlaceName(regions.regions[best].name), far[best]
    cell: Cell = tuple(world.cells[order[-1]].tolist())
    return PlaceName(first.name), PlaceCell(*cell), int(steps[order[-1]])
