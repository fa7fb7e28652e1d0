"""Ways between any two places of a map, many times: first which regions to go through, then the cells.

The walks between the gates of each region are measured once.  A question then costs walks over the regions of its two
ends, a search over the doorways (``gate_graph`` says why what comes out is not much longer than the shortest way), and
a walk over the cells of the regions on the way, not over the whole map.
"""

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qualrl.errors import NoPlanError
from qualrl.kernels import routing
from qualrl.planning.gate_graph import GateGraph
from qualrl.planning.gates import apart, boxes_of, gates_of, straight
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.place import PlaceLike, read_place, resolve_cell
from qualrl.spatial.region_map import RegionMap

MOST = 2**30
"""Steps are counted up to this many; then ``seen`` begins anew."""
WALKED = 20_000_000
"""Where a region's gates times its cells are more, the steps between its gates are added up from gate to gate."""

Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Route:
    """A way from cell to cell, in steps up, down, left and right."""

    path: Ints
    """(steps + 1, 2) rows and columns, start and goal included."""
    regions: tuple[str, ...]
    """Names of the regions in the order in which they are entered."""
    doors: tuple[str, ...]
    """Names of the doorways between them."""
    length_m: float

    @property
    def steps(self) -> int:
        """How many."""
        return len(self.path) - 1


