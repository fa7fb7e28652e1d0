"""Which doorway a step from one region to another passes.

N steps.  Straight steps pass the cells of a doorway; a diagonal one may pass beside it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.legs import Leg
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Doorway, RegionMap


def doors_passed(
    model: HybridMDP, regions: RegionMap, last: NDArray[np.integer], first: NDArray[np.integer]
) -> NDArray[np.int32]:
    """(N,) indices of the doorways that steps from states last (N,) to states first (N,) of other regions pass.

    It is the doorway between the two regions that lies nearest.  Where they touch at a corner only, so that there is
    none, it is the nearest one out of the first region, whose cells a robot cuts then.
    """
    return _doors_between(regions, model.grid.cells[last], model.grid.cells[first])


def doors_of_moves(model: HybridMDP, regions: RegionMap, states: NDArray[np.int64]) -> NDArray[np.int32]:
    """(N, A) the doorway that each move of states (N,) into another region passes; -1 for moves that stay in theirs."""
    successor = model.grid.successor[states]
    leaves = model.region_of[successor] != model.region_of[states][:, None]
    found = np.full(successor.shape, -1, np.int32)
    found[leaves] = doors_passed(model, regions, states[np.nonzero(leaves)[0]], successor[leaves])
    return found


def door_taken(model: HybridMDP, regions: RegionMap, last: int, first: int) -> Doorway:
    """The same for one step."""
    return regions.doorways[int(doors_passed(model, regions, np.array([last]), np.array([first]))[0])]


def doors_between(model: HybridMDP, regions: RegionMap, walk: Sequence[int], legs: Sequence[Leg]) -> list[Doorway]:
    """The doorways between the legs of a walk."""
    return [door_taken(model, regions, walk[leg.first - 1], walk[leg.first]) for leg in legs[1:]]


def doorway_passed(regions: RegionMap, here: Cell, there: Cell) -> Doorway:
    """The same for one step from cell to cell."""
    return regions.doorways[int(_doors_between(regions, np.array([here]), np.array([there]))[0])]


def _doors_between(
    regions: RegionMap, last: NDArray[np.integer], first: NDArray[np.integer]
) -> NDArray[np.int32]:  # fmt: skip
    """The same for steps from cells last (N, 2) to cells first (N, 2)."""
    found, middle = np.empty(len(last), np.int32), (last + first) / 2
    ends = np.stack([regions.label[cells[:, 0], cells[:, 1]] for cells in (last, first)], axis=1)
    pairs = np.array([door.pair for door in regions.doorways], np.int32).reshape(-1, 2)
    kinds, of = np.unique(ends, axis=0, return_inverse=True)
    for kind, (here, there) in enumerate(kinds.tolist()):
        steps = of.ravel() == kind
        doors = np.flatnonzero((pairs == sorted((here, there))).all(axis=1))
        if not len(doors):
            doors = np.flatnonzero((pairs == here).any(axis=1))
        far = np.stack([_distance(middle[steps], _places(regions, door)) for door in doors.tolist()])
        found[steps] = doors[far.argmin(axis=0)]
    return found


def _places(regions: RegionMap, door: int) -> NDArray[np.float64]:
    """(K, 2) the middles of the steps through a doorway."""
    middles: NDArray[np.float64] = (
        np.array(crossings_of(regions, regions.doorways[door])).reshape(-1, 2, 2).mean(axis=1)
    )
    return middles


def _distance(points: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) steps from each point to the nearest of some places."""
    nearest = np.full(len(points), np.inf)
    for place in places:
        np.minimum(nearest, np.abs(points - place).sum(axis=1), out=nearest)
    return nearest
