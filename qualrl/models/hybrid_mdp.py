"""The hybrid MDP: a metric world, the named regions over it, and the landmarks that tie the two (Definition 3).

S states, A actions of the lower level (HS = QS + S, HA = QA + A in the paper's words); the qualitative
states QS are the nodes of ``graph``, the qualitative actions QA its edges.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import NoPlanError, SettingError, UnknownNameError, did_you_mean
from qualrl.kernels.bands import in_bands
from qualrl.models.grid_world import GridWorld
from qualrl.models.landmarks import LandmarkLevel, landmark_level
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.qualitative.graph import Graph, crossings_of, graph_of_mapping, graph_of_regions
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.place import Place, resolve_cell
from qualrl.spatial.region_map import CENTRE, RegionMap

if TYPE_CHECKING:
    from qualrl.models.definitions import HybridDefinition
    from qualrl.models.levels import Grouping, QualitativeLevel
    from qualrl.models.semi_mdp import SemiMDP
    from qualrl.models.task_graph import TaskGraph

GOAL = "goal"
REGIONS_ON_GRID = 2
"""The least number of levels: the metric level and the regions."""
NOTHING_TO_LEARN = "start and goal are the same, so there is nothing to learn; choose another start"


@dataclass(frozen=True, eq=False, repr=False)
class HybridMDP:
    """Both levels of a problem, ready to be learned, solved and planned on."""

    world: GridWorld | TabularMDP
    """The lower, quantitative level."""
    region_names: tuple[str, ...]
    """Names of the qualitative states."""
    region_of: NDArray[np.int32]
    """(S,) index of the qualitative state each state belongs to."""
    landmarks: LandmarkLevel
    own_graph: "Graph | None"
    """The graph of a model that has more to it than the doorways of its map, or no map; else None."""
    start: int | None
    """State in which every episode starts; None = a random one each time."""
    regions: RegionMap | None = None
    """The map this was built from; None for a model that came without one."""
    coarser: "tuple[Grouping, ...]" = ()
    """Levels above the regions, each a grouping of the one below: none, or wings, or wings and floors."""
    tasks: "TaskGraph | None" = None
    """A task graph of the user's own, for MAXQ-Q; None for that of the landmarks."""

    @classmethod
    def from_table(
        cls, mdp: TabularMDP, region_of: Mapping[int, str] | Sequence[str], start: int | None = None
    ) -> "HybridMDP":
        """A hybrid MDP without a map: any tabular MDP, and the name of the qualitative state of each state.

        Landmarks are the states by which one qualitative state is entered from another.
        """
        names_of = [region_of[s] for s in range(len(mdp))] if isinstance(region_of, Mapping) else list(region_of)
        if len(names_of) != len(mdp):
            raise SettingError(
                f"{len(names_of)} qualitative states named for {len(mdp)} states; every state needs one, the end that "
                f"from_gymnasium may add included: [... for state in range(len(table))]"
            )
        names = tuple(dict.fromkeys(names_of))
        index = {name: i for i, name in enumerate(names)}
        of = np.array([index[name] for name in names_of], np.int32)
        landmarks, crossings = _entries(mdp, of, names)
        return cls(mdp, names, of, landmarks, graph_of_mapping(names, crossings), start)

    def __len__(self) -> int:
        return len(self.world)

    def __repr__(self) -> str:
        """In a line, not all its arrays."""
        start = "a random start" if self.start is None else f"start {self.start}"
        counts = f"{len(self)} states, {len(self.region_names)} regions, {len(self.landmarks.names)} landmarks"
        return f"<HybridMDP: {counts}, gamma {self.gamma:g}, {start}>"

    @property
    def gamma(self) -> float:
        """Discount of one step."""
        return self.world.gamma

    @property
    def grid(self) -> GridWorld:
        """The grid world; SettingError for a model that came without a map."""
        if not isinstance(self.world, GridWorld):
            raise SettingError("this model was built without a map")
        return self.world

    @cached_property
    def can_reach(self) -> NDArray[np.bool_]:
        """(S,) whether some way leads from a state to the goal."""
        if isinstance(self.world, GridWorld):
            return self.world.steps_to_goal >= 0
        return _can_reach(self.world)

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """States in which episodes start.

        Raises NoPlanError when the goal cannot be reached from them, SettingError for a start at which all is over.
        """
        world = self.world
        over = np.arange(len(self)) == world.goal if isinstance(world, GridWorld) else world.terminal
        if self.start is not None:
            if over[self.start]:
                raise SettingError(NOTHING_TO_LEARN)
            self.check_reachable(self.start)
            return np.array([self.start])
        starts = np.flatnonzero(self.can_reach & ~over)
        if not len(starts):
            raise NoPlanError("the goal is the only place that leads to the goal")
        return starts

    def definition(self, upper: "SemiMDP") -> "HybridDefinition":
        """The hybrid MDP as Definition 3 writes it, to be looked at.

        upper: the semi-MDP of its qualitative level, from ``solving.theorem1`` or ``solving.fold``.
        """
        from qualrl.models.definitions import HybridDefinition  # SciPy loads slowly, and learning needs none

        table = self.world.table() if isinstance(self.world, GridWorld) else self.world
        names = tuple(self.describe(state) for state in range(len(self)))
        return HybridDefinition(upper, table, names, self.landmarks.names, self.landmarks.landmark_of)

    def check_reachable(self, state: int) -> None:
        """Raise NoPlanError when no way leads from a state to the goal."""
        if not self.can_reach[state]:
            advice = "" if self.regions is None else "; 'qualrl why-unreachable' tells what is in the way"
            raise NoPlanError(
                f"no way leads from {self.describe(state)} to the goal: it can be reached from "
                f"{int(self.can_reach.sum())} of the {len(self)} states, and this is not one of them{advice}"
            )

    def describe(self, state: int) -> str:
        """A state in words: its region, and its cell when there is a map."""
        name = self.region_names[self.region_of[state]]
        if isinstance(self.world, GridWorld):
            row, column = self.world.cells[state]
            return f"{name} (row {row}, column {column})"
        return f"{self.world.state_names[state] if self.world.state_names else f'state {state}'} in {name}"

    @cached_property
    def graph(self) -> Graph:
        """Frozen networkx graph: a node a qualitative state, an edge a qualitative action."""
        if self.own_graph is not None:
            return self.own_graph
        assert self.regions is not None
        return graph_of_regions(self.regions)

    @cached_property
    def levels(self) -> "tuple[QualitativeLevel, ...]":
        """The qualitative levels, finest first: regions, and what ``coarser`` makes of them (paper, Figure 2)."""
        from qualrl.models.levels import QualitativeLevel, coarser_level  # networkx loads slowly, for few runs

        members: tuple[tuple[str, ...], ...] = ((),) * len(self.region_names)
        found = [QualitativeLevel(self.region_names, self.region_of, members, self.graph, self.landmarks)]
        for grouping in self.coarser:
            found.append(coarser_level(found[-1], grouping))
        return tuple(found)

    def grouped(self, groups: Mapping[str, str]) -> "HybridMDP":
        """The same model with one more level: the group's name of each part of the coarsest level."""
        from qualrl.models.levels import Grouping  # as above

        parts = self.levels[-1].names
        for name in groups:
            if name not in parts:
                raise UnknownNameError(f"no part is called {name!r}; {did_you_mean(name, parts)}")
        if missing := [name for name in parts if name not in groups]:
            raise SettingError(f"{missing[0]!r} is given no group; each of {', '.join(parts)} needs one")
        names = tuple(dict.fromkeys(groups[name] for name in parts))
        grouping = Grouping(names, tuple(names.index(groups[name]) for name in parts))
        return replace(self, coarser=(*self.coarser, grouping))

    def with_closed(self, doors: Iterable[str]) -> "HybridMDP":
        """The same model with doorways closed, by name: no move leads through, but every state stays as numbered.

        On its map and graph these doorways are walls; the landmarks there stay.
        Raises UnknownNameError.
        """
        if self.regions is None:
            raise SettingError("this model was built without a map: it has no doors to close")
        known = {door.name: door for door in self.regions.doorways}
        closed = []
        for name in dict.fromkeys(doors):
            if name not in known:
                raise UnknownNameError(self.regions.why_not(name, "no doorway", known))
            closed.append(known.pop(name))
        walls = [wall for door in closed for wall in crossings_of(self.regions, door)]
        regions = replace(self.regions, doorways=tuple(known.values()))
        world = replace(self.grid, closed=(*self.grid.closed, *walls))
        return replace(self, world=world, regions=regions, own_graph=None)

    def state_at(self, place: Place) -> int:
        """State of a place: a name, (row, column), or metres.  Raises UnknownNameError or PlaceError."""
        if self.regions is None:
            raise SettingError("this model was built without a map: give a state's number")
        return int(self.grid.state_of[resolve_cell(place, self.regions)])

    def cell_of(self, state: int) -> Cell:
        """(row, column) of a state."""
        row, column = self.grid.cells[state]
        return int(row), int(column)


