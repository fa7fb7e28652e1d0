"""Segmentation: free space cut into rooms, corridors and other regions.

H, W: rows, columns of the grid.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.garbage import left_alone
from qualrl.kernels import flooding
from qualrl.kernels import regions as kernels
from qualrl.kernels.bands import both
from qualrl.kernels.labels import as_label, cells_with, consecutive, labels_at, renumber, sizes
from qualrl.kernels.scratch import borrowed, kept_for_reuse
from qualrl.spatial.description import decided, listed, mean_half_width, measure
from qualrl.spatial.doorways import find_doorways, renumbered
from qualrl.spatial.footprint import fitted
from qualrl.spatial.joining import joined_regions
from qualrl.spatial.landmarks import Bend, corridor_lines, find_bends, find_corners, find_landmarks
from qualrl.spatial.merging import merged_regions
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.view import SIDE_M, WALLED_M, Things, View, look, shrunk

PINCH = 0.85
"""See ``segment``."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]


@left_alone()
@kept_for_reuse()
def segment(
    grid: OccupancyGrid,
    *,
    min_area_m2: float = 2.0,
    furniture_m: float = 0.35,
    pinch: float = PINCH,
    radius_m: float = 0.0,
) -> RegionMap:
    """Cut the free space into named regions, with the doorways between them and the landmarks.

    Every free cell is in one region and every region is 4-connected.  A part of the free space that is cut
    off from the rest and smaller than a room is one region of kind "pocket".

    Args:
        grid: the map.
        min_area_m2: no room or corridor is smaller, unless there is nothing to join it to.
        furniture_m: free-standing things smaller than this are looked past when rooms are told apart.
        pinch: a doorway is narrower than this share of the narrower place beside it.
        radius_m: radius of the robot.  Regions are found on the whole map and cut to the cells on which it fits:
            no point of a cell that is not free is nearer to the cell's centre (see ``footprint.fitted``).

    Raises:
        SettingError: a setting is out of its range.
        MapError: the robot fits nowhere.

    """
    if not isinstance(grid, OccupancyGrid):
        raise TypeError(f"segment needs an OccupancyGrid, from qualrl.read_map, got {type(grid).__name__}")
    _check(min_area_m2=(min_area_m2, 1e6), furniture_m=(furniture_m, 1e3), pinch=(pinch, 1.0))
    resolution_m = grid.resolution_m
    free, in_pockets, pocket = _without_pockets(grid.free, max(min_area_m2 / resolution_m**2, 9))
    view = look(free, resolution_m, furniture_m)
    on_grid = partial(_on_grid, view, grid)
    if resolution_m <= WALLED_M:
        seen, (thing, bends) = _walled(view, free, grid, furniture_m, min_area_m2, on_grid)
    else:
        seen = view.one_a_cell(joined_regions(view, min_area_m2 / view.cell_m**2, pinch))
        thing, bends = on_grid()
    distance, thickness = view.give_away("distance"), view.give_away("thickness")
    shown = view.posture.of(free[view.window])
    found = borrowed(shown.shape, np.int32)
    found.fill(-1)
    np.copyto(found, seen, where=shown)
    del seen
    label = view.placed(_settled(found, shown, min_area_m2 / resolution_m**2), -1)
    del view, on_grid, found, free, shown
    label.ravel()[in_pockets] = pocket + label.max() + 1
    is_pocket = np.zeros(consecutive(label), np.bool_)
    is_pocket[label.ravel()[in_pockets]] = True
    half_width = mean_half_width(label, thickness)
    del thickness
    parts, unordered = both(
        partial(measure, label, is_pocket, half_width),
        partial(find_doorways, label, distance, thing, pinch * half_width, resolution_m),
    )
    del thing
    shapes, kinds = decided(parts, unordered, grid.occupied, resolution_m)
    is_corridor = np.array(kinds) == "corridor"
    ((regions, order), corners), lines = both(
        lambda: (
            listed(parts, shapes, kinds, resolution_m),
            find_corners(label, half_width, bends, resolution_m),
        ),
        partial(corridor_lines, label, is_corridor, distance, half_width),
    )
    rank = np.argsort(order).astype(np.int32)
    renumber(label, rank)
    half_width, doorways = half_width[order], renumbered(unordered, rank.tolist())
    lines = lines._replace(region=rank[lines.region])
    landmarks = find_landmarks(label, regions, doorways, distance, half_width, corners, lines)
    return fitted(RegionMap(grid, label, regions, doorways, landmarks), radius_m)


