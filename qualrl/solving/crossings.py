"""Where a walk leaves one part of the world and enters another: the steps, and the doors they lead through.

S states, C crossings, B parts (regions, or wings: any partition of the states), X exits.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.levels import QualitativeLevel
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.region_map import RegionMap

TO_GOAL = "walk to the goal"


@dataclass(frozen=True, eq=False)
class Crossings:
    """Every step that can happen from one part to another, and its exit: on a map a doorway."""

    level: QualitativeLevel
    source: NDArray[np.int64]
    """(C,) state before the step; sorted, with ``target`` second."""
    target: NDArray[np.int64]
    """(C,) state after it."""
    exit_of: NDArray[np.int32]
    """(C,) index of the exit."""
    exit_names: tuple[str, ...]
    """(X,) names of doorways, or "room A to room B" where there is no map or no doorway."""
    has_doors: bool

    @cached_property
    def entries(self) -> NDArray[np.int64]:
        """States by which some part is entered, in rising order."""
        return np.unique(self.target)

    @cached_property
    def entered_by(self) -> NDArray[np.int32]:
        """Exit by which each of ``entries`` is entered; the first of them where there are several."""
        order = np.lexsort((self.exit_of, self.target))
        first = np.unique(self.target[order], return_index=True)[1]
        found: NDArray[np.int32] = self.exit_of[order][first]
        return found

    def exits_from(self, part: int) -> list[int]:
        """The exits that lead out of a part."""
        return [int(x) for x in np.unique(self.exit_of[self.level.part_of[self.source] == part])]

    def exit_at(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int32]:
        """Exit of each given step; -1 for one that stays in its part."""
        if not len(self.source):
            return np.full(len(source), -1, np.int32)
        n = len(self.level.part_of)
        keys, asked = self.source * n + self.target, source * n + target
        at = np.minimum(np.searchsorted(keys, asked), len(keys) - 1)
        return np.where(keys[at] == asked, self.exit_of[at], -1).astype(np.int32)

    def action_name(self, part: int, exit_index: int) -> str:
        """What to call leaving a part by an exit."""
        name = self.exit_names[exit_index]
        if not self.has_doors or name.startswith("the border"):
            return f"move from {name}" if not self.has_doors else f"step over {name}"
        here = (self.exit_of == exit_index) & (self.level.part_of[self.source] == part)
        there = self.level.part_of[self.target[np.flatnonzero(here)[0]]]
        return f"go through {name} to {self.level.names[there]}"


def crossings(model: HybridMDP, level: QualitativeLevel | None = None) -> Crossings:
    """The crossings of a level; by default of the regions."""
    level = level or model.levels[0]
    source, target = _steps_between(model, level.part_of)
    if model.regions is not None:
        names, of = _doors_of(model, model.regions, source, target)
    else:
        names, of = _ordered_pairs(model, source, target)
    return Crossings(level, source, target, of, names, model.regions is not None)


def _steps_between(model: HybridMDP, part_of: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All possible steps between parts, sorted and each once."""
    world = model.world
    if isinstance(world, GridWorld):
        rows, moves = np.nonzero(part_of[world.successor] != part_of[:, None])
        source, target = rows, world.successor[rows, moves].astype(np.int64)
        kept = source != world.goal
    else:
        source, target = world.source, world.target.astype(np.int64)
        kept = (world.probability > 0) & ~world.terminal[source] & (part_of[source] != part_of[target])
    found = np.unique(np.stack([source[kept], target[kept]]), axis=1)
    return found[0].astype(np.int64), found[1].astype(np.int64)


def _ordered_pairs(
    model: HybridMDP, source: NDArray[np.int64], target: NDArray[np.int64]
) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """Without a map an exit is an ordered pair of regions."""
    count, names = len(model.region_names), model.region_names
    keys, of = np.unique(
        model.region_of[source].astype(np.int64) * count + model.region_of[target], return_inverse=True
    )
    return tuple(f"{names[k // count]} to {names[k % count]}" for k in keys.tolist()), of.ravel().astype(np.int32)


def _doors_of(
    model: HybridMDP, regions: RegionMap, source: NDArray[np.int64], target: NDArray[np.int64]
) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """On a map an exit is a doorway.

    A diagonal step may pass beside a doorway's cells: it belongs to the nearest one between its two regions, and
    where these touch at a corner only, so that they have none, to their border.
    """
    state_of = model.grid.state_of
    door_of: dict[tuple[int, int], int] = {}
    middles: dict[tuple[int, int], list[tuple[int, NDArray[np.float64]]]] = {}
    for index, door in enumerate(regions.doorways):
        steps = crossings_of(regions, door)
        for one, other in steps:
            ends = int(state_of[one]), int(state_of[other])
            door_of[ends] = door_of[ends[::-1]] = index
        middles.setdefault(door.pair, []).append((index, np.array(steps, np.float64).mean(axis=1)))
    names = [door.name for door in regions.doorways]
    of = np.empty(len(source), np.int32)
    for i, (s, t) in enumerate(zip(source.tolist(), target.tolist(), strict=True)):
        index = door_of.get((s, t), -1)
        if index < 0:
            here, there = int(model.region_of[s]), int(model.region_of[t])
            pair = (min(here, there), max(here, there))
            middle = (model.grid.cells[s] + model.grid.cells[t]) / 2
            near = [(float(np.abs(m - middle).sum(axis=1).min()), x) for x, m in middles.get(pair, [])]
            index = min(near)[1] if near else _border(names, model, pair)
        of[i] = index
    return tuple(names), of


def _border(names: list[str], model: HybridMDP, pair: tuple[int, int]) -> int:
    """Index of the exit of two regions without a doorway; it is added where it is new."""
    name = f"the border of {model.region_names[pair[0]]} and {model.region_names[pair[1]]}"
    if name not in names:
        names.append(name)
    return names.index(name)
