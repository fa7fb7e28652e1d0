"""A goal that cannot be reached, drawn: the parts that hold start and goal, what is in the way, what would open it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from qualrl.answers.openings import Cleared, OtherThresholds, SmallerRobot
from qualrl.answers.why_unreachable import WhyUnreachable
from qualrl.report.furniture import Entry
from qualrl.report.lettering import DPI, Lettering, px
from qualrl.report.name_places import Room, place_names
from qualrl.report.overlay import PATH, goal_style, start_style
from qualrl.report.page import Frame
from qualrl.report.region_colours import TIGHT, UNKNOWN, WALL, painted
from qualrl.report.sheet import Pixels, Sheet, Size, drawn_window
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap

COLOURS = {
    "other free cells": "#e3ead9", "start's part": "#b9d7f2", "goal's part": "#f7d9a3", "too tight": TIGHT,
    "unknown": UNKNOWN, "wall": WALL, "freed by the threshold": "#8e44c9", "to be cleared": "#ff8c1a",
    "in the way": "#d7191c",
}  # fmt: skip
"""In the order in which they are laid over one another."""
NAMES = list(COLOURS)
RING = COLOURS["in the way"]
MOST_RINGS = 50
RING_EM = 1.8
"""A ring around what is in the way, which on a large map is smaller than a pixel, is at least so wide."""


def draw_blocked(regions: RegionMap, answer: WhyUnreachable, file: Path, size: Size | None = None) -> None:
    """Write the picture as PNG.  size: (width, height) in pixels; without it one that suits the map."""
    blocked_figure(regions, answer, size).savefig(file, dpi=DPI, metadata={"Software": None})


def blocked_figure(regions: RegionMap, answer: WhyUnreachable, size: Size | None = None) -> Figure:
    """The picture as a figure whose units are pixels."""
    title = answer.explain().splitlines()[0].rstrip(".")
    caption = [f"opened by {opening.brief()}" for opening in answer.openings]
    letters = Lettering([title, *caption, *regions.all_names])
    index = colours_of(regions, answer)
    shown = [cell for way in (answer.way, *(opening.way for opening in answer.openings)) for cell in way]
    frame = Frame(drawn_window(regions, shown), title, size, letters)
    page = frame.page(_entries(answer, np.unique(index[frame.window]).tolist(), frame.em))
    sheet, axes = page.sheet, page.axes
    image = painted(index[sheet.window], list(COLOURS.values()), sheet.map_height, sheet.map_width)
    cast(Figure, axes.figure).add_artist(Pixels(image, sheet.left, sheet.height - sheet.top - sheet.map_height))
    room = Room(regions, sheet)
    _draw_ways(axes, answer, sheet, room)
    _draw_places(axes, answer, sheet, room)
    for one in place_names(regions, room, letters).values():
        letters.write(axes, one.x, one.y, one.text, one.size, upright=one.upright, halo_px=0.22 * one.size)
    page.surround(regions.grid, [letters.writable(text) for text in caption])
    return page.figure


def colours_of(regions: RegionMap, answer: WhyUnreachable) -> NDArray[np.uint8]:
    """(H, W) index of each cell's colour in ``NAMES``."""
    grid = regions.grid
    index = np.where(grid.occupied, NAMES.index("wall"), NAMES.index("unknown")).astype(np.uint8)
    index[grid.free] = NAMES.index("other free cells")
    if grid.tight is not None:
        index[grid.tight] = NAMES.index("too tight")
    for name, part in zip(("start's part", "goal's part"), answer.parts, strict=False):
        index[part.mask] = NAMES.index(name)
    for opening in answer.openings:
        if isinstance(opening, OtherThresholds):
            _paint(index, [cell for cell in opening.way if not grid.free[cell]], "freed by the threshold")
        if isinstance(opening, Cleared):
            _paint(index, opening.cells, "to be cleared")
    for place in answer.crossings:
        _paint(index, [cell for cell in place.cells if place.door is None], "in the way")
    return index


def _paint(index: NDArray[np.uint8], cells: Sequence[Cell], name: str) -> None:
    index[tuple(np.array(cells, np.int64).reshape(-1, 2).T)] = NAMES.index(name)


