"""Which doorway a step from one region to another passes.

N steps.  Straight steps pass the cells of a doorway; a diagonal one may pass beside it.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.region_map import Doorway, RegionMap


def doors_passed(
    model: HybridMDP, regions: RegionMap, last: NDArray[np.integer], first: NDArray[np.integer]
) -> NDArray[np.int32]:
    """(N,) indices of the doorways that steps from states last (N,) to states first (N,) of other regions pass.

    It is the doorway between the two regions that lies nearest.  Where they touch at a corner only, so that there is
    none, it is the nearest one out of the first region, whose cells a robot cuts then.
    """
    cells, found = model.grid.cells, np.empty(len(last), np.int32)
    middle = (cells[last] + cells[first]) / 2
    ends = np.stack([model.region_of[last], model.region_of[first]], axis=1)
    places = [np.array(crossings_of(regions, door)).reshape(-1, 2, 2).mean(axis=1) for door in regions.doorways]
    pairs = np.array([door.pair for door in regions.doorways], np.int32).reshape(-1, 2)
    kinds, of = np.unique(ends, axis=0, return_inverse=True)
    for kind, (here, there) in enumerate(kinds.tolist()):
        steps = of.ravel() == kind
        doors = np.flatnonzero((pairs == sorted((here, there))).all(axis=1))
        if not len(doors):
            doors = np.flatnonzero((pairs == here).any(axis=1))
        far = np.stack([_distance(middle[steps], places[door]) for door in doors.tolist()])
        found[steps] = doors[far.argmin(axis=0)]
    return found


def door_taken(model: HybridMDP, regions: RegionMap, last: int, first: int) -> Doorway:
    """The same for one step."""
    return regions.doorways[int(doors_passed(model, regions, np.array([last]), np.array([first]))[0])]


def _distance(points: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) steps from each point to the nearest of some places."""
    nearest = np.full(len(points), np.inf)
    for place in places:
        np.minimum(nearest, np.abs(points - place).sum(axis=1), out=nearest)
    return nearest
