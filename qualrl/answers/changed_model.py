"""A model with something changed: doorways closed, a wall opened, other numbers."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qualrl.answers.depth import Depth
from qualrl.errors import NoPlanError, SettingError, UnknownNameError, did_you_mean
from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP, hybrid_mdp
from qualrl.spatial.passage import Passage, thinnest_passages, with_passage
from qualrl.spatial.place import PlaceCell
from qualrl.spatial.region_map import RegionMap


@dataclass(frozen=True)
class Change:
    """What was done to a model, in words."""

    brief: str
    """Without numbers."""
    words: str

    def in_words(self, depth: Depth) -> str:
        """With numbers or without."""
        return depth.at_numbers(self.words, self.brief)


def set_to(key: str, words: str) -> Change:
    """A number or setting that was changed."""
    return Change(f"{key} changed", words)


def doors_named(regions: RegionMap, names: Iterable[str]) -> tuple[str, ...]:
    """Doorways by name; a region's name means all of its doorways.  Raises UnknownNameError."""
    doors: dict[str, tuple[str, ...]] = {door.name: (door.name,) for door in regions.doorways}
    for at, region in enumerate(regions.regions):
        doors[region.name] = tuple(door.name for door in regions.doorways if at in door.pair)
    found = list[str]()
    for name in names:
        if name not in doors:
            raise UnknownNameError(regions.why_not(name, "no doorway or region", doors))
        found += doors[name]
    return tuple(dict.fromkeys(found))


def with_opened(model: HybridMDP, pair: tuple[str, str], start: int) -> tuple[HybridMDP, int, Change]:
    """The model with the thinnest wall between two regions opened where that is best for the way from a state.

    Gives the model, the state's new number (there are more states then), and what was done.
    Raises UnknownNameError, and NoPlanError where no straight passage joins the two and nothing else.
    """
    regions = model.regions
    assert regions is not None
    one, other = _regions_named(regions, pair)
    found = thinnest_passages(regions, one, other)
    if not found:
        raise NoPlanError(f"no wall to open lies between {pair[0]} and {pair[1]}: in no row or column do they face")
    passage = _best(model, found, start)
    opened, name = with_passage(regions, passage)
    row, column = passage.cells[0]
    cells = "1 cell" if len(passage.cells) == 1 else f"{len(passage.cells)} cells"
    wall_m = len(passage.cells) * regions.grid.resolution_m
    brief = f"{name} opened from {pair[0]} to {pair[1]}"
    words = f"{brief} ({cells}, {wall_m:.2f} m of wall from row {row}, column {column})"
    changed = _on(model, opened)
    return changed, int(changed.grid.state_of[model.cell_of(start)]), Change(brief, words)


def _regions_named(regions: RegionMap, pair: tuple[str, str]) -> tuple[int, int]:
    for name in pair:
        if name not in regions.region_names:
            raise UnknownNameError(regions.why_not(name, "no region", regions.region_names))
    if pair[0] == pair[1]:
        raise SettingError(f"{pair[0]} and {pair[1]} are the same region: no wall lies between")
    return regions.region_names.index(pair[0]), regions.region_names.index(pair[1])


def _best(model: HybridMDP, found: list[Passage], start: int) -> Passage:
    """The passage by which the shortest way is shortest, of equal ones the first."""
    world = model.grid
    from_start = np.full(len(world), np.inf)
    order, steps = breadth_first(world.successor, np.array([start]))  # every step leads back too
    from_start[order] = steps[order]
    to_goal = np.where(world.steps_to_goal >= 0, world.steps_to_goal, np.inf)

    def steps_by(passage: Passage) -> float:
        here, there = (int(world.state_of[end]) for end in passage.ends)
        return float(min(from_start[here] + to_goal[there], from_start[there] + to_goal[here]))

    return min(found, key=steps_by)


def _on(model: HybridMDP, regions: RegionMap) -> HybridMDP:
    """The same problem on another map."""
    world = model.grid
    start = None if model.start is None else PlaceCell(*model.cell_of(model.start))
    other = hybrid_mdp(
        regions, PlaceCell(*world.goal_cell), start=start, gamma=world.gamma, slip=world.slip,
        directions=world.directions, step_reward=world.step_reward, goal_reward=world.goal_reward,
        levels=len(model.levels) + 1,
    )  # fmt: skip
    return replace(other, world=replace(other.grid, closed=world.closed))


def with_numbers(model: HybridMDP, **numbers: float) -> HybridMDP:
    """The model with other numbers: gamma, slip, directions, step_reward, goal_reward.  Raises SettingError."""
    known = ("gamma", "slip", "directions", "step_reward", "goal_reward")
    for name in numbers:
        if name not in known:
            raise SettingError(f"no number of a model is called {name!r}; {did_you_mean(name, known)}")
    changed: dict[str, Any] = numbers
    return replace(model, world=replace(model.grid, **changed))