def _without_pockets(free: Flags, least: float) -> tuple[Flags, NDArray[np.intp], Labels]:
    """The free cells (H, W) but for pieces of fewer cells than the largest and than ``least``; flat indices of those
    pieces' cells, and the piece of each.
    """
    island, cells = _pieces(as_label(free))
    is_pocket = cells < least
    is_pocket[np.argmax(cells)] = False
    apart = cells_with(island, is_pocket)
    linked = free.copy()
    linked.ravel()[apart] = False
    return linked, apart, island.ravel()[apart]


def _check(**settings: tuple[float, float]) -> None:
    """Raise SettingError unless each setting, given as (value, most), is from 0 to its most."""
    for name, (value, most) in settings.items():
        if not 0 <= value <= most:
            raise SettingError(f"segment: {name} must be from 0 to {most:g}, got {value}")


class _OnGrid(NamedTuple):
    """What the view knows, seen from the grid."""

    thing: Things
    """(H, W) number of the piece of furniture at each cell, -1 where none."""
    bends: list[Bend]


def _on_grid(view: View, grid: OccupancyGrid) -> _OnGrid:
    clear = view.to_grid(view.clear, 0)
    return _OnGrid(view.to_grid(view.thing, -1), find_bends(clear & grid.free, grid.resolution_m))


def _walled(
    view: View, free: Flags, grid: OccupancyGrid, furniture_m: float, min_area_m2: float, on_grid: Callable[[], _OnGrid]
) -> tuple[Labels, _OnGrid]:
    """The region of each cell of the view's window, of a map that shows walls (see ``View.one_a_cell``); and the rest.

    Maps whose own cells are very small are seen in larger ones.
    """
    occupied, resolution_m = grid.occupied, grid.resolution_m
    height, width = free.shape
    times = max(int(SIDE_M / resolution_m + 0.2), 1)
    if times == 1 or not (large := shrunk(free, times, False)).any():
        region, found = merged_regions(view, occupied, min_area_m2, on_grid)
        return view.one_a_cell(region), found
    coarse = look(large, resolution_m * times, furniture_m)
    region, found = merged_regions(coarse, shrunk(occupied, times, True), min_area_m2, on_grid)
    blown = coarse.to_grid(region, -1).repeat(times, 0).repeat(times, 1)[:height, :width]
    return view.posture.of(blown[view.window]), found


def _settled(seen: Labels, free: Flags, min_area: float) -> Labels:
    """(H, W) a strict partition of the free space into 4-connected regions, from the view's (seen, overwritten).

    Of each region the largest piece stays and grows over the cells that the view did not show.
    """
    piece, cells = _pieces(seen)
    owner = labels_at(piece, cells.size, seen)
    most = np.zeros(int(seen.max()) + 1, np.int64)
    np.maximum.at(most, owner, cells)
    stays = cells == most[owner]
    number = np.arange(cells.size, dtype=np.int32)
    np.copyto(seen, piece)
    label = renumber(seen, np.where(stays & (cells >= min_area), number, np.int32(-1)))
    level = np.zeros(1, np.float32)
    # Scraps, as between the rays of a scanner, go to the region beside them; where there is none, to themselves.
    flooding.flood(label, free, level)
    left = free & (label < 0)
    if not left.any():
        return label
    np.copyto(label, renumber(piece, np.where(stays, number, np.int32(-1))), where=left)
    flooding.flood(label, free, level)
    return flooding.number_rest(label, free)


def _pieces(label: NDArray[np.signedinteger[Any]]) -> tuple[Labels, NDArray[np.int64]]:
    """(H, W) number of the 4-connected piece of equal label at each cell, and the cells of each piece."""
    piece, count = kernels.pieces(label)
    return piece, sizes(piece, count)