class Routes:
    """Answers questions for ways on one map.  It may be asked from several threads, which take turns."""

    def __init__(self, regions: RegionMap) -> None:
        self.regions = regions
        self._label = np.ascontiguousarray(regions.label)
        self._seen = np.zeros(self._label.size, np.int32)
        self._scratch = np.empty(self._label.size, np.int32), np.zeros(self._label.size, np.bool_)
        self._base: int = 1
        self._turn = Lock()
        gates = gates_of(regions)
        boxes = boxes_of(gates, self._label.shape[1])
        self._gates = gates
        self.graph = GateGraph(gates, boxes, *self._between_gates(gates, boxes))
        self._doors = {pair: [door for door in regions.doorways if door.pair == pair] for pair in _pairs(regions)}

    def between(self, start: PlaceLike, goal: PlaceLike, *, exact: bool = False) -> Route:
        """A way that is at most 3 % longer than the shortest one, and mostly as short.

        exact: the shortest one.  Start and goal: names, [row, column], or [x, y] in metres.  See the module for why.
        Raises NoPlanError, UnknownNameError or PlaceError.
        """
        places = read_place(start), read_place(goal)
        source, target = (resolve_cell(place, self.regions) for place in places)
        with self._turn:
            base = self._walk(*self._on_the_way(source, target, exact), [self._flat(target)], [self._flat(source)])
            if self._seen[self._flat(source)] < base:
                raise NoPlanError(f"no way leads from {places[0]} to {places[1]}")
            path = routing.way_back(self._label, self._seen, base, self._flat(source))
        return self._described(path)

    def _flat(self, cell: Cell) -> int:
        return cell[0] * int(self._label.shape[1]) + cell[1]

    def _walk(self, allowed: NDArray[np.bool_], most: int, sources: ArrayLike, targets: ArrayLike) -> int:
        """Walk from cells until all targets are reached; the base of what was seen.  most: see ``routing.walk``."""
        if self._base > MOST:
            self._seen[:], self._base = 0, 1
        base: int = self._base
        ends = np.asarray(sources, np.int32), np.asarray(targets, np.int32)
        self._base += routing.walk(self._label, allowed, *ends, most, self._seen, base, *self._scratch)
        return base

    def _to_gates(self, region: int, cells: ArrayLike) -> tuple[Ints, Ints]:
        """(K,) steps from cells of a region to the middles of its gates, and to their nearest cells; -1 if no way.

        The nearest of the cells counts, and no step leaves the region.
        """
        own = np.zeros(len(self.regions.regions), np.bool_)
        own[region] = True
        gates, at = self._gates, slice(*self._gates.first[region : region + 2].tolist())
        first = gates.cell_first[at.start : at.stop + 1]
        ends = gates.cells[first[0] : first[-1]]
        base = self._walk(own, MOST, cells, np.unique(ends))
        if not len(ends):
            return ends, ends
        away = self._seen[ends] - base
        nearest = np.minimum.reduceat(np.where(away < 0, MOST, away), first[:-1] - first[0])
        return np.maximum(self._seen[gates.cell[at]] - base, -1), np.where(nearest < MOST, nearest, -1)

    def _between_gates(self, gates: routing.Gates, boxes: Ints) -> tuple[Ints, Ints]:
        """Steps from the middle of each gate to those of all gates of its region, one after the other; and the least.

        The least: from any cell of a gate to any of the other.  From a gate to itself 0, but -1 where going through
        the doorway and back is never shorter than staying.
        """
        found, least = [np.zeros(0, np.int32)], [np.zeros(0, np.int32)]
        back = np.where(straight(gates, self._label)[gates.partner], -1, 0)
        owner: Ints | None = None
        for region in range(len(self.regions.regions)):
            at = np.arange(*gates.first[region : region + 2])
            if len(at) * self.regions.regions[region].cells <= WALKED:
                found += [self._to_gates(region, gates.cell[[gate]])[0] for gate in at]
                parts = [self._to_gates(region, gates.cells[slice(*gates.cell_first[[g, g + 1]])])[1] for g in at]
                rows = np.reshape(parts, (len(at), len(at)))
            else:
                owner = np.full(self._label.size, -1, np.int32) if owner is None else owner
                found.append(self._over_neighbours(gates.cell[at], owner))
                rows = apart(boxes[:, at, None], boxes[:, None, at])
            np.fill_diagonal(rows, back[at])
            least.append(rows.ravel())
        return np.concatenate(found).astype(np.int32), np.concatenate(least).astype(np.int32)

    def _over_neighbours(self, cells: Ints, owner: Ints) -> Ints:
        """(K * K,) steps between the gates of a region, walking from gate to gate: hardly more than the least."""
        from scipy.sparse import csr_array  # it loads slowly, and only vast regions need it
        from scipy.sparse.csgraph import dijkstra

        pairs, steps = routing.nearest_gates(self._label, cells, owner, self._seen, self._scratch[0])
        self._seen[:], self._base = 0, 1
        of_cell = np.unique(cells, return_inverse=True)[1]  # gates may share a cell, of which the first stands for all
        first = np.unique(of_cell, return_index=True)[1][of_cell]
        order = np.lexsort((steps, *np.sort(pairs, axis=1).T))
        ends, shortest = np.unique(np.sort(pairs, axis=1)[order], axis=0, return_index=True)
        matrix = csr_array((steps[order][shortest], ends.T), shape=(len(cells), len(cells)))
        away = dijkstra(matrix, directed=False)[np.ix_(first, first)]
        return np.where(np.isfinite(away), away, -1).astype(np.int32).ravel()

    def _on_the_way(self, source: Cell, target: Cell, exact: bool) -> tuple[NDArray[np.bool_], int]:
        """(R,) the regions that the way is looked for in, and how long it is at most."""
        start, goal = int(self._label[source]), int(self._label[target])
        allowed = np.zeros(len(self.regions.regions), np.bool_)
        allowed[[start, goal]] = True
        most = MOST
        if start == goal:
            base = self._walk(allowed, MOST, [self._flat(target)], [self._flat(source)])
            direct = int(self._seen[self._flat(source)]) - base
            most = direct if direct >= 0 else MOST
        first = routing.End(*source, start, *self._to_gates(start, [self._flat(source)]))
        last = routing.End(*target, goal, *self._to_gates(goal, [self._flat(target)]))
        wanted, most = self.graph.on_the_way(first, last, most, exact)
        return allowed | wanted, most

    def _described(self, path: Ints) -> Route:
        label = self._label[path[:, 0], path[:, 1]]
        at = np.flatnonzero(np.diff(label))
        doors = []
        for step in at.tolist():
            pair = (int(label[step : step + 2].min()), int(label[step : step + 2].max()))
            ends = path[step : step + 2, None]
            doors.append(next(door.name for door in self._doors[pair] if (door.cells == ends).all(axis=2).any()))
        names = self.regions.region_names
        return Route(
            path, tuple(names[region] for region in [label[0], *label[at + 1]]), tuple(doors),
            (len(path) - 1) * self.regions.grid.resolution_m,
        )  # fmt: skip


def _pairs(regions: RegionMap) -> set[tuple[int, int]]:
    return {door.pair for door in regions.doorways}
