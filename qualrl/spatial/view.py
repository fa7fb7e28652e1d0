"""The free space as the segmentation looks at it: furniture looked past, widths of all places known.

The thickness of a cell is the radius of the largest free disc that covers it: the same all over a room or a
corridor, with a jump where a corridor opens into a hall.

H, W: rows, columns of the grid.  h, w: rows, columns of the view, which shows the part of the grid that is free, with a
margin of one cell and, on maps drawn in few cells, two cells for each of the grid's (widths of 1 and 2 cells are alike
otherwise).  However a map is turned by quarters or mirrored, the view is the same: see ``spatial.posture``.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.labels import renumber
from qualrl.kernels.scratch import borrowed
from qualrl.kernels.wall_gaps import single_gaps
from qualrl.spatial.distance import distance_within, thickness_over
from qualrl.spatial.posture import Number, Posture, posture

BLOCK_M2 = 4.0
"""Free-standing things of less area are furniture if they are about as long as wide."""
WHISKER_M = 0.12
"""Half-width of the passages that are gaps between a scanner's rays rather than ways."""
WALLED_M = 0.25
"""Maps with cells up to this size show walls and doors as they are built."""
SIDE_M = 0.05
"""Maps that show walls are looked at in cells of about this size."""
COARSE_CELLS = 4.0
"""Another map whose free cells are typically nearer than this to a wall is drawn in few cells."""
GAP_DISTANCE = 0.05
"""Distance from walls, in cells, in gaps of one cell: less than anywhere else."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]
Things = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class View:
    """The free space as the segmentation looks at it; distances and widths in cells of the view."""

    clear: Flags
    """(h, w) free, or furniture; but for passages that are seen past."""
    gap: NDArray[np.intp]
    """Flat indices of the clear cells that are gaps of one cell."""
    thing: Things
    """(h, w) number of the piece of furniture at each cell, -1 where none: it counts as free."""
    zoom: int
    """Cells of the view along each cell of the grid."""
    cell_m: float
    """Side of a cell of the view."""
    window: tuple[slice, slice]
    """The rows and columns of the grid that are shown."""
    shape: tuple[int, int]
    """(H, W)"""
    posture: Posture

    @cached_property
    def distance(self) -> Floats:
        """(h, w) to the nearest cell that is not clear, 0 on those; kept from when it is first asked for."""
        found = distance_within(self.clear)
        found.ravel()[self.gap] = GAP_DISTANCE
        return found

    @cached_property
    def thickness(self) -> Floats:
        """(h, w) radius of the largest free disc over each cell; kept from when it is first asked for."""
        found = thickness_over(self.distance)
        found.ravel()[self.gap] = GAP_DISTANCE
        return found

    def measure(self) -> None:
        """Work out distance and thickness now, where that costs least."""
        _ = self.thickness

    def give_away(self, name: Literal["distance", "thickness"]) -> Floats:
        """(H, W) one of the two as ``width_on_grid`` makes it; the view forgets its own, which takes much memory."""
        found = self.width_on_grid(getattr(self, name))
        del self.__dict__[name]
        return found

    def to_grid(self, array: NDArray[Number], elsewhere: int) -> NDArray[Number]:
        """(H, W) an array (h, w) as seen from the grid, and its value where the view does not reach."""
        return self.placed(self.one_a_cell(array), elsewhere)

    def one_a_cell(self, array: NDArray[Number]) -> NDArray[Number]:
        """What an array (h, w) holds for each cell of the window, as the view shows it."""
        return array[1:-1, 1:-1][:: self.zoom, :: self.zoom]

    def placed(self, shown: NDArray[Number], elsewhere: int) -> NDArray[Number]:
        """(H, W) what is shown of the window's cells, seen from the grid, and its value beyond the window."""
        whole = borrowed(self.shape, shown.dtype.type)
        rows, columns = self.window

        def surround(top: int, bottom: int) -> None:
            part, inside = whole[top:bottom], slice(max(rows.start - top, 0), max(rows.stop - top, 0))
            part[: inside.start] = part[inside.stop :] = elsewhere
            part[inside, : columns.start] = part[inside, columns.stop :] = elsewhere

        in_bands(surround, self.shape, is_light=True)
        self.posture.back(shown, whole[self.window])
        return whole

    def width_on_grid(self, width: Floats) -> Floats:
        """(H, W) a distance or thickness (h, w) of the view, in cells of the grid; 0 where the view does not reach."""
        found = self.to_grid(width, 0)
        if self.zoom > 1:
            found /= np.float32(self.zoom)
        return found

    def of_grid(self, array: NDArray[Number], beyond: int = 0) -> NDArray[Number]:
        """(h, w) an array (H, W) of the grid as seen in the view, margin and all; the value beyond the grid's edges."""
        near, place = zip(
            *(_widened(part, side) for part, side in zip(self.window, self.shape, strict=True)), strict=True
        )
        larger = np.full([part.stop - part.start + 2 for part in self.window], beyond, array.dtype)
        larger[place] = array[near]
        if self.zoom == 1:
            return self.posture.of(larger)
        cells = self.posture.of(larger).repeat(self.zoom, 0).repeat(self.zoom, 1)
        cut = slice(self.zoom - 1, 1 - self.zoom or None)
        return np.ascontiguousarray(cells[cut, cut])


