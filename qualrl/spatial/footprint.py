"""The robot's footprint, a disc: where its centre can be, and the regions of a map that are left for it.

H, W: rows, columns.  Cells that are unknown, and all beyond the map's edge, count as not free.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError, SettingError
from qualrl.kernels import flooding
from qualrl.kernels import regions as kernels
from qualrl.spatial.description import mean_half_width, measure, recorded, shapes_of
from qualrl.spatial.distance import distance_within, thickness_over
from qualrl.spatial.doorways import find_doorways
from qualrl.spatial.landmarks import middle_of
from qualrl.spatial.naming import letters
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import CENTRE, Doorway, Landmark, Region, RegionMap

LEAST_ROOM_M2 = 2.0
"""A part that is cut off from its region is a pocket where it is smaller."""
SLACK = 1e-6
"""Cells: decimal metres over decimal metres are seldom whole."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]


class _Origin(NamedTuple):
    """Where a region that is left comes from."""

    region: int
    """Index of the region it was, or was a part of."""
    is_main: bool
    """Whether it is the largest part, which keeps the name."""


def clearance(free: Flags) -> NDArray[np.float64]:
    """(H, W) from each cell's centre to the nearest point of a cell that is not free, in cells; 0 where not free."""
    # Centres, edges and corners of cells are points of a lattice of half cells, and the nearest point is one of them.
    blocked = np.pad(~free, 1, constant_values=True)
    lattice = np.ones((2 * free.shape[0] + 1, 2 * free.shape[1] + 1), np.bool_)
    for down in (0, 1):
        for right in (0, 1):
            corner = blocked[down : down + free.shape[0] + 1, right : right + free.shape[1] + 1]
            lattice[::2, ::2][corner] = False
    lattice[1::2, ::2][blocked[1:-1, :-1] | blocked[1:-1, 1:]] = False
    lattice[::2, 1::2][blocked[:-1, 1:-1] | blocked[1:, 1:-1]] = False
    lattice[1::2, 1::2][~free] = False
    return np.asarray(distance_within(lattice)[1::2, 1::2], np.float64) / 2


def fitted(regions: RegionMap, radius_m: float) -> RegionMap:
    """What is left of a map for a robot of that radius, which stands on a cell when it fits with its centre there.

    See ``cut_to``.  Raises SettingError for a radius below 0, MapError where the robot fits nowhere.
    """
    if not 0 <= radius_m < math.inf:
        raise SettingError(f"radius_m must be at least 0 and finite, got {radius_m}")
    grid = regions.grid
    if radius_m == 0:
        return regions
    room = clearance(grid.free)
    fits = has_room(room, radius_m / grid.resolution_m)
    if not fits.any():
        raise MapError(
            f"a robot with radius_m {radius_m:g} fits nowhere on {grid.source or 'the map'}: even the widest place "
            f"leaves {rounded_down(room.max() * grid.resolution_m):g} m to what is not free; give at most that"
        )
    return cut_to(fits, regions, radius_m)


def has_room(room: NDArray[np.float64], radius: float) -> Flags:
    """(H, W) where a robot of that radius (in cells) fits with its centre, by the ``clearance`` of each cell."""
    return (room > 0) & (room + SLACK >= radius)


def cut_to(fits: Flags, regions: RegionMap, radius_m: float) -> RegionMap:
    """A map cut to the cells (H, W) on which a robot of that radius fits.

    Regions keep their names and kinds: the largest part of each, to which scraps beside it go.  A part that is cut off
    from all of them is a region of its own, with a new name.  Doorways that are too narrow are gone; the others keep
    name and width, which is that of the opening and not of the robot's way through it.  Shapes are those of the parts.
    What has no cell left is lost.
    """
    grid = regions.grid
    label, origins = _parts(regions.label, fits)
    doorways = _doorways(label, origins, regions, radius_m)
    found = _described(label, origins, doorways, regions, radius_m)
    smaller = replace(grid, free=fits, tight=grid.free & ~fits, radius_m=radius_m)
    marks = _landmarks(label, found, origins, doorways, regions, radius_m)
    left = RegionMap(smaller, label, found, doorways, marks)
    return replace(left, lost=tuple(name for name in regions.all_names if name not in left.all_names))


def rounded_down(length_m: float) -> float:
    """To four digits, so that what is proposed is not too large after all."""
    unit = 10.0 ** (math.floor(math.log10(length_m)) - 3)
    return math.floor(length_m / unit + SLACK) * unit


