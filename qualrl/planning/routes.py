"""Ways between any two places of a map, many times: first which regions to go through, then the cells.

A walk between the gates of each region is measured once.  A question then costs a search over the doorways, and one
over the cells of the regions on the way, not over the whole map.
"""

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import NoPlanError
from qualrl.kernels import routing
from qualrl.qualitative.graph import crossings_of
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
        self._gates = _gates(regions)
        self._steps = self._between_gates()
        self._pairs = np.array([door.pair for door in regions.doorways], np.int64).reshape(-1, 2)
        """(D, 2) the regions that each doorway joins."""
        self._doors = {pair: [door for door in regions.doorways if door.pair == pair] for pair in _pairs(regions)}

    def between(self, start: PlaceLike, goal: PlaceLike, *, exact: bool = False) -> Route:
        """The shortest way through the regions that the shortest way through the middles of doorways takes.

        exact: the shortest way of all, by a search over the whole map.  Start and goal: names, [row, column], or
        [x, y] in metres.  Raises NoPlanError, UnknownNameError or PlaceError.
        """
        places = read_place(start), read_place(goal)
        source, target = (resolve_cell(place, self.regions) for place in places)
        with self._turn:
            allowed, most = self._on_the_way(source, target)
            if exact:
                allowed[:] = True
            base = self._walk(allowed, target, np.array([self._flat(source)], np.int32), most)
            if self._seen[self._flat(source)] < base:
                raise NoPlanError(f"no way leads from {places[0]} to {places[1]}")
            path = routing.way_back(self._label, self._seen, base, self._flat(source))
        return self._described(path)

    def _flat(self, cell: Cell) -> int:
        return cell[0] * int(self._label.shape[1]) + cell[1]

    def _walk(self, allowed: NDArray[np.bool_], source: Cell, targets: Ints, most: int = MOST) -> int:
        """Walk from a cell until all targets are reached; the base of what was seen.  most: see ``routing.walk``."""
        if self._base > MOST:
            self._seen[:], self._base = 0, 1
        base: int = self._base
        self._base += routing.walk(
            self._label, allowed, self._flat(source), targets, most, self._seen, base, *self._scratch
        )
        return base

    def _to_gates(self, cell: Cell) -> Ints:
        """(K,) steps from a cell to the gates of its region without leaving it; -1 where there is no way."""
        region = int(self._label[cell])
        own = np.zeros(len(self.regions.regions), np.bool_)
        own[region] = True
        gates = self._gates.cell[self._gates.first[region] : self._gates.first[region + 1]]
        base = self._walk(own, cell, np.unique(gates))
        found = self._seen[gates] - base
        return np.where(found >= 0, found, -1).astype(np.int32)

    def _between_gates(self) -> Ints:
        """Steps from each gate to all gates of its region, one after the other."""
        width, first = self._label.shape[1], self._gates.first
        found = [np.zeros(0, np.int32)]
        owner: Ints | None = None
        for region, cells in enumerate(np.split(self._gates.cell, first[1:-1])):
            if len(cells) * self.regions.regions[region].cells <= WALKED:
                found += [self._to_gates(divmod(cell, width)) for cell in cells.tolist()]
                continue
            owner = np.full(self._label.size, -1, np.int32) if owner is None else owner
            found.append(self._over_neighbours(cells, owner))
        return np.concatenate(found)

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

    def _on_the_way(self, source: Cell, target: Cell) -> tuple[NDArray[np.bool_], int]:
        """(R,) the regions that the way is looked for in, and how long it is at most."""
        start, goal = int(self._label[source]), int(self._label[target])
        allowed = np.zeros(len(self.regions.regions), np.bool_)
        allowed[[start, goal]] = True
        leave, arrive = self._to_gates(source), self._to_gates(target)
        most = MOST
        if start == goal:
            base = self._walk(allowed, target, np.array([self._flat(source)], np.int32))
            direct = int(self._seen[self._flat(source)]) - base
            most = direct if direct >= 0 else MOST
        most, through = routing.through_gates(self._gates, self._steps, leave, arrive, start, goal, most)
        allowed[through] = True
        # Middles of wide doorways mislead by a few steps: what lies between regions on the way may be a short cut.
        inside = allowed[self._pairs]
        beside = np.bincount(self._pairs[:, ::-1][inside], minlength=len(allowed))
        return allowed | (beside >= 2), int(most)

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


def _gates(regions: RegionMap) -> routing.Gates:
    """The gates of a map, each at the step through its doorway that lies nearest the middle."""
    width = regions.label.shape[1]
    found = []
    for number, door in enumerate(regions.doorways):
        middle = np.array(door.midpoint)
        crossing = min(crossings_of(regions, door), key=lambda ends: float(np.abs(np.array(ends) - middle).sum()))
        for region, (row, column) in zip(door.pair, crossing, strict=True):
            found.append((region, number, row * width + column))
    found.sort()
    sides: dict[int, list[int]] = {}
    for at, (_, number, _) in enumerate(found):
        sides.setdefault(number, []).append(at)
    partner = np.zeros(len(found), np.int32)
    for one, other in sides.values():
        partner[[one, other]] = other, one
    region_of = np.array([region for region, _, _ in found], np.int32)
    first = np.searchsorted(region_of, np.arange(len(regions.regions) + 1)).astype(np.int64)
    row_length = np.diff(first)[region_of]
    return routing.Gates(
        first, np.array([cell for _, _, cell in found], np.int32), region_of, partner,
        (np.cumsum(row_length) - row_length).astype(np.int64),
    )  # fmt: skip
