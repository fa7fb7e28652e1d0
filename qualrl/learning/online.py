"""Learning without a map: the robot sees what is near, and finds regions, doorways and landmarks as it goes.

S states.  States are numbered by the true map, so what was learned of them stays; only the qualitative level is found
anew.  States not seen yet make up a region of their own, "unknown", that touches every region seen to go on.  The goal
is a landmark once it was seen.  Nothing here is seen at once: the robot looks around at all places it has visited
since it looked last, every so many steps.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.learning.growth import Growth, Stage
from qualrl.learning.learner import NO_LIMIT, Exploring
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import Milestone, Runner, start_learner
from qualrl.models.hybrid_mdp import HybridMDP, landmarks_of_map
from qualrl.qualitative.graph import Graph, graph_of_regions
from qualrl.spatial.footprint import cut_to
from qualrl.spatial.growing import KeptNames
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.segmentation import segment
from qualrl.spatial.sensing import KnownMap

UNKNOWN = "unknown"
MOST_WAITS = 16
"""It looks at least once in so many times ``every`` steps, unless there is nothing left to see."""


@dataclass(frozen=True)
class Online:
    """What a robot that does not know the map is told.  Raises SettingError for a number out of its range."""

    radius_m: float = 4.0
    """How far it sees, all around."""
    growth: float = 0.1
    """Regions are found anew when the known free space has grown by this share since, or when the goal is seen."""
    every: int | None = None
    """It looks around after so many steps, and after twice as many each time that nothing new was seen; None = a
    hundredth of the map's free cells, but from 10 to 1000."""

    def __post_init__(self) -> None:
        if not self.growth > 0:
            raise SettingError(f"growth must be above 0, got {self.growth}")
        if self.every is not None and not self.every >= 1:
            raise SettingError(f"every must be at least 1, got {self.every}")


