"""Segmentation: free space cut into rooms, corridors and pockets.

The thickness of a cell is the radius of the largest free disc that covers it: the same all over a room or a
corridor, lower in a doorway, and with a jump where a corridor opens into a hall.  Zones of alike thickness
are grown from thick to thin and stop at a pinch or a jump; zones that are no places of their own are joined;
borders settle where free space is narrowest.

H, W: rows, columns of the grid.  h, w: rows, columns of the view, which has a border of one wall cell and,
on maps drawn in few cells, two cells for each of the grid's (widths of 1 and 2 cells are alike otherwise).
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import regions as kernels
from qualrl.spatial.doorways import find_doorways
from qualrl.spatial.landmarks import find_landmarks
from qualrl.spatial.naming import name_regions, ordered
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import Region, RegionMap

STEP = 0.6
"""A corridor ends where it opens into a place so much thicker that its own thickness is less than this share."""
SLENDER = 9.0
"""A corridor's area is at least this many squares of its half-width."""
LONG = 5.0
"""The end of a corridor is at most this many of its half-widths long."""
ROOMY = 6.0
"""A place's area is at least this many squares of the half-width of the way into it."""
BULGE = 1.0
MEAN=1.0
LEVEL=0.0
PINCH2=.85
SHRINK=1.0
LESS=0.0
BLOCK_M2 = 4.0
"""Free-standing things of less area than this are furniture if they are about as long as wide."""
WHISKER_M = 0.12
"""Passages of less than about two of these are seen past: gaps between scan lines, not ways."""
COARSE_CELLS = 4.0
"""Half-width, in cells, below which a map counts as drawn in few cells."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]
Number = TypeVar("Number", np.bool_, np.int32, np.float32)
ELONGATED = 3.0
LINE_M = 2.0


@dataclass(frozen=True, eq=False)
class _View:
    """The free space as the segmentation looks at it."""

    free: Flags
    """(h, w) without furniture and whiskers."""
    distance: Floats
    """(h, w) to the nearest cell that is not free."""
    thickness: Floats
    """(h, w) radius of the largest free disc over each cell; 0 in gaps of one cell."""
    thing: Labels
    """(h, w) number of the piece of furniture filled in at each cell, -1 where none."""
    cells_per_cell: int
    """Rows of the view for each row of the grid."""

    def to_cells(self, array: NDArray[Number]) -> NDArray[Number]:
        """(H, W) an array (h, w) of the view as seen from the grid."""
        return np.ascontiguousarray(array[1:-1, 1:-1][:: self.cells_per_cell, :: self.cells_per_cell])


def segment(
    grid: OccupancyGrid, *, min_area_m2: float = 1.5, furniture_m: float = 0.35, pinch: float = 0.85
) -> RegionMap:
    """Cut the free space into named regions, with the doorways between them and the landmarks.

    Every free cell gets one region and every region is 4-connected.  A part of the free space that is cut
    off from the rest and smaller than a room is one region of kind "pocket".

    Args:
        grid: the map.
        min_area_m2: no room or corridor is smaller, unless it is all there is.
        furniture_m: free-standing things smaller than this are looked past when rooms are told apart.
        pinch: a doorway is narrower than this share of the narrower place beside it.

    Raises:
        SettingError: a setting is out of its range.
    """
    for name, value, least, most in (
        ("min_area_m2", min_area_m2, 0.0, math.inf), ("furniture_m", furniture_m, 0.0, math.inf), ("pinch", pinch, 0.0, 1.0)
    ):
        if not least <= value <= most:
            raise SettingError(f"segment: {name} must be from {least} to {most}, got {value}")
    island, count = kernels.pieces(np.where(grid.free, 0, -1).astype(np.int32))
    island_cells = np.bincount(island[grid.free], minlength=count)
    pocket = island_cells * grid.resolution_m**2 < max(min_area_m2, 9 * grid.resolution_m**2)
    pocket[np.argmax(island_cells)] = False
    mainland = grid.free & ~pocket[island]
    view = _look(mainland, grid.resolution_m, furniture_m)
    seen = _regions_of(view, min_area_m2 / (grid.resolution_m / view.cells_per_cell) ** 2, pinch)
    label = _settled(view.to_cells(seen), mainland, min_area_m2 / grid.resolution_m**2)
    apart = grid.free & ~mainland
    label[apart] = island[apart] + label.max() + 1
    label, regions = _described(label, view, apart, grid.resolution_m)
    doorways = find_doorways(
        label, view.to_cells(view.thickness), view.to_cells(view.thing), grid.resolution_m, pinch
    )
    landmarks = find_landmarks(
        label, regions, doorways, view.to_cells(view.free), view.to_cells(view.thickness), grid.resolution_m
    )
    return RegionMap(grid, label, regions, doorways, landmarks)


def _described(
    label: Labels, view: _View, apart: Flags, resolution_m: float
) -> tuple[Labels, tuple[Region, ...]]:
    """The regions in their order, with their names, and the label (H, W) that goes with it."""
    free = np.flatnonzero(label >= 0)
    _, number = np.unique(label.ravel()[free], return_inverse=True)
    count = int(number.max()) + 1
    rows, columns = np.divmod(free, label.shape[1])
    cells = np.bincount(number, minlength=count)
    centre_row, centre_column = np.bincount(number, rows) / cells, np.bincount(number, columns) / cells
    thickness = view.to_cells(view.thickness).ravel()[free] / view.cells_per_cell
    room_at = cv2.distanceTransform(np.pad(label >= 0, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    by_width = np.lexsort((thickness, number))
    last = np.cumsum(cells) - 1
    half_width = thickness[by_width[last - cells // 2]]
    innermost = np.lexsort((room_at[1:-1, 1:-1].ravel()[free], number))[last]
    is_pocket = np.zeros(count, np.bool_)
    is_pocket[number] = apart.ravel()[free]
    regions = []
    for index in range(count):
        long = cells[index] >= ELONGATED * (2 * half_width[index]) ** 2
        kind = "pocket" if is_pocket[index] else "corridor" if long else "room"
        centroid = float(centre_row[index]), float(centre_column[index])
        centre = int(rows[innermost[index]]), int(columns[innermost[index]])
        regions.append(Region("", kind, int(cells[index]), float(cells[index] * resolution_m**2), centroid, centre))
    order = ordered(regions, line=LINE_M / resolution_m)
    rank = np.empty(count, np.int32)
    rank[order] = np.arange(count)
    ranked = np.full(label.shape, -1, np.int32)
    ranked.ravel()[free] = rank[number]
    return ranked, name_regions([regions[index] for index in order])


def _look(free: Flags, cell_m: float, furniture_m: float) -> _View:
    """The view of the free space, doubled if it is drawn in few cells."""
    gap = _gaps(free)
    distance = cv2.distanceTransform(np.pad(free, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    factor = 2 if np.median(distance[distance > 0]) < COARSE_CELLS else 1
    finer = np.pad(free.repeat(factor, 0).repeat(factor, 1), 1)
    gap = np.pad(gap.repeat(factor, 0).repeat(factor, 1), 1)
    clear, thing = _decluttered(finer, cell_m / factor, furniture_m)
    distance = cv2.distanceTransform(clear.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    thickness = kernels.local_thickness(distance, SHRINK, LESS)
    thickness[gap] = np.minimum(thickness[gap],1e-3)
    return _View(clear, distance, thickness, thing, factor)


def _gaps(free: Flags) -> Flags:
    """(H, W) gaps of one cell in a wall of one cell: no width tells them from a corridor of one cell."""
    f = np.pad(free, 1)
    north, south, west, east = f[:-2, 1:-1], f[2:, 1:-1], f[1:-1, :-2], f[1:-1, 2:]
    corners = f[:-2, :-2] & f[:-2, 2:] & f[2:, :-2] & f[2:, 2:]
    return free & corners & ((north & south & ~west & ~east) | (west & east & ~north & ~south))


def _decluttered(free: Flags, cell_m: float, furniture_m: float) -> tuple[Flags, Labels]:
    """(h, w) free space with furniture filled in and whiskers taken off."""
    count, thing, stats, _ = cv2.connectedComponentsWithStats((~free).astype(np.uint8), connectivity=8)
    wide = stats[:, cv2.CC_STAT_WIDTH] * cell_m
    high = stats[:, cv2.CC_STAT_HEIGHT] * cell_m
    solid = stats[:, cv2.CC_STAT_AREA] * cell_m**2 > 0.5 * wide * high
    long, short = np.maximum(wide, high), np.minimum(wide, high)
    furniture = (long < furniture_m) | (solid & (short > furniture_m) & (wide * high < BLOCK_M2) & (long < 3 * short))
    furniture[0] = False
    furniture[thing[0,0]] = False
    clear = free | furniture[thing]
    radius = round(WHISKER_M / cell_m)
    if radius:
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
        clear = cv2.morphologyEx(clear.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0
    return clear, np.where(furniture[thing], thing, -1).astype(np.int32)


def _regions_of(view: _View, min_area: float, pinch: float) -> Labels:
    """(h, w) region of each cell of the view, -1 where it is not free."""
    thickness = view.thickness
    rules = np.array([pinch, STEP, SLENDER, LONG, ROOMY, BULGE, MEAN, LEVEL], np.float32)
    key = np.minimum(thickness * 16, 65535).astype(np.uint16).ravel()
    cells = np.flatnonzero(key|view.free.ravel())
    near = np.minimum(view.distance * 16, 65535).astype(np.uint16).ravel()
    cells = cells[np.argsort(65535 - near[cells], kind="stable")]
    order = cells[np.argsort(65535 - key[cells], kind="stable")].astype(np.int32)
    zone, count = kernels.flat_zones(thickness, view.distance, order, rules)
    area = np.bincount(zone[zone >= 0], minlength=count).astype(np.float32)
    peak = np.zeros(count, np.float32)
    np.maximum.at(peak, zone[zone >= 0], thickness[zone >= 0])
    if MEAN:
        peak = (np.bincount(zone[zone >= 0], thickness[zone >= 0], minlength=count) / area).astype(np.float32)
    rules[0] = PINCH2
    pair, saddle = kernels.contacts(zone, view.distance)
    key, edge, length = np.unique(
        pair[:, 0].astype(np.int64) * count + pair[:, 1], return_inverse=True, return_counts=True
    )
    widest = np.zeros(key.size, np.float32)
    np.maximum.at(widest, edge, saddle)
    ends = np.stack([key // count, key % count], axis=1).astype(np.int32)
    stands_for = kernels.join_zones(area, peak, ends, length.astype(np.float32), widest, min_area, rules)
    region = np.where(zone >= 0, stands_for[zone], -1).astype(np.int32)
    return _straightened(region, view)


def _straightened(region: Labels, view: _View) -> Labels:
    """The regions with their borders moved to where free space is narrowest nearby."""
    edge = np.zeros(region.shape, np.bool_)
    down = (region[1:] != region[:-1]) & (region[1:] >= 0) & (region[:-1] >= 0)
    right = (region[:, 1:] != region[:, :-1]) & (region[:, 1:] >= 0) & (region[:, :-1] >= 0)
    edge[1:] |= down
    edge[:-1] |= down
    edge[:, 1:] |= right
    edge[:, :-1] |= right
    if not edge.any():
        return region
    from_edge = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    core = np.where(from_edge > 0.5 * view.thickness, region, -1).astype(np.int32)
    kept = np.zeros(region.max() + 1, np.bool_)
    kept[core[core >= 0]] = True
    core = np.where((region >= 0) & ~kept[region], region, core).astype(np.int32)
    level = (view.distance * 8).astype(np.int32)
    return kernels.flood(core, region >= 0, level)


def _settled(seen: Labels, free: Flags, min_area: float) -> Labels:
    """(H, W) a strict partition of the free space into 4-connected regions, from the view's regions.

    Of each region the largest piece stays, and grows over the cells that the view did not show.
    """
    label = np.where(free, seen, -1).astype(np.int32)
    level = np.zeros(label.shape, np.int32)
    piece, cells = _pieces(label)
    main = np.zeros(label.max() + 1, np.int64)
    owner = np.full(cells.size, -1, np.int64)
    owner[piece[free]] = label[free]
    shown = owner >= 0
    np.maximum.at(main, owner[shown], cells[shown])
    stays = shown & (cells == main[owner])
    # Scraps of a map, as between the rays of a scanner, go to the places beside them; where there is
    # none, to themselves.
    grown = np.full(label.shape, -1, np.int32)
    for chosen in (stays & (cells >= min_area), stays):
        seeds = np.where(free & (grown < 0) & chosen[piece], piece, grown).astype(np.int32)
        grown = kernels.flood(seeds, free, level)
    island, _ = _pieces(np.where(free, 0, -1).astype(np.int32))
    return np.where(free & (grown < 0), island + cells.size, grown).astype(np.int32)


def _pieces(label: Labels) -> tuple[Labels, NDArray[np.int64]]:
    """(H, W) number of the 4-connected piece of equal label at each cell, and the cells of each piece."""
    piece, count = kernels.pieces(label)
    return piece, np.bincount(piece[piece >= 0], minlength=count)