def _parts(label: Labels, fits: Flags) -> tuple[Labels, list[_Origin]]:
    """(H, W) number of the region that is left at each cell, and where each of them comes from."""
    piece, count = kernels.pieces(np.where(fits, label, -1).astype(np.int32))
    cells = np.bincount(piece[fits], minlength=count)
    owner = np.zeros(count, np.int32)
    owner[piece[fits]] = label[fits]
    largest = {int(owner[at]): int(at) for at in np.argsort(cells, kind="stable")}
    main = np.zeros(count, np.bool_)
    main[list(largest.values())] = True
    seeds = np.where(fits & main[piece], piece, -1).astype(np.int32)
    grown = flooding.flood(seeds, fits, np.zeros(1, np.float32))
    grown = np.where(fits & (grown < 0), piece, grown)
    stay = sorted(set(np.unique(grown[fits]).tolist()), key=lambda at: (not main[at], int(owner[at]), at))
    # Parts of one island that nothing reaches touch no region that stays, but may touch each other.
    number = np.full(count, -1, np.int32)
    number[stay] = np.arange(len(stay))
    return np.where(fits, number[grown], -1).astype(np.int32), [_Origin(int(owner[at]), bool(main[at])) for at in stay]


def _described(
    label: Labels, origins: list[_Origin], doorways: tuple[Doorway, ...], before: RegionMap, radius_m: float
) -> tuple[Region, ...]:
    """The records of the regions that are left."""
    resolution_m = before.grid.resolution_m
    new = _NewNames(before.region_names)
    titles = []
    areas_m2 = np.bincount(label[label >= 0]) * resolution_m**2
    for (region, is_main), area_m2 in zip(origins, areas_m2.tolist(), strict=True):
        kind = before.regions[region].kind if is_main or area_m2 >= LEAST_ROOM_M2 else "pocket"
        titles.append((before.regions[region].name if is_main else new.name(kind), kind))
    is_pocket = np.array([kind == "pocket" for _, kind in titles])
    half_width = _half_widths(mean_half_width(label, _thickness(label >= 0)), origins, before)
    parts = measure(label, is_pocket, half_width)
    shapes = shapes_of(parts, doorways, _walls(label, before, radius_m), resolution_m)
    return tuple(recorded(parts, titles, shapes, resolution_m, range(len(titles))))


def _half_widths(half_width: Floats, origins: list[_Origin], before: RegionMap) -> Floats:
    """(R,) widths of the regions that are left with furniture looked past, from those without."""
    # Looking past it adds as much to the width of what is left as to that of the whole region.
    free = before.grid.free
    at_least = np.maximum(_thickness(free), 0.5)[free]
    without = np.bincount(before.label[free], at_least) / np.bincount(before.label[free])
    found = half_width.copy()
    for at, (region, is_main) in enumerate(origins):
        shape = before.regions[region].shape
        if is_main and shape is not None:
            found[at] += shape.half_width_m / before.grid.resolution_m - without[region]
    return np.maximum(found, np.float32(0.5))


def _walls(label: Labels, before: RegionMap, radius_m: float) -> Flags:
    """(H, W) the walls, and what of the band that the robot keeps free has a wall and no unknown space behind it."""
    wall = np.pad(before.grid.free, 1, mode="edge")  # so is the map's edge, where free space reaches it
    wall[1:-1, 1:-1] = before.grid.occupied
    near = distance_within(~wall)[1:-1, 1:-1] <= radius_m / before.grid.resolution_m + 1
    return np.asarray(before.grid.occupied | (before.grid.free & (label < 0) & near), np.bool_)


