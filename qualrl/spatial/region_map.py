"""What was seen on an occupancy grid: named regions, the doorways between them, and landmarks.

Indices live in the arrays, names in the records; ``RegionMap.region_named`` and its like translate.
Cells are (row, column) in image order; areas are square metres, widths metres.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import ScenarioError, UnknownNameError, did_you_mean
from qualrl.spatial.occupancy_grid import Cell, OccupancyGrid

if TYPE_CHECKING:
    from qualrl.spatial.relations import Relations

CENTRE = "centre"
"""The kind of landmark that a region's centre is."""


@dataclass(frozen=True)
class Shape:
    """The numbers that decide a region's kind (the rules stand in ``spatial.description``)."""

    half_width_m: float
    """Radius of the largest free disc over a cell, on average over its cells."""
    stretch: float
    """Its area in squares of its width: how many times as long as wide, walked along bends, branches and rings."""
    sides_m: tuple[float, float]
    """Longer and shorter side of the smallest rectangle, of any slant, around it."""
    fill: float
    """Share of that rectangle which it fills; convex rooms are near 1."""
    doors: int
    openings: int
    """Doorways of each sort."""
    open_share: float
    """Share of its border that is opening."""
    unknown_share: float
    """Share of its border beyond which the map is unknown, without a wall beside."""

    @property
    def degree(self) -> int:
        """Doors and openings together."""
        return self.doors + self.openings


@dataclass(frozen=True)
class Region:
    """A part of the free space with a name of its own."""

    name: str
    kind: str
    """"room", "corridor", "hall", "closet", "open area", or "pocket" (free cells that nothing connects to the rest)."""
    cells: int
    area_m2: float
    centroid: tuple[float, float]
    """Mean (row, column) of its cells; may lie outside the region."""
    centre: Cell
    """A cell well inside: of those nearly as far from walls and neighbours as any, the one nearest the centroid."""
    shape: Shape | None = None
    """What decided its kind; None for regions that were not found but given, or read from an older file."""


@dataclass(frozen=True, eq=False)
class Doorway:
    """Where two regions touch: every 4-connected step from one to the other passes its cells."""

    name: str
    pair: tuple[int, int]
    """Indices of the two regions, the smaller first."""
    cells: NDArray[np.int32]
    """(N, 2) the cells of the doorway, one row of them, in image order."""
    width_m: float
    """Length of the chord between its two ends, both cells counted in full: the clear width where the cells lie in
    a straight line from wall to wall.  Where they are bent, the width of the opening and not the length of the row."""
    is_open: bool
    """True for a wide border without walls beside it ("opening"), False for a door."""

    @property
    def ends(self) -> tuple[Cell, Cell]:
        """The two cells of the doorway that are farthest apart, in image order: the ends of its chord."""
        return farthest_apart(self.cells)

    @property
    def midpoint(self) -> Cell:
        """The cell of the doorway nearest the middle of its chord; of equally near ones the first."""
        first, last = self.ends
        off = 2 * self.cells - (np.array(first) + last)
        row, column = self.cells[np.argmin((off**2).sum(axis=1))]
        return int(row), int(column)


def farthest_apart(cells: NDArray[np.int32]) -> tuple[Cell, Cell]:
    """Two of some cells (N, 2) that are as far apart as any, in image order; a cell twice where there is only one."""
    hull = cv2.convexHull(cells.astype(np.int32)).reshape(-1, 2)
    hull = hull[np.lexsort(hull.T[::-1])]
    apart = ((hull[:, None] - hull[None]) ** 2).sum(axis=2)
    first, last = hull[list(divmod(int(apart.argmax()), len(hull)))].tolist()
    return (first[0], first[1]), (last[0], last[1])


@dataclass(frozen=True, eq=False)
class Landmark:
    """A named cell: a doorway, corner, junction, dead end, region centre, or placed by hand (paper, section 4.1.1)."""

    name: str
    kind: str
    """"doorway", "corner", "junction", "dead end", "centre" or "placed"."""
    cell: Cell
    """The cell that stands for it."""
    cells: NDArray[np.int32]
    """(N, 2) all cells that count as being at it; for a doorway the doorway's cells."""
    regions: tuple[int, ...]
    """Indices of the regions it lies in or joins."""


@dataclass(frozen=True, eq=False)
class RegionMap:
    """A partition of the free space into named regions, with doorways and landmarks."""

    grid: OccupancyGrid
    label: NDArray[np.int32]
    """(H, W) index of each cell's region; -1 exactly where the cell is not free."""
    regions: tuple[Region, ...]
    doorways: tuple[Doorway, ...]
    landmarks: tuple[Landmark, ...]
    lost: tuple[str, ...] = ()
    """Names of places that the robot is too large for: on the map for a robot that is a point, but not on this one."""

    def __post_init__(self) -> None:
        self.label.setflags(write=False)

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names by region index."""
        return tuple(region.name for region in self.regions)

    @property
    def all_names(self) -> tuple[str, ...]:
        """Every name on the map: regions, then landmarks (doorways are landmarks)."""
        return self.region_names + tuple(mark.name for mark in self.landmarks)

    @cached_property
    def relations(self) -> "Relations":
        """How the regions lie to each other, worked out when it is asked for: ``regions.relations.direction(a, b)``."""
        from qualrl.spatial.relations import Relations

        return Relations(self)

    def label_image(self) -> NDArray[np.int32]:
        """(H, W) number of each cell's region counted from 1, as other tools expect it; 0 in pockets and elsewhere."""
        number = np.array([0] + [at * (region.kind != "pocket") for at, region in enumerate(self.regions, 1)], np.int32)
        return np.asarray(number[self.label + 1])

    def why_not(self, name: str, what: str, known: Iterable[str]) -> str:
        """What to say of a name that is not on the map; what: "no place", say, that has one of the known names."""
        if name in self.lost:
            return f"a robot with radius_m {self.grid.radius_m:g} is too large for {name!r}"
        return f"{what} is called {name!r}; {did_you_mean(name, known)}"

    def renamed(self, names: Mapping[str, str]) -> "RegionMap":
        """The same map with other names for regions, doorways and landmarks.

        Raises UnknownNameError for a name that is not on the map, ScenarioError for one given twice.
        """
        for old in names:
            if old not in self.all_names and old not in self.lost:
                raise UnknownNameError(f"names: {self.why_not(old, 'nothing', self.all_names)}")
        counts = Counter(names.get(name, name) for name in (*self.all_names, *self.lost))
        for name, count in counts.items():
            if count > 1:
                raise ScenarioError(f"names: {name!r} would name {count} places; give each place its own name")
        return replace(
            self,
            regions=tuple(replace(region, name=names.get(region.name, region.name)) for region in self.regions),
            doorways=tuple(replace(door, name=names.get(door.name, door.name)) for door in self.doorways),
            landmarks=tuple(replace(mark, name=names.get(mark.name, mark.name)) for mark in self.landmarks),
            lost=tuple(names.get(name, name) for name in self.lost),
        )
