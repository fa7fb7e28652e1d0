"""Segmentation: free space cut into rooms, corridors and other regions.

The thickness of a cell is the radius of the largest free disc that covers it: the same all over a room or a
corridor, with a jump where a corridor opens into a hall.  Zones of alike thickness are grown from thick to
thin, zones that are no places of their own are joined, and borders settle where free space is narrowest.

H, W: rows, columns of the grid.  h, w: rows, columns of the view, which has a margin of one cell and, on
maps drawn in few cells, two cells for each of the grid's (widths of 1 and 2 cells are alike otherwise).
"""

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.kernels import regions as kernels
from qualrl.kernels.thickness import disc_centres, local_thickness
from qualrl.spatial.description import describe, measure
from qualrl.spatial.distance import distance_within
from qualrl.spatial.doorways import find_doorways, renumbered
from qualrl.spatial.landmarks import find_landmarks
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import RegionMap

PINCH, STEP, SLENDER, LONG, ROOMY = 0.85, 0.6, 9.0, 5.0, 6.0
"""See ``kernels.regions.Rules``."""
BLOCK_M2 = 4.0
"""Free-standing things of less area are furniture if they are about as long as wide."""
WHISKER_M = 0.12
"""Half-width of the passages that are gaps between a scanner's rays rather than ways."""
COARSE_CELLS = 4.0
"""A map whose free cells are typically nearer than this to a wall is drawn in few cells."""
GAP_DISTANCE = 0.05
"""Distance from walls, in cells, in gaps of one cell: less than anywhere else."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]
Number = TypeVar("Number", np.bool_, np.int32, np.float32)


@dataclass(frozen=True, eq=False)
class _View:
    """The free space as the segmentation looks at it; cells of the view."""

    distance: Floats
    """(h, w) to the nearest cell that is not free; 0 on those and in passages that are seen past."""
    thickness: Floats
    """(h, w) radius of the largest free disc over each cell."""
    thing: Labels
    """(h, w) number of the piece of furniture at each cell, -1 where none: it counts as free."""
    zoom: int
    """Cells of the view along each cell of the grid."""

    def to_grid(self, array: NDArray[Number]) -> NDArray[Number]:
        """(H, W) an array (h, w) as seen from the grid."""
        return np.ascontiguousarray(array[1:-1, 1:-1][:: self.zoom, :: self.zoom])


def segment(
    grid: OccupancyGrid, *, min_area_m2: float = 2.0, furniture_m: float = 0.35, pinch: float = PINCH
) -> RegionMap:
    """Cut the free space into named regions, with the doorways between them and the landmarks.

    Every free cell is in one region and every region is 4-connected.  A part of the free space that is cut
    off from the rest and smaller than a room is one region of kind "pocket".

    Args:
        grid: the map.
        min_area_m2: no room or corridor is smaller, unless there is nothing to join it to.
        furniture_m: free-standing things smaller than this are looked past when rooms are told apart.
        pinch: a doorway is narrower than this share of the narrower place beside it.

    Raises:
        SettingError: a setting is out of its range.

    """
    if not isinstance(grid, OccupancyGrid):
        raise TypeError(f"segment needs an OccupancyGrid, from qualrl.read_map, got {type(grid).__name__}")
    _check(min_area_m2=(min_area_m2, 1e6), furniture_m=(furniture_m, 1e3), pinch=(pinch, 1.0))
    resolution_m = grid.resolution_m
    island, cells = _pieces(np.where(grid.free, 0, -1).astype(np.int32))
    is_pocket = cells < max(min_area_m2 / resolution_m**2, 9)
    is_pocket[np.argmax(cells)] = False
    apart = grid.free & is_pocket[island]
    view = _look(grid.free & ~apart, resolution_m, furniture_m)
    seen = view.to_grid(_regions_of(view, min_area_m2 * (view.zoom / resolution_m) ** 2, pinch))
    label = _settled(seen, grid.free & ~apart, min_area_m2 / resolution_m**2)
    label[apart] = island[apart] + label.max() + 1
    thickness = view.to_grid(view.thickness) / np.float32(view.zoom)
    parts = measure(label, apart, thickness)
    distance = view.to_grid(view.distance) / np.float32(view.zoom)
    unordered = find_doorways(parts.label, distance, view.to_grid(view.thing), pinch * parts.half_width, resolution_m)
    regions, order = describe(parts, unordered, grid.occupied, resolution_m)
    rank = np.argsort(order).astype(np.int32)
    label = np.where(grid.free, rank[parts.label], -1).astype(np.int32)
    half_width, doorways = parts.half_width[order], renumbered(unordered, rank.tolist())
    landmarks = find_landmarks(label, regions, doorways, distance, half_width, resolution_m)
    return RegionMap(grid, label, regions, doorways, landmarks)


def _check(**settings: tuple[float, float]) -> None:
    """Raise SettingError unless each setting, given as (value, most), is from 0 to its most."""
    for name, (value, most) in settings.items():
        if not 0 <= value <= most:
            raise SettingError(f"segment: {name} must be from 0 to {most:g}, got {value}")


def _look(free: Flags, cell_m: float, furniture_m: float) -> _View:
    """The view of free cells (H, W)."""
    zoom = 2 if np.median(distance_within(np.pad(free, 1))[1:-1, 1:-1][free]) < COARSE_CELLS else 1
    larger, gap = (np.pad(flags.repeat(zoom, 0).repeat(zoom, 1), 1) for flags in (free, _gaps(free)))
    thing = _furniture(larger, cell_m / zoom, zoom, furniture_m)
    clear = larger | (thing >= 0)
    radius = round(WHISKER_M * zoom / cell_m)
    if radius:
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
        opened = cv2.morphologyEx(clear.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0
        clear = opened if opened.any() else clear
    distance = distance_within(clear)
    centres = disc_centres(distance)
    largest_first = centres[np.argsort(-distance.ravel()[centres], kind="stable")]
    thickness = local_thickness(distance, largest_first)
    distance[gap & clear] = thickness[gap & clear] = GAP_DISTANCE
    return _View(distance, thickness, thing, zoom)


def _gaps(free: Flags) -> Flags:
    """(H, W) gaps of one cell in a wall of one cell: no width tells them from a corridor of one cell."""
    wide = np.pad(free, 1)
    north, south, west, east = wide[:-2, 1:-1], wide[2:, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:]
    corners = wide[:-2, :-2] & wide[:-2, 2:] & wide[2:, :-2] & wide[2:, 2:]
    through = (north & south & ~west & ~east) | (west & east & ~north & ~south)
    return np.asarray(free & corners & through, np.bool_)


def _furniture(free: Flags, cell_m: float, zoom: int, furniture_m: float) -> Labels:
    """(h, w) number of the free-standing thing at each cell, if it is small or a compact block; else -1.

    cell_m: side of a cell of the view.
    """
    _, thing, stats, _ = cv2.connectedComponentsWithStats((~free).astype(np.uint8), connectivity=8)
    width_m, height_m = stats[:, cv2.CC_STAT_WIDTH] * cell_m, stats[:, cv2.CC_STAT_HEIGHT] * cell_m
    solid = stats[:, cv2.CC_STAT_AREA] * cell_m**2 > 0.5 * width_m * height_m
    longer, shorter = np.maximum(width_m, height_m), np.minimum(width_m, height_m)
    # Where walls are one cell thick, what is left of one between its gaps is no block.
    block = solid & (longer < 3 * shorter) & (width_m * height_m < BLOCK_M2) & (shorter > 1.5 * zoom * cell_m)
    looked_past = block | (longer < furniture_m)
    looked_past[[0, thing[0, 0]]] = False
    return np.where(looked_past[thing], thing, -1).astype(np.int32)


def _regions_of(view: _View, min_area: float, pinch: float) -> Labels:
    """(h, w) region of each cell of the view, -1 where it is not free."""
    thickness, distance = view.thickness, view.distance
    order = np.flatnonzero(distance > 0).astype(np.int32)
    for width in (distance, thickness):
        # Whole sixteenths of a cell sort in linear time; both sorts are stable, so the second one rules.
        sixteenths = np.minimum(width.ravel()[order] * 16, 65535).astype(np.uint16)
        order = order[np.argsort(65535 - sixteenths, kind="stable")]
    zone, count = kernels.flat_zones(thickness, distance, order, pinch, STEP)
    inside = zone.ravel()[order]
    area = np.bincount(inside, minlength=count).astype(np.float32)
    breadth = (np.bincount(inside, thickness.ravel()[order], count) / np.maximum(area, 1)).astype(np.float32)
    ends = kernels.crossings(zone)
    pair = np.sort(zone.ravel()[ends], axis=1).astype(np.int64)
    key, contact, length = np.unique(pair[:, 0] * count + pair[:, 1], return_inverse=True, return_counts=True)
    way = np.zeros(key.size, np.float32)
    np.maximum.at(way, contact, distance.ravel()[ends].min(axis=1))
    touching = np.stack(np.divmod(key, max(count, 1)), axis=1).astype(np.int32)
    links = kernels.linked(count, kernels.Contacts(touching, length.astype(np.float32), way))
    rules = kernels.Rules(pinch, STEP, SLENDER, LONG, ROOMY, float(min_area))
    place = np.arange(count, dtype=np.int32)
    while kernels.join_zones(np.argsort(area, kind="stable"), place, area, breadth, links, rules):
        pass
    return _straightened(np.where(zone >= 0, place[zone], -1).astype(np.int32), view)


def _straightened(region: Labels, view: _View) -> Labels:
    """The regions with their borders moved to where free space is narrowest nearby."""
    border = np.zeros(region.size, np.bool_)
    border[kernels.crossings(region)] = True
    if not border.any():
        return region
    from_border = distance_within(~border.reshape(region.shape))
    core = np.where(from_border > 0.5 * view.thickness, region, -1).astype(np.int32)
    has_core = np.zeros(int(region.max()) + 1, np.bool_)
    has_core[core[core >= 0]] = True
    core = np.where((region >= 0) & ~has_core[region], region, core).astype(np.int32)
    return kernels.flood(core, region >= 0, (view.distance * 8).astype(np.int32))


def _settled(seen: Labels, free: Flags, min_area: float) -> Labels:
    """(H, W) a strict partition of the free space into 4-connected regions, from the view's regions.

    Of each region the largest piece stays and grows over the cells that the view did not show.
    """
    piece, cells = _pieces(np.where(free, seen, -1).astype(np.int32))
    owner = np.zeros(cells.size, np.int32)
    shown = free & (piece >= 0)
    owner[piece[shown]] = seen[shown]
    most = np.zeros(int(seen.max()) + 1, np.int64)
    np.maximum.at(most, owner, cells)
    stays = cells == most[owner] if cells.size else np.zeros(0, np.bool_)
    level = np.zeros(free.shape, np.int32)
    label = np.full(free.shape, -1, np.int32)
    # Scraps, as between the rays of a scanner, go to the region beside them; where there is none, to themselves.
    for chosen in (stays & (cells >= min_area), stays):
        if not (free & (label < 0)).any():
            return label
        seeds = shown & (label < 0) & np.append(chosen, False)[piece]
        label = kernels.flood(np.where(seeds, piece, label).astype(np.int32), free, level)
    unseen, _ = _pieces(np.where(free & (label < 0), 0, -1).astype(np.int32))
    return np.where(unseen >= 0, unseen + cells.size, label).astype(np.int32)


def _pieces(label: Labels) -> tuple[Labels, NDArray[np.int64]]:
    """(H, W) number of the 4-connected piece of equal label at each cell, and the cells of each piece."""
    piece, count = kernels.pieces(label)
    return piece, np.bincount(piece[piece >= 0], minlength=count)