def _draw_ways(axes: Axes, answer: WhyUnreachable, sheet: Sheet, room: Room) -> None:
    """The way that there is, or those that there would be."""
    for way in {opening.way for opening in answer.openings} or {answer.way}:
        places = np.array([sheet.at(*cell) for cell in way])
        axes.plot(places[:, 0], places[:, 1], **_way_style(sheet.em, answer.is_reachable))
        room.mark_lines([places], 0.15 * sheet.em, hard=False)
    for cell, style in ((answer.way[0], start_style(sheet.em)), (answer.way[-1], goal_style(sheet.em))):
        place = np.array([sheet.at(*cell)])
        axes.plot(place[:, 0], place[:, 1], zorder=5, **style)
        room.mark(place, 0.75 * sheet.em, hard=True)


def _way_style(em: float, is_there: bool) -> dict[str, Any]:
    return {
        "color": PATH, "linewidth": px((0.2 if is_there else 0.12) * em), "linestyle": "-" if is_there else (0, (3, 2)),
        "zorder": 4.5,
    }  # fmt: skip


def _ring_style(em: float) -> dict[str, Any]:
    return {
        "color": RING, "marker": "o", "linestyle": "none", "fillstyle": "none", "markersize": px(RING_EM * em),
        "markeredgewidth": px(0.18 * em),
    }  # fmt: skip


def _narrow_style(em: float) -> dict[str, Any]:
    return {
        "color": PATH, "marker": "X", "linestyle": "none", "markersize": px(0.6 * em), "markeredgecolor": "white",
        "markeredgewidth": px(0.08 * em),
    }  # fmt: skip


def _draw_places(axes: Axes, answer: WhyUnreachable, sheet: Sheet, room: Room) -> None:
    """What is in the way, in rings, closed doorways as bars, and the narrowest place for a smaller robot."""
    for place in answer.crossings[:MOST_RINGS]:
        cells = np.array([sheet.at(*cell) for cell in place.cells])
        ends = cells[[0, -1]]
        wide = max(RING_EM * sheet.em, float(np.hypot(*(ends[1] - ends[0]))) + 1.5 * sheet.scale)
        x, y = ends.mean(axis=0)
        axes.plot([x], [y], zorder=4.8, **{**_ring_style(sheet.em), "markersize": px(wide)})
        room.mark(np.array([[x, y]]), wide / 2, hard=True)
        if place.door is not None:
            across = (ends[1] - ends[0])[::-1] * (-1, 1) / 2
            bar = ends.mean(axis=0) + np.array([-across, across])
            axes.plot(bar[:, 0], bar[:, 1], color=RING, linewidth=px(0.3 * sheet.em), zorder=4.7)
        else:  # over the way, which would hide its cells
            line = np.array([cells[0] - (0.5 * sheet.scale, 0), cells[0] + (0.5 * sheet.scale, 0)])
            line = cells if len(cells) > 1 else line
            axes.plot(line[:, 0], line[:, 1], color=RING, linewidth=px(max(0.3 * sheet.em, sheet.scale)), zorder=4.7)
    for opening in answer.openings:
        if isinstance(opening, SmallerRobot):
            x, y = sheet.at(*opening.narrowest.at)
            axes.plot([x], [y], zorder=4.9, **_narrow_style(sheet.em))


def _entries(answer: WhyUnreachable, present: Sequence[int], em: float) -> list[Entry]:
    """The legend: what occurs on this map; walls explain themselves."""
    square = {"marker": "s", "linestyle": "none", "markersize": px(0.9 * em), "markeredgecolor": "#777777"}
    names = [NAMES[number] for number in present if NAMES[number] != "wall"]
    entries = [Entry("start", start_style(em)), Entry("goal", goal_style(em))]
    entries.append(Entry("way" if answer.is_reachable else "way, once opened", _way_style(em, answer.is_reachable)))
    if answer.crossings:
        entries.append(Entry("in the way", {**_ring_style(em), "markersize": px(0.9 * em)}))
    if any(isinstance(opening, SmallerRobot) for opening in answer.openings):
        entries.append(Entry("narrowest", _narrow_style(em)))
    return entries + [Entry(name, {**square, "color": COLOURS[name]}) for name in names if name != "in the way"]
