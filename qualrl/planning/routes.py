"""Ways between any two places of a map, many times: first which regions to go through, then the cells.

The walks between the gates of each region are measured once.  A question then costs walks over the regions of its two
ends, a search over the doorways (``gate_graph`` says why what comes out is not much longer than the shortest way), and
a walk over the cells of the regions on the way, not over the whole map.  Where an end lies in a vast region, some way
is found first, from the gates that are nearest, and cells that cannot be on a shorter one are not walked over.
"""

from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qualrl.errors import NoPlanError
from qualrl.kernels import routing
from qualrl.planning.gate_graph import GateGraph, too_long
from qualrl.planning.gates import apart, boxes_of, gates_of, straight
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.place import PlaceLike, read_place, resolve_cell
from qualrl.spatial.region_map import RegionMap

MOST = 2**30
"""Steps are counted up to this many; then ``seen`` begins anew."""
WALKED = 20_000_000
"""Where a region's gates times its cells are more, the steps between its gates are added up from gate to gate."""

VAST = 50_000
"""A region of more cells is walked over only where a shorter way than one that is known may lead."""

Ints = NDArray[np.int32]


class Bound(NamedTuple):
    """What a walk is not for: ways of more than ``most`` steps that go on from it to a cell (a flat index)."""

    cell: int
    most: int


UNBOUND = Bound(0, MOST)


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
            base = self._walked(source, target, exact)
            if self._seen[self._flat(source)] < base:
                raise NoPlanError(f"no way leads from {places[0]} to {places[1]}")
            path = routing.way_back(self._label, self._seen, base, self._flat(source))
        return self._described(path)

    def _flat(self, cell: Cell) -> int:
        return cell[0] * int(self._label.shape[1]) + cell[1]

    def _walk(
        self, allowed: NDArray[np.bool_], sources: ArrayLike, targets: ArrayLike, bound: Bound = UNBOUND,
        enough: int | None = None,
    ) -> int:  # fmt: skip
        """Walk from cells until enough of the targets are reached, by default all; the base of what was seen."""
        if self._base > MOST:
            self._seen[:], self._base = 0, 1
        base: int = self._base
        ends = np.asarray(sources, np.int32), np.asarray(targets, np.int32)
        enough = ends[1].size if enough is None else enough
        self._base += routing.walk(self._label, allowed, *ends, enough, *bound, self._seen, base, *self._scratch)
        return base

    def _only(self, *numbers: int) -> NDArray[np.bool_]:
        """(R,) these regions, and no others."""
        own = np.zeros(len(self.regions.regions), np.bool_)
        own[[*numbers]] = True
        return own

    def _to_gates(self, region: int, cells: ArrayLike, bound: Bound = UNBOUND) -> tuple[Ints, Ints]:
        """(K,) steps from cells of a region to the middles of its gates, and to their nearest cells; -1 if no way.

        The nearest of the cells counts, and no step leaves the region.
        """
        gates, at = self._gates, slice(*self._gates.first[region : region + 2].tolist())
        first = gates.cell_first[at.start : at.stop + 1]
        ends = gates.cells[first[0] : first[-1]]
        base = self._walk(self._only(region), cells, np.unique(ends), bound)
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

    def _walked(self, source: Cell, target: Cell, exact: bool) -> int:
        """Walk from the target to the source by a way as ``between`` tells it; the base of what was seen."""
        start, goal = int(self._label[source]), int(self._label[target])
        here, there = self._flat(source), self._flat(target)
        most = self._known(source, target)
        allowed = self._only(start, goal)
        if start == goal:
            base = self._walk(allowed, [there], [here], Bound(here, most))
            direct = int(self._seen[here]) - base
            if direct >= 0 and too_long(direct, exact) <= abs(source[0] - target[0]) + abs(source[1] - target[1]):
                return base
            most = direct if direct >= 0 else most + 1
        else:
            most += 1
        first = routing.End(*source, start, *self._to_gates(start, [here], Bound(there, most)))
        last = routing.End(*target, goal, *self._to_gates(goal, [there], Bound(here, most)))
        wanted, most = self.graph.on_the_way(first, last, most, exact)
        return self._walk(allowed | wanted, [there], [here], Bound(here, most))

    def _known(self, source: Cell, target: Cell) -> int:
        """How long the way is at most, if that is worth finding out beforehand; else MOST."""
        ends = [(cell, int(self._label[cell])) for cell in (source, target)]
        if all(self.regions.regions[region].cells <= VAST for _, region in ends):
            return MOST
        first, last = (routing.End(*cell, region, *(self._by_nearest(region, cell),) * 2) for cell, region in ends)
        most = MOST
        if first.region == last.region:
            reached = np.minimum(first.middle, last.middle) >= 0
            most = int((first.middle + last.middle)[reached].min(initial=MOST))
        return self.graph.on_the_way(first, last, most, exact=True)[1]

    def _by_nearest(self, region: int, cell: Cell) -> Ints:
        """(K,) steps of some walk from a cell of a region to the middles of its gates, by the nearest; -1 if no way."""
        gates, at = self._gates, slice(*self._gates.first[region : region + 2].tolist())
        middles = gates.cell[at]
        if not len(middles):
            return middles
        base = self._walk(self._only(region), [self._flat(cell)], np.unique(middles), enough=1)
        nearest = int(self._seen[middles].argmax())
        row = int(gates.row[at.start + nearest])
        onward = self.graph.steps[row : row + len(middles)]
        return np.where(onward < 0, -1, self._seen[middles[nearest]] - base + onward)

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
