"""The sheet of paper that a map is drawn on: where things are, in pixels from the top left corner."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.report.lettering import DPI
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap

Size = tuple[int, int]
"""(width, height) of a picture in pixels."""
SMALLEST, LARGEST = 200, 10_000
"""Sides of a picture that may be asked for, in pixels."""
LONG_SIDE_PX = (1400, 2600)
"""A map's longer side is drawn between these, whatever its size, unless the user asks for another."""
MARGIN = 0.02
"""So much is drawn around the regions, as a share of their longer side."""
LEAST_WIDE_PX = 700
"""A narrow map's sheet is this wide, so that the legend has room."""


def parse_size(text: str) -> Size:
    """Width and height in pixels from WIDTHxHEIGHT; raises SettingError.

    >>> parse_size("600x400")
    (600, 400)
    """
    match = re.fullmatch(r"(\d{1,9})\s*[xX]\s*(\d{1,9})", text.strip())
    if match is None:
        raise SettingError(f"--size: {text!r} is not WIDTHxHEIGHT in pixels, as 600x400")
    size = int(match[1]), int(match[2])
    if not all(SMALLEST <= side <= LARGEST for side in size):
        raise SettingError(f"--size: each side must be from {SMALLEST} to {LARGEST} pixels, got {text}")
    return size


@dataclass(frozen=True)
class Sheet:
    """Sizes in pixels; x grows to the right, y downwards.  The map keeps its proportions and its orientation."""

    width: int
    height: int
    em: float
    """Size of ordinary text."""
    left: int
    top: int
    map_width: int
    map_height: int
    scale: float
    """Pixels a cell."""
    window: tuple[slice, slice]
    """Rows and columns of the map that are drawn."""
    foot: float
    """Height of what stands below the map."""

    def shows(self, cell: Cell) -> bool:
        """Whether a cell lies on the part of the map that is drawn."""
        return all(side.start <= at < side.stop for at, side in zip(cell, self.window, strict=True))

    def at(self, row: float, column: float) -> tuple[float, float]:
        """(x, y) of the middle of a cell."""
        across, down = column + 0.5 - self.window[1].start, row + 0.5 - self.window[0].start
        return self.left + across * self.scale, self.top + down * self.scale


def default_size(rows: int, columns: int) -> Size:
    """(width, height) of a map of so many cells when nobody asks: small maps are blown up, huge ones shrunk."""
    long_side = float(np.clip(2 * max(rows, columns), *LONG_SIDE_PX))
    scale = long_side / max(rows, columns)
    return max(round(columns * scale), LEAST_WIDE_PX), max(round(rows * scale), 1)


def em_of(width: int, height: int) -> float:
    """Size of ordinary text in a picture of that size, in pixels."""
    return float(np.clip(8 + 0.007 * np.sqrt(width * height), 10, 30))


def drawn_window(regions: RegionMap, path: Sequence[Cell] = ()) -> tuple[slice, slice]:
    """Rows and columns of the part of a map with its regions and the path, with a margin.

    The unknown around it, and the pockets that noise leaves there, would only take room.
    """
    is_shown = np.array([*(region.kind != "pocket" for region in regions.regions), False])
    shown = is_shown[regions.label] if is_shown.any() else regions.grid.free.copy()  # label -1 reads the last entry
    for cell in path:
        shown[cell] = True
    spans = [np.flatnonzero(shown.any(axis=axis)) for axis in (1, 0)]
    margin = 2 + int(MARGIN * max(int(span[-1] - span[0]) for span in spans))
    rows, columns = (
        slice(max(0, int(span[0]) - margin), min(side, int(span[-1]) + 1 + margin))
        for span, side in zip(spans, regions.grid.shape, strict=True)
    )
    return rows, columns


def lay_out(window: tuple[slice, slice], size: Size, head: float, foot: float, em: float) -> Sheet:
    """The map as large as it gets, in the middle between ``head`` pixels at the top and ``foot`` at the bottom."""
    rows, columns = (side.stop - side.start for side in window)
    room = max(size[0] - 2, 1), max(size[1] - head - foot, 1)
    scale = min(room[0] / columns, room[1] / rows)
    map_width, map_height = max(round(columns * scale), 1), max(round(rows * scale), 1)
    left, top = (size[0] - map_width) // 2, round(head + (room[1] - map_height) / 2)
    return Sheet(*size, em, left, top, map_width, map_height, scale, window, foot)


class Pixels(Artist):
    """A picture laid on the sheet pixel by pixel, below all else that is drawn.

    A figure's own images are turned into floating point and resampled even where that changes nothing, which takes
    longer than all the rest of the picture, and a hundred bytes a pixel.
    """

    def __init__(self, image: NDArray[np.uint8], left: int, bottom: int) -> None:
        """RGB (height, width, 3), its top row first, and where it lies, in pixels from the lower left."""
        super().__init__()
        self.image, self.left, self.bottom = image, left, bottom
        self.set_zorder(-1)

    def draw(self, renderer: RendererBase) -> None:
        """See Artist."""
        context = renderer.new_gc()
        opaque = np.dstack([self.image, np.full(self.image.shape[:2], 255, np.uint8)])
        renderer.draw_image(context, self.left, self.bottom, opaque[::-1])
        context.restore()


def blank(size: Size) -> tuple[Figure, Axes]:
    """A white figure of that size and axes over all of it, whose units are pixels from the top left corner."""
    figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0, size[0]), ylim=(size[1], 0), autoscale_on=False)
    return figure, axes
