"""A page with a map: its title above, and below it the scale bar, the north arrow, the legend and a caption.

Sizes and places are in pixels (see ``sheet``).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from qualrl.report import furniture
from qualrl.report.furniture import Entry, Legend
from qualrl.report.lettering import SMALLEST_PX, Lettering
from qualrl.report.sheet import Sheet, Size, blank, default_size, em_of, lay_out
from qualrl.spatial.occupancy_grid import OccupancyGrid


@dataclass(frozen=True)
class Page:
    """A figure whose units are pixels, and where the map lies on it."""

    figure: Figure
    axes: Axes
    sheet: Sheet
    title: str
    legend: Legend
    lines: int
    """Of the caption."""
    letters: Lettering

    def surround(self, grid: OccupancyGrid, caption: Sequence[str]) -> None:
        """Draw all that stands around the map."""
        sheet, letters = self.sheet, self.letters
        below = sheet.height - sheet.foot
        self._draw_foot(grid, below)
        if self.title:
            text, size = letters.fitted(letters.writable(self.title), 1.1 * sheet.em, sheet.width - 1.4 * sheet.em)
            letters.write(self.axes, 0.7 * sheet.em, 0.95 * sheet.em, text, size, centred=False)
        small = max(SMALLEST_PX, 0.8 * sheet.em)
        under = below + furniture.ROW_EM * max(self.legend.rows, 2) * sheet.em
        for row, line in enumerate(furniture.wrap(caption, small, sheet.width - 1.4 * sheet.em, self.lines, letters)):
            y = under + (0.7 + 1.2 * row) * sheet.em
            letters.write(self.axes, 0.7 * sheet.em, y, line, small, centred=False)

    def _draw_foot(self, grid: OccupancyGrid, top: float) -> None:
        """Scale bar, north arrow and legend, in the rows below the map."""
        axes, sheet, letters, legend = self.axes, self.sheet, self.letters, self.legend
        middle = top + furniture.ROW_EM * sheet.em
        end = furniture.draw_scale(axes, sheet, grid.resolution_m, middle, letters)
        furniture.draw_north(axes, grid, end + 1.9 * sheet.em, middle, sheet.em, letters)
        furniture.draw_legend(
            axes, legend, top + (0 if legend.rows > 1 else 0.5) * furniture.ROW_EM * sheet.em, sheet.em, letters
        )


@dataclass(frozen=True)
class Frame:
    """What a page is made for: a part of a map, a title, and a size if one was asked for."""

    window: tuple[slice, slice]
    """Rows and columns of the map."""
    title: str
    size: Size | None
    """(width, height) in pixels; None for one that suits the map."""
    letters: Lettering

    @property
    def around(self) -> Size:
        """The size, or that of the map."""
        return self.size or default_size(*(side.stop - side.start for side in self.window))

    @property
    def em(self) -> float:
        """Size of ordinary text."""
        return em_of(*self.around)

    @property
    def _lines(self) -> int:
        return 1 if self.around[0] > 1000 else 2

    def sheet(self, legend_rows: int) -> Sheet:
        """Where the map lies above a legend of so many rows."""
        head = 1.9 * self.em if self.title else 0.3 * self.em
        foot = (furniture.ROW_EM * max(legend_rows, 2) + 1.25 * self._lines + 0.5) * self.em
        page = self.size or (self.around[0], self.around[1] + round(head + foot))
        return lay_out(self.window, page, head, foot, self.em)

    def page(self, entries: Sequence[Entry]) -> Page:
        """A blank page with room for a legend.  It reaches right of the longest scale bar, its text and the arrow."""
        first = furniture.BAR_SHARE * self.around[0] + 8.2 * self.em
        legend = furniture.flow(entries, first, self.around[0], self.em, self.letters)
        sheet = self.sheet(legend.rows)
        figure, axes = blank((sheet.width, sheet.height))
        return Page(figure, axes, sheet, self.title, legend, self._lines, self.letters)