class _NewNames:
    """Names that nothing is called yet."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken, self._count = set(taken), Counter[str]()

    def name(self, kind: str) -> str:
        """The first name of a kind that is not taken, which then is."""
        found = ""
        while not found or found in self._taken:
            number = self._count[kind]
            found = f"{kind} {letters(number) if kind == 'room' else number + 1}"
            self._count[kind] += 1
        return found


def _doorways(label: Labels, origins: list[_Origin], before: RegionMap, radius_m: float) -> tuple[Doorway, ...]:
    """The doorways that are left; each has name and width of the nearest one between the same regions as before.

    Ways through one doorway, as on both sides of a pillar, remain one.  Where they lead to different parts of a region,
    the longest keeps the name; a new one is as wide as the way through it and the robot.
    """
    distance, nothing = (label >= 0).astype(np.float32), np.full_like(label, -1)
    wide = np.full(len(origins), np.inf, np.float32)
    ways: dict[tuple[int, tuple[int, int]], list[Doorway]] = {}
    for at, way in enumerate(find_doorways(label, distance, nothing, wide, before.grid.resolution_m)):
        regions = sorted(origins[index].region for index in way.pair)
        ways.setdefault((_nearest_doorway(way, regions, before, -1 - at), way.pair), []).append(way)
    new, taken = _NewNames(door.name for door in before.doorways), set[int]()
    found = []
    for (old, _), same in sorted(ways.items(), key=lambda item: (-sum(len(way.cells) for way in item[1]), item[0])):
        longest = label[tuple(max(same, key=lambda way: len(way.cells)).cells[0])]
        stays = before.label[tuple(before.doorways[old].cells[0])] if old >= 0 else origins[longest].region
        cells = _joined(same, label, next(index for index in same[0].pair if origins[index].region == stays))
        if old >= 0 and old not in taken:
            taken.add(old)
            found.append(replace(before.doorways[old], pair=same[0].pair, cells=cells))
        else:
            width_m = max(way.width_m for way in same) + 2 * radius_m - before.grid.resolution_m
            found.append(Doorway(new.name("door"), same[0].pair, cells, width_m, False))
    return tuple(sorted(found, key=lambda door: (door.pair, tuple(door.cells[len(door.cells) // 2]))))


def _joined(ways: list[Doorway], label: Labels, side: int) -> Labels:
    """The cells of ways between the same two regions, all of them in one of the two."""
    cells = []
    for way in ways:
        around = way.cells
        if label[tuple(around[0])] != side:
            around = np.concatenate([around + step for step in ((-1, 0), (0, -1), (0, 1), (1, 0))])
            around = around[((around >= 0) & (around < label.shape)).all(axis=1)]
        cells.append(around[label[tuple(around.T)] == side])
    joined = np.unique(np.concatenate(cells), axis=0).astype(np.int32)
    joined.setflags(write=False)
    return joined


def _nearest_doorway(way: Doorway, regions: list[int], before: RegionMap, otherwise: int) -> int:
    """Index of the nearest doorway between two regions, the first of equals."""
    away = [
        (int(((door.cells[:, None] - way.cells[None]) ** 2).sum(axis=2).min()), at)
        for at, door in enumerate(before.doorways)
        if list(door.pair) == regions
    ]
    return min(away, default=(0, otherwise))[1]


def _landmarks(
    label: Labels, regions: tuple[Region, ...], origins: list[_Origin], doorways: tuple[Doorway, ...],
    before: RegionMap, radius_m: float,
) -> tuple[Landmark, ...]:  # fmt: skip
    """Those of the doorways and centres, and the others moved to the nearest cell of their region, if one is near."""
    marks = [Landmark(door.name, "doorway", middle_of(door.cells), door.cells, door.pair) for door in doorways]
    now = {origin.region: at for at, origin in enumerate(origins) if origin.is_main}
    reach = math.ceil(2 * radius_m / before.grid.resolution_m) + 2
    used = set[tuple[str, Cell]]()
    for mark in before.landmarks:
        region = now.get(mark.regions[0])
        if mark.kind == "doorway" or region is None:
            continue
        cell = regions[region].centre if mark.kind == CENTRE else _nearest(mark.cell, label, region, reach)
        if cell is not None and (mark.kind, cell) not in used:
            used.add((mark.kind, cell))
            marks.append(replace(mark, cell=cell, cells=_one(cell), regions=(region,)))
    new = _NewNames(mark.name for mark in before.landmarks)
    for at, region_now in enumerate(regions):
        if not origins[at].is_main and region_now.kind != "pocket":
            marks.append(Landmark(new.name(CENTRE), CENTRE, region_now.centre, _one(region_now.centre), (at,)))
    return tuple(marks)


def _nearest(cell: Cell, label: Labels, region: int, reach: int) -> Cell | None:
    """The nearest cell of a region, if one is within reach."""
    top, left = (max(at - reach, 0) for at in cell)
    box = label[top : cell[0] + reach + 1, left : cell[1] + reach + 1]
    cells = np.argwhere(box == region) + np.array([top, left])
    if not len(cells):
        return None
    away = ((cells - cell) ** 2).sum(axis=1)
    row, column = cells[np.argmin(away)].tolist()
    return (row, column) if away.min() <= reach**2 else None


def _one(cell: Cell) -> Labels:
    cells = np.array([cell], np.int32)
    cells.setflags(write=False)
    return cells


def _thickness(free: Flags) -> NDArray[np.float32]:
    """(H, W) radius of the largest free disc over each cell, in cells; 0 where not free, as is all beyond the edge."""
    return thickness_over(distance_within(np.pad(free, 1)))[1:-1, 1:-1]
