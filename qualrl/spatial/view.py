"""The free space as the segmentation looks at it: furniture looked past, widths of all places known.

The thickness of a cell is the radius of the largest free disc that covers it: the same all over a room or a
corridor, with a jump where a corridor opens into a hall.

H, W: rows, columns of the grid.  h, w: rows, columns of the view, which shows the part of the grid that is free, with a
margin of one cell and, on maps drawn in few cells, two cells for each of the grid's (widths of 1 and 2 cells are alike
otherwise).
"""

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from qualrl.kernels import regions as kernels
from qualrl.spatial.distance import distance_within, thickness_over

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
class View:
    """The free space as the segmentation looks at it; distances and widths in cells of the view."""

    distance: Floats
    """(h, w) to the nearest cell that is not free; 0 on those and in passages that are seen past."""
    thickness: Floats
    """(h, w) radius of the largest free disc over each cell."""
    thing: Labels
    """(h, w) number of the piece of furniture at each cell, -1 where none: it counts as free."""
    zoom: int
    """Cells of the view along each cell of the grid."""
    cell_m: float
    """Side of a cell of the view."""
    window: tuple[slice, slice]
    """The rows and columns of the grid that are shown."""
    shape: tuple[int, int]
    """(H, W)"""

    def to_grid(self, array: NDArray[Number], elsewhere: int) -> NDArray[Number]:
        """(H, W) an array (h, w) as seen from the grid, and its value where the view does not reach."""
        whole = np.full(self.shape, elsewhere, array.dtype)
        whole[self.window] = array[1:-1, 1:-1][:: self.zoom, :: self.zoom]
        return whole

    def of_grid(self, flags: Flags) -> Flags:
        """(h, w) flags (H, W) of the grid as seen in the view."""
        return enlarged(flags[self.window], self.zoom)


def look(free: Flags, cell_m: float, furniture_m: float) -> View:
    """The view of free cells (H, W) with sides of cell_m, past things smaller than furniture_m."""
    shape = (free.shape[0], free.shape[1])
    rows, columns = find_objects(free.astype(np.uint8))[0]
    window = (rows, columns)
    free = free[window]
    zoom = 2 if np.median(distance_within(np.pad(free, 1))[1:-1, 1:-1][free]) < COARSE_CELLS else 1
    larger, gap = enlarged(free, zoom), enlarged(_gaps(free), zoom)
    thing = _furniture(larger, cell_m / zoom, zoom, furniture_m)
    clear = larger | (thing >= 0)
    radius = round(WHISKER_M * zoom / cell_m)
    if radius:
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
        opened = cv2.morphologyEx(clear.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0
        clear = opened if opened.any() else clear
    distance = distance_within(clear)
    thickness = thickness_over(distance)
    distance[gap & clear] = thickness[gap & clear] = GAP_DISTANCE
    return View(distance, thickness, thing, zoom, cell_m / zoom, window, shape)


def enlarged(flags: Flags, zoom: int) -> Flags:
    """(h, w) flags (H, W) with so many cells along each, and a margin."""
    return np.pad(flags if zoom == 1 else flags.repeat(zoom, 0).repeat(zoom, 1), 1)


def flat_zones(thickness: Floats, distance: Floats, pinch: float, step: float) -> tuple[Labels, int]:
    """(h, w) zones of alike thickness, -1 where distance is 0, and their number: see ``kernels.regions.flat_zones``."""
    order = kernels.thick_first(thickness, distance)
    return kernels.flat_zones(thickness, distance, order, pinch, step)


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
