"""What a qualitative action is worth: the best way out of a region through one given door.

n cells of the region, m cells beyond the door, A moves.  The region is solved on its own, all its
other doors shut, with the values beyond the door as its boundary (paper, equation (10)).
"""

from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import bellman
from qualrl.kernels.grid import breadth_first
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.values import PlanValues
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import MAX_SWEEPS, TOLERANCE
from qualrl.spatial.region_map import Doorway, RegionMap


@dataclass(frozen=True)
class Choice:
    """One qualitative action at one state."""

    door: Doorway
    to_region: int
    shifted: float
    """Its shifted value."""


def choices_at(model: HybridMDP, regions: RegionMap, state: int, values: PlanValues) -> list[Choice]:
    """The doors of a state's region that lead on to the goal without coming back, best first."""
    region = int(model.region_of[state])
    found = []
    for door in regions.doorways:
        if region in door.pair:
            beyond = door.pair[1] if door.pair[0] == region else door.pair[0]
            if _leads_on(model, region, beyond):
                found.append(Choice(door, beyond, _value_through(model, regions, state, door, values)))
    return sorted(found, key=lambda choice: -choice.shifted)


def _leads_on(model: HybridMDP, left: int, entered: int) -> bool:
    """Whether the goal's region can be reached from a region without passing the one just left."""
    goal = model.region_names[model.region_of[model.grid.goal]]
    names = model.region_names
    if goal == names[left]:
        return True
    rest = nx.restricted_view(model.graph, [names[left]], [])
    return bool(nx.has_path(rest, names[entered], goal))


def _value_through(model: HybridMDP, regions: RegionMap, state: int, door: Doorway, values: PlanValues) -> float:
    world = model.grid
    inside = np.flatnonzero(model.region_of == model.region_of[state])
    successor, beyond = _region_with_exit(world, regions, inside, door)
    n = len(inside)
    value = np.concatenate([np.zeros(n), values.shifted[beyond]])
    order, _ = breadth_first(successor, np.arange(n, len(value)))
    bellman.solve_grid(
        successor, world.move_reward + values.shift * (1 - world.gamma), -1, 0.0, world.gamma, world.slip,
        order[order < n], value, TOLERANCE, MAX_SWEEPS,
    )  # fmt: skip
    return float(value[np.searchsorted(inside, state)])


def _region_with_exit(
    world: GridWorld, regions: RegionMap, inside: NDArray[np.int64], door: Doorway
) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
    """(successor (n + m, A) in the region's own numbers, states beyond the door (m,)).

    Moves that would leave by another way, or reach the goal, lead nowhere.
    """
    here = regions.label[tuple(world.cells[inside[0]])]
    crossings = crossings_of(regions, door)
    exits = {pair[1] if door.pair[0] == here else pair[0] for pair in crossings}
    beyond = np.array(sorted(int(world.state_of[cell]) for cell in exits), np.int64)
    beyond = beyond[beyond != world.goal] if len(beyond) > 1 else beyond
    states = np.concatenate([inside, beyond])
    target = world.successor[states].astype(np.int64)
    local = np.full(target.shape, -1, np.int64)
    for part, offset in ((inside, 0), (beyond, len(inside))):
        position = np.minimum(np.searchsorted(part, target), len(part) - 1)
        known = part[position] == target
        local[known] = position[known] + offset
    own = np.arange(len(states))[:, None]
    return np.where(local < 0, own, local).astype(np.uint32), beyond
