"""Names that stay while a map becomes known: what overlaps an old place most is called as it was."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from qualrl.spatial.naming import letters
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap


class KeptNames:
    """The names given so far on maps of one place.

    A name goes to the place that shares most cells with those it last stood for, among places of its kind: what was
    a room, looked like a corridor for a while and is a room again is called as before.  What is new gets a name that
    was never used.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._regions: dict[str, NDArray[np.int32]] = {}
        """By kind: (H, W) number of the name that a region there had last, -1 for none."""
        self._marks: dict[tuple[str, Cell], str] = {}
        """By kind and cell: the name of the landmark there."""

    def apply(self, found: RegionMap) -> RegionMap:
        """The same map with names kept, which it remembers."""
        shared = [*self._regions_shared(found), *self._marks_shared(found)]
        names, given = dict[str, str](), set[str]()
        for _, now, old in sorted(shared, key=lambda overlap: (-overlap[0], overlap[1:])):
            if now not in names and old not in given:
                names[now] = old
                given.add(old)
        count = Counter(map(_kind, self._names))
        for name in found.all_names:
            if name not in names:
                kind = _kind(name)
                names[name] = f"{kind} {letters(count[kind]) if kind == 'room' else count[kind] + 1}"
                count[kind] += 1
                self._names.append(names[name])
        named = found.renamed(names)
        self._remember(named)
        return named

    def _remember(self, regions: RegionMap) -> None:
        number = {name: at for at, name in enumerate(self._names)}
        for kind in {_kind(name) for name in regions.region_names}:
            of = np.array([number[name] if _kind(name) == kind else -1 for name in regions.region_names], np.int32)
            painted = self._regions.setdefault(kind, np.full(regions.label.shape, -1, np.int32))
            named = np.where(regions.label >= 0, of[regions.label], -1)
            painted[named >= 0] = named[named >= 0]
        for mark in regions.landmarks:
            self._marks |= {(_kind(mark.name), (row, column)): mark.name for row, column in mark.cells.tolist()}

    def _regions_shared(self, found: RegionMap) -> Iterator[tuple[int, str, str]]:
        """(cells shared, name now, name before) of regions of a kind."""
        for kind, painted in self._regions.items():
            both = (found.label >= 0) & (painted >= 0)
            cells = np.bincount(found.label[both].astype(np.int64) * len(self._names) + painted[both])
            for pair in np.flatnonzero(cells).tolist():
                now, old = divmod(pair, len(self._names))
                if _kind(found.region_names[now]) == kind:
                    yield int(cells[pair]), found.region_names[now], self._names[old]

    def _marks_shared(self, found: RegionMap) -> Iterator[tuple[int, str, str]]:
        for mark in found.landmarks:
            at = ((_kind(mark.name), (row, column)) for row, column in mark.cells.tolist())
            for name, shared in Counter(self._marks[key] for key in at if key in self._marks).items():
                yield shared, mark.name, name


def _kind(name: str) -> str:
    """The name without its number or letter."""
    return name.rpartition(" ")[0]