def hybrid_mdp(
    regions: RegionMap,
    goal: Place,
    *,
    start: Place | None = None,
    gamma: float = 0.9,
    slip: float = 0.0,
    directions: int = 4,
    step_reward: float = -1.0,
    goal_reward: float = 100.0,
    levels: int = REGIONS_ON_GRID,
) -> HybridMDP:
    """The hybrid MDP of a map.  A region as start or goal means its centre; levels: see ``models.levels``."""
    world = GridWorld(regions.grid.free, resolve_cell(goal, regions), gamma, slip, directions, step_reward, goal_reward)
    start_state = None if start is None else int(world.state_of[resolve_cell(start, regions)])
    region_of = _of_free(regions.label, regions.grid.free)
    model = HybridMDP(
        world,
        regions.region_names,
        region_of,
        landmarks_of_map(world, regions, int(region_of[world.goal])),
        None,
        start_state,
        regions,
    )
    if levels == REGIONS_ON_GRID:
        return model
    from qualrl.models.levels import groupings  # networkx loads slowly, for few runs

    return replace(model, coarser=groupings(model.graph, levels))


def _of_free(label: NDArray[np.int32], free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(S,) the label (H, W) of each free cell (H, W), row by row."""
    return np.concatenate(in_bands(lambda top, bottom: label[top:bottom][free[top:bottom]], free.shape))


def landmarks_of_map(world: GridWorld, regions: RegionMap, goal_region: int | None) -> LandmarkLevel:
    """The landmarks of a map and the goal, which is one of its own; at no state while its region is not known (None).

    Where two share a cell, the later of this order keeps it: corners and the like, doorways, the goal.  Regions'
    centres are left out: most ways through a region pass beside its centre, so it joins nothing.
    """
    landmark_of = np.full(len(world), -1, np.int32)
    marks = [mark for mark in regions.landmarks if mark.kind != CENTRE]
    doorways_last = sorted(range(len(marks)), key=lambda index: marks[index].kind == "doorway")
    cells = np.concatenate([np.zeros((0, 2), np.int32), *(marks[index].cells for index in doorways_last)])
    sizes = [len(marks[index].cells) for index in doorways_last]
    landmark_of[world.state_of[cells[:, 0], cells[:, 1]]] = np.repeat(doorways_last, sizes)
    if goal_region is not None:
        landmark_of[world.goal] = len(marks)
    names = [mark.name for mark in marks] + [GOAL]
    joined = [mark.regions for mark in marks] + [() if goal_region is None else (goal_region,)]
    return landmark_level(names, landmark_of, joined)


Crossing = tuple[int, int]


def _entries(
    mdp: TabularMDP, region_of: NDArray[np.int32], names: tuple[str, ...]
) -> tuple[LandmarkLevel, list[Crossing]]:
    """Landmarks of a table, one for each ordered pair of regions that an outcome crosses, and those pairs."""
    possible = (mdp.probability > 0) & ~mdp.terminal[mdp.source]
    source, target = mdp.source[possible], mdp.target[possible].astype(np.int64)
    crossing = region_of[source] != region_of[target]
    pairs = np.stack([region_of[source[crossing]], region_of[target[crossing]]], axis=1)
    found, which = np.unique(pairs, axis=0, return_inverse=True)
    landmark_of = np.full(len(mdp), -1, np.int32)
    landmark_of[target[crossing][::-1]] = which.ravel()[::-1]  # the first crossing into a state names it
    landmark_of[mdp.terminal] = len(found)
    crossings = [(int(a), int(b)) for a, b in found]
    labels = [f"{names[a]} to {names[b]}" for a, b in crossings] + [GOAL]
    goal_regions = tuple(int(region) for region in np.unique(region_of[mdp.terminal]))
    return landmark_level(labels, landmark_of, [*crossings, goal_regions]), crossings


def _can_reach(mdp: TabularMDP) -> NDArray[np.bool_]:
    """(S,) whether a terminal state can be reached: a walk backwards over the outcomes that can happen."""
    import networkx as nx  # it loads slowly, and a map needs none

    backwards: nx.DiGraph[int] = nx.DiGraph()
    backwards.add_nodes_from(range(len(mdp)))
    possible = (mdp.probability > 0) & ~mdp.terminal[mdp.source]
    backwards.add_edges_from(zip(mdp.target[possible].tolist(), mdp.source[possible].tolist(), strict=True))
    reached = np.zeros(len(mdp), np.bool_)
    for layer in nx.bfs_layers(backwards, np.flatnonzero(mdp.terminal).tolist()):
        reached[layer] = True
    return reached
