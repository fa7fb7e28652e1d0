"""The best way from a state that leaves its region by a given doorway.

S states, A actions.  All other doorways of the region are shut until it is left (paper, equation (10)); what lies
beyond the doorway is worth what it is worth in the whole world.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.slope import Slope
from qualrl.errors import NoPlanError
from qualrl.kernels.grid import breadth_first
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import ExactValues, SlipSpan, settle_outward
from qualrl.spatial.region_map import Doorway


@dataclass(frozen=True, eq=False)
class ThroughWay:
    """A way through a doorway, as it goes when no move slips, and what it is worth when some do."""

    parts: tuple[tuple[int, ...], ...]
    """States up to the first one beyond the doorway, and from there to the goal."""
    shifted: float
    """That value, shifted as exact values are."""
    slope: Slope
    """Of the region and just beyond the doorway, the region's other doorways shut; -inf elsewhere."""

    @property
    def walk(self) -> tuple[int, ...]:
        """All states, from the start to the goal."""
        return self.parts[0] + self.parts[1][1:]


def way_through(model: HybridMDP, exact: ExactValues, start: int, door: Doorway) -> ThroughWay:
    """The best way from a state, which leaves its region by a doorway of it.  Raises NoPlanError where none does."""
    world, shifted = values_through(model, exact, start, door, model.grid.slip)
    slope = Slope(world, world.successor, shifted, exact.shift)
    first = slope.walk(start, model.region_of != model.region_of[start])
    rest = [first[-1]] if first[-1] == world.goal else exact_walk(model, exact, first[-1])
    return ThroughWay((tuple(first), tuple(rest)), float(shifted[start]), slope)


def values_through(
    model: HybridMDP, exact: ExactValues, start: int, door: Doorway, slip: float | SlipSpan
) -> tuple[GridWorld, NDArray[np.float64]]:
    """A world in which a state's region is left by one doorway, and the shifted values (S,) of the region there.

    exact: of the whole world, with the same slips.  -inf elsewhere but just beyond the doorway.
    Raises NoPlanError where no way leads from the state through the doorway, or on to the goal.
    """
    regions = model.regions
    assert regions is not None
    region = int(model.region_of[start])
    others = [of for of in regions.doorways if region in of.pair and of.name != door.name]
    walls = [wall for of in others for wall in crossings_of(regions, of)]
    world = replace(model.grid, closed=(*model.grid.closed, *walls))
    side = 1 - door.pair.index(region)
    beyond = np.array(sorted({int(world.state_of[ends[side]]) for ends in crossings_of(regions, door)}))
    beyond = beyond[np.isfinite(exact.shifted[beyond]) & (world.steps_to_goal[beyond] >= 0)]
    if not len(beyond):
        raise NoPlanError(f"no way leads on to the goal through {door.name}")
    order, steps = breadth_first(world.successor, beyond)
    inside = order[model.region_of[order] == region]
    shifted = np.full(len(world), -np.inf)
    shifted[beyond] = exact.shifted[beyond]
    shifted[inside] = 0.0
    settle_outward(
        world.successor, inside, steps[inside], world.move_reward + exact.shift * (1 - world.gamma), world.goal,
        world.goal_reward + exact.shift, world.gamma, slip, shifted,
    )  # fmt: skip
    if not np.isfinite(shifted[start]):
        raise NoPlanError(f"{door.name} cannot be reached from {model.describe(start)} inside its region")
    return world, shifted