def train_online(
    model: HybridMDP,
    algorithm: str,
    settings: LearnSettings,
    online: Online,
    seed: int = 0,
    watch: Callable[[Milestone], None] | None = None,
    find: Callable[[OccupancyGrid], RegionMap] = segment,
) -> LearningRun:
    """Run a learner that starts without a map.  model: the true one, with a start; find: how regions are found.

    Raises UnknownNameError, NoPlanError, or SettingError for a learner that cannot do without a map.
    """
    begun = time.perf_counter()
    explorer = _Explorer(model, online, find)
    learner = start_learner(explorer.model, algorithm, settings, seed)
    if not isinstance(learner, Exploring):
        raise SettingError(f"{algorithm} walks by ways found on the map, so it cannot do without one")
    every = int(np.clip(len(model) // 100, 10, 1000)) if online.every is None else online.every
    runner, wait = Runner(learner, watch), every
    while runner.episode < settings.episodes:
        runner.steps(wait)
        saw = explorer.look_around(learner.visited())
        longest = MOST_WAITS * every if explorer.has_more else NO_LIMIT
        wait = every if saw else min(2 * wait, longest)
        if explorer.is_due(finished=runner.episode >= settings.episodes):
            explorer.find_anew(runner.total, runner.episode)
            learner.change_levels(explorer.model)
    learned, progress = learner.learned(), learner.progress
    return LearningRun(
        model, algorithm, seed, settings, progress.steps, progress.returns, learned.q, np.empty(0),
        np.empty(0, np.int64), time.perf_counter() - begun, learned.shifted_q, growth=explorer.growth(),
        visits=learned.visits,
    )  # fmt: skip


class _Explorer:
    """What the robot knows of the map, and the model it makes of that."""

    def __init__(self, truth: HybridMDP, online: Online, find: Callable[[OccupancyGrid], RegionMap]) -> None:
        if truth.regions is None:
            raise SettingError("a model without a map cannot be explored")
        if truth.start is None:
            raise SettingError("a robot that does not know the map needs a start, to look around from")
        self._truth, self._online, self._find = truth, online, find
        self._known = KnownMap(truth.regions.grid, online.radius_m)
        self._stages = list[Stage]()
        self._snapshots = list[RegionMap]()
        self._names = KeptNames()
        self.look_around(np.zeros(len(truth), np.bool_))
        self.find_anew(0, 0)

    def look_around(self, visited: NDArray[np.bool_]) -> bool:
        """Look around at the start and at the states (S,) visited; whether free space was seen for the first time."""
        cells = self._truth.grid.cells[visited]
        places = np.zeros(self._known.seen.shape, np.bool_)
        places[cells[:, 0], cells[:, 1]] = True
        places[self._truth.cell_of(self._truth.start or 0)] = True
        before = self._free_cells
        self._known.look_from(places)
        return self._free_cells > before

    def is_due(self, finished: bool) -> bool:
        """Whether enough was seen to find regions anew; for the last time, anything new is enough."""
        last = self._stages[-1]
        grown = self._free_cells > last.known_cells * (1.0 if finished else 1.0 + self._online.growth)
        return grown or self._knows_goal != last.knows_goal

    def find_anew(self, steps: int, episode: int) -> None:
        """Find regions, doorways and landmarks on the map as known by now."""
        found = self._find(self._known.grid())
        radius_m = self._known.truth.radius_m
        if radius_m:  # whether it fits on a cell, it knows as soon as it sees the cell
            found = replace(cut_to(self._known.free, found, radius_m), lost=())
        found = self._regions = self._names.apply(found)
        self.model = known_model(self._truth, found, self._known)
        counts = self._free_cells, len(found.regions), len(found.doorways), len(found.landmarks)
        self._stages.append(Stage(steps, episode, *counts, self._knows_goal))
        if not self._snapshots or self._free_cells >= 2 * self._snapshots[-1].grid.free.sum():
            self._snapshots.append(found)

    def growth(self) -> Growth:
        """The record so far."""
        shown = self._snapshots if self._snapshots[-1] is self._regions else [*self._snapshots, self._regions]
        return Growth(tuple(self._stages), len(self._truth), self._regions, tuple(shown))

    @property
    def has_more(self) -> bool:
        """Whether there may be more to see."""
        return bool(self._known.frontier.any())

    @property
    def _free_cells(self) -> int:
        return int(self._known.free.sum())

    @property
    def _knows_goal(self) -> bool:
        return bool(self._known.seen[self._truth.grid.goal_cell])


def known_model(truth: HybridMDP, regions: RegionMap, known: KnownMap) -> HybridMDP:
    """The model with the qualitative level of the map as known; the metric level is the true one."""
    world = truth.grid
    label = regions.label[world.free]
    region_of = np.where(label < 0, len(regions.regions), label).astype(np.int32)
    goal_region = int(label[world.goal]) if known.seen[world.goal_cell] else None
    return replace(
        truth,
        region_names=(*regions.region_names, UNKNOWN),
        region_of=region_of,
        landmarks=landmarks_of_map(world, regions, goal_region),
        own_graph=_with_unknown(graph_of_regions(regions), regions, known),
        regions=regions,
        coarser=(),
    )


def _with_unknown(graph: Graph, regions: RegionMap, known: KnownMap) -> Graph:
    """The graph with what is not known as one more node, beside every region that goes on into it.

    Two edges lead there from a region: it may be left into the unknown and come back to from there.
    """
    wider: Graph = nx.MultiDiGraph(graph)
    wider.add_node(UNKNOWN, kind=UNKNOWN)
    for region in np.unique(regions.label[known.frontier]).tolist():
        name = regions.region_names[region]
        for here, there in ((name, UNKNOWN), (UNKNOWN, name)):
            for key in (UNKNOWN, f"{UNKNOWN} again"):
                wider.add_edge(here, there, key=key, relation="adjacent")
    nx.freeze(wider)
    return wider