def look(free: Flags, cell_m: float, furniture_m: float) -> View:
    """The view of free cells (H, W) with sides of cell_m, past things smaller than furniture_m."""
    shape = (free.shape[0], free.shape[1])
    left, top, across, down = cv2.boundingRect(free.astype(np.uint8))
    window = (slice(top, top + down), slice(left, left + across))
    turned = posture(free[window])
    free = turned.of(free[window])
    zoom = 2 if _is_coarse(free, cell_m) else 1
    larger = enlarged(free, zoom)
    gap = single_gaps(larger) if zoom == 1 else enlarged(single_gaps(free), zoom)
    thing = _furniture(larger, cell_m / zoom, zoom, furniture_m)
    clear = np.greater_equal(thing, 0)
    clear |= larger
    radius = round(WHISKER_M * zoom / cell_m)
    if radius:
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
        opened = np.asarray(cv2.morphologyEx(clear.view(np.uint8), cv2.MORPH_OPEN, disc)).view(np.bool_)
        clear = opened if opened.any() else clear
    gap &= clear
    return View(clear, np.flatnonzero(gap), thing, zoom, cell_m / zoom, window, shape, turned)


def smallest(most: int) -> type[np.signedinteger[Any]]:
    """The smallest type of whole numbers from -1 to ``most``: label images are large."""
    return np.int8 if most < 2**7 else np.int16 if most < 2**15 else np.int32


def shrunk(flags: Flags, times: int, cell: bool) -> Flags:
    """Flags (H, W) in cells so many times as large: ``cell`` where any of a cell's flags is."""
    rows, columns = (-side % times for side in flags.shape)
    whole = np.pad(flags, ((0, rows), (0, columns)), constant_values=not cell)
    blocks = whole.reshape(whole.shape[0] // times, times, -1, times)
    return np.asarray(blocks.any(axis=(1, 3)) if cell else blocks.all(axis=(1, 3)))


def _widened(part: slice, side: int) -> tuple[slice, slice]:
    """The rows (or columns) of a part and one more at each end, if there is one; and where they lie among these."""
    start, stop = max(part.start - 1, 0), min(part.stop + 1, side)
    return slice(start, stop), slice(start - part.start + 1, stop - part.start + 1)


def enlarged(flags: Flags, zoom: int) -> Flags:
    """(h, w) flags (H, W) with so many cells along each, and a margin."""
    return np.pad(flags if zoom == 1 else flags.repeat(zoom, 0).repeat(zoom, 1), 1)


def _is_coarse(free: Flags, cell_m: float) -> bool:
    """Whether a map (H, W) with such cells is drawn in few of them."""
    if cell_m <= WALLED_M:
        return cell_m > 1.5 * SIDE_M
    return bool(np.median(distance_within(np.pad(free, 1))[1:-1, 1:-1][free]) < COARSE_CELLS)


def _furniture(free: Flags, cell_m: float, zoom: int, furniture_m: float) -> Things:
    """(h, w) number of the free-standing thing at each cell, if it is small or a compact block; else -1.

    cell_m: side of a cell of the view.
    """
    room = borrowed(free.shape, np.int32)
    _, thing, stats, _ = cv2.connectedComponentsWithStats((~free).view(np.uint8), room, connectivity=8)
    width_m, height_m = stats[:, cv2.CC_STAT_WIDTH] * cell_m, stats[:, cv2.CC_STAT_HEIGHT] * cell_m
    solid = stats[:, cv2.CC_STAT_AREA] * cell_m**2 > 0.5 * width_m * height_m
    longer, shorter = np.maximum(width_m, height_m), np.minimum(width_m, height_m)
    # Where walls are one cell thick, what is left of one between its gaps is no block.
    block = solid & (longer < 3 * shorter) & (width_m * height_m < BLOCK_M2) & (shorter > 1.5 * zoom * cell_m)
    looked_past = block | (longer < furniture_m)
    looked_past[[0, thing[0, 0]]] = False
    number = np.where(looked_past, np.cumsum(looked_past) - 1, -1)
    return renumber(np.asarray(thing), number.astype(np.int32)).astype(smallest(int(number.max())))
