"""The overlay: the map with its regions, doors, landmarks and a path drawn over it.

The picture has the map's orientation: row 0 on top.  Sizes and places are in pixels (see ``sheet``).
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from qualrl.report import region_colours
from qualrl.report.furniture import Entry
from qualrl.report.lettering import DPI, SMALLEST_PX, Lettering, px
from qualrl.report.name_places import Lettered, Room, place_beside, place_names
from qualrl.report.page import Frame
from qualrl.report.sheet import Pixels, Sheet, Size, drawn_window
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Doorway, RegionMap

DOOR, PATH, MARK = "#b3001b", "#08306b", "#4a2c85"
DASHES = {False: "-", True: (0, (1.6, 1.1))}
"""Doors are drawn through, openings (borders that no wall narrows) dashed."""
MARKERS = {"corner": "s", "junction": "D", "dead end": "v", "placed": "o", "centre": "P"}
MARK_COLOURS = {"corner": MARK, "junction": "#1b5e20", "dead end": "#7a3e00", "placed": MARK, "centre": "#005a73"}
OTHER_MARKERS = "^<>hXdp"
"""For kinds of landmarks that have no marker of their own, in the order of their names."""
MARK_EM, MARKS_SHARE, SMALLEST_MARK_PX = 0.42, 0.05, 2.5
"""Landmarks are so large, but those of one kind cover at most this share of the regions; kinds whose marks would be
smaller than that are left out."""
MANY_DOORS = 400
"""More doors than this are drawn without a casing."""
MOST_WIDTHS, LEAST_WIDTHS = 150, 0.3
"""The widths of more doors are a heap of text; if a smaller share finds room, none is written."""


def draw_overlay(
    regions: RegionMap, file: Path, path: Sequence[Cell] = (), title: str = "", size: Size | None = None
) -> None:
    """Write the overlay as PNG.  size: (width, height) in pixels; without it one that suits the map."""
    overlay_figure(regions, path, title, size).savefig(file, dpi=DPI, metadata={"Software": None})


def overlay_figure(
    regions: RegionMap, path: Sequence[Cell] = (), title: str = "", size: Size | None = None
) -> Figure:  # fmt: skip
    """The overlay as a figure whose units are pixels."""
    letters = Lettering([title, *regions.all_names])
    frame = Frame(drawn_window(regions, path), title, size, letters)
    marks = _mark_sizes(regions, frame.sheet(2))
    page = frame.page(_entries(regions, path, frame.em, sorted(marks)))
    page.surround(regions.grid, _draw_map(page.axes, regions, path, page.sheet, marks, letters))
    return page.figure


def _draw_map(
    axes: Axes, regions: RegionMap, path: Sequence[Cell], sheet: Sheet, sizes: Mapping[str, float], letters: Lettering
) -> list[str]:
    """All that lies on the map.  Returns what the caption has to say of it."""
    image = region_colours.region_image(regions, sheet.window, sheet.map_height, sheet.map_width)
    cast(Figure, axes.figure).add_artist(Pixels(image, sheet.left, sheet.height - sheet.top - sheet.map_height))
    room = Room(regions, sheet)
    chords = [chord_of(door, regions, sheet) for door in regions.doorways]
    _draw_doors(axes, regions, chords, sheet, room)
    _draw_landmarks(axes, regions, sizes, room)
    _draw_path(axes, path, sheet, room)
    names = place_names(regions, room, letters)
    widths = _place_widths(regions, chords, room, letters)
    marks = _place_marks(regions, room, letters)
    for one in [*names.values(), *widths, *marks]:
        letters.write(axes, one.x, one.y, one.text, one.size, upright=one.upright, halo_px=0.22 * one.size)
    return [*_caption(regions, names, len(widths), letters), _left_out(regions, sizes)]


def chord_of(door: Doorway, regions: RegionMap, sheet: Sheet) -> NDArray[np.float64]:
    """(2, 2) x, y of the ends of a doorway's chord, on the outer sides of its end cells."""
    ends = np.array(door.ends, np.float64)
    reach = ends[1] - ends[0]
    if not reach.any():  # a single cell: the chord goes from wall to wall
        row, column = door.ends[0]
        beside = regions.label[row, max(column - 1, 0) : column + 2]
        reach = np.array([0.0, 1.0]) if (beside < 0).any() else np.array([1.0, 0.0])
    reach = reach / np.hypot(*reach) / 2
    return np.array([sheet.at(*(ends[0] - reach)), sheet.at(*(ends[1] + reach))])


def _draw_doors(
    axes: Axes, regions: RegionMap, chords: Sequence[NDArray[np.float64]], sheet: Sheet, room: Room
) -> None:  # fmt: skip
    casing: list[patheffects.AbstractPathEffect] = [
        patheffects.withStroke(linewidth=px(_door_px(sheet.em) + 2), foreground="white")
    ]
    for is_open, dashes in DASHES.items():
        drawn = [chord for chord, door in zip(chords, regions.doorways, strict=True) if door.is_open == is_open]
        if drawn:
            width = px(_door_px(sheet.em) * (0.75 if is_open else 1.0))
            lines = LineCollection(drawn, colors=DOOR, linestyles=[dashes], linewidths=width, zorder=3, gid="doors")
            if len(drawn) <= MANY_DOORS:
                lines.set_path_effects(casing)
            axes.add_collection(lines, autolim=False)
            room.mark_lines(drawn, _door_px(sheet.em) / 2)


def _door_px(em: float) -> float:
    return 0.24 * em


def _style(kind: str, kinds: Sequence[str]) -> tuple[str, str]:
    """Marker and colour of a kind of landmark."""
    others = [other for other in kinds if other not in MARKERS]
    marker = MARKERS.get(kind) or OTHER_MARKERS[others.index(kind) % len(OTHER_MARKERS)]
    return marker, MARK_COLOURS.get(kind, MARK)


def _mark_sizes(regions: RegionMap, sheet: Sheet) -> dict[str, float]:
    """In pixels, of each kind of landmarks that is drawn as marks; doorways are drawn as chords."""
    counts = Counter(mark.kind for mark in regions.landmarks if mark.kind != "doorway" and sheet.shows(mark.cell))
    room = MARKS_SHARE * sheet.scale**2 * np.count_nonzero(regions.label[sheet.window] >= 0)
    sizes = {kind: min(MARK_EM * sheet.em, math.sqrt(room / count)) for kind, count in counts.items()}
    return {kind: size for kind, size in sizes.items() if size >= SMALLEST_MARK_PX}


def _left_out(regions: RegionMap, sizes: Mapping[str, float]) -> str:
    """What the caption says of landmarks that are too many to be drawn."""
    counts = Counter(mark.kind for mark in regions.landmarks if mark.kind not in ("doorway", *sizes))
    listed = ", ".join(f"{count:,} {kind}{'' if count == 1 else 's'}" for kind, count in sorted(counts.items()))
    return f"not drawn: {listed}" if listed else ""


def _draw_landmarks(axes: Axes, regions: RegionMap, sizes: Mapping[str, float], room: Room) -> None:
    sheet = room.sheet
    for kind, size in sorted(sizes.items()):
        marks = [mark for mark in regions.landmarks if mark.kind == kind and sheet.shows(mark.cell)]
        places = np.array([sheet.at(*mark.cell) for mark in marks])
        marker, colour = _style(kind, sorted(sizes))
        axes.plot(
            places[:, 0], places[:, 1], marker, color=colour, markersize=px(size), markeredgecolor="white",
            markeredgewidth=0.4, zorder=4, gid=kind,
        )  # fmt: skip
        room.mark(places, 0.75 * size)


def _draw_path(axes: Axes, path: Sequence[Cell], sheet: Sheet, room: Room) -> None:
    if not path:
        return
    places = np.array([sheet.at(*cell) for cell in path])
    axes.plot(places[:, 0], places[:, 1], color=PATH, linewidth=px(0.2 * sheet.em), zorder=4.5)
    for place, style in zip((places[:1], places[-1:]), (start_style(sheet.em), goal_style(sheet.em)), strict=True):
        axes.plot(place[:, 0], place[:, 1], zorder=5, **style)
        room.mark(place, 0.75 * sheet.em, hard=True)
    room.mark_lines([places], 0.15 * sheet.em, hard=False)


def start_style(em: float) -> dict[str, Any]:
    """How the start is marked."""
    return {
        "color": PATH, "marker": "o", "linestyle": "none", "markersize": px(0.9 * em), "markerfacecolor": "white",
        "markeredgewidth": px(0.2 * em),
    }  # fmt: skip


def goal_style(em: float) -> dict[str, Any]:
    """How the goal is marked."""
    return {
        "color": PATH, "marker": "*", "linestyle": "none", "markersize": px(1.5 * em), "markeredgecolor": "white",
        "markeredgewidth": px(0.06 * em),
    }  # fmt: skip


def _place_widths(
    regions: RegionMap, chords: Sequence[NDArray[np.float64]], room: Room, letters: Lettering
) -> list[Lettered]:
    """The widths of doors in metres, of those that have room beside them."""
    size = max(SMALLEST_PX, 0.7 * room.sheet.em)
    gap = _door_px(room.sheet.em) / 2 + 4
    found = [
        place_beside(
            f"{door.width_m:.2f} m", size, chord.mean(axis=0), (chord[1] - chord[0]) / 2, door.pair, room, letters, gap
        )
        for door, chord in zip(regions.doorways, chords, strict=True)
        if len(chords) <= MOST_WIDTHS
    ]
    placed = [place for place in found if place is not None]
    return placed if len(placed) >= LEAST_WIDTHS * len(chords) else []


def _place_marks(regions: RegionMap, room: Room, letters: Lettering) -> list[Lettered]:
    """The names of landmarks that the user placed."""
    size = max(SMALLEST_PX, 0.75 * room.sheet.em)
    found = [
        place_beside(
            letters.writable(mark.name), size, np.array(room.sheet.at(*mark.cell)), np.zeros(2), mark.regions,
            room, letters, 0.3 * room.sheet.em + 2, must=True,
        )
        for mark in regions.landmarks
        if mark.kind == "placed"
    ]  # fmt: skip
    return [place for place in found if place is not None]


def _entries(regions: RegionMap, path: Sequence[Cell], em: float, kinds: Sequence[str]) -> list[Entry]:
    """The legend: what occurs on this map, and nothing else."""
    entries = [
        Entry(name, {"color": DOOR, "linestyle": DASHES[is_open], "linewidth": px(_door_px(em))})
        for name, is_open in (("door", False), ("opening", True))
        if any(door.is_open == is_open for door in regions.doorways)
    ]
    for kind in kinds:
        marker, colour = _style(kind, kinds)
        entries.append(
            Entry(kind, {"color": colour, "marker": marker, "linestyle": "none", "markersize": px(0.5 * em)})
        )
    if path:
        entries.append(Entry("path", {"color": PATH, "linewidth": px(0.2 * em)}))
        entries += [Entry("start", start_style(em)), Entry("goal", goal_style(em))]
    square = {"marker": "s", "linestyle": "none", "markersize": px(0.9 * em), "markeredgewidth": px(1.0)}
    if any(region.kind == "pocket" for region in regions.regions):
        striped = {"fillstyle": "top", "markerfacecolor": "white", "markerfacecoloralt": region_colours.UNKNOWN}
        entries.append(Entry("pocket", {"color": "#777777", **square, **striped}))
    if regions.grid.tight is not None:
        outlined = {"markerfacecolor": region_colours.TIGHT, "markeredgecolor": "#777777"}
        entries.append(Entry("too tight", {"color": "#777777", **square, **outlined}))
    if regions.grid.unknown_cells:
        entries.append(Entry("unknown", {"color": region_colours.UNKNOWN, **square}))
    return entries


def _caption(regions: RegionMap, names: dict[int, Lettered], widths: int, letters: Lettering) -> list[str]:
    """What the picture leaves out, and what its short names mean."""
    shortened = {
        index: one.text for index, one in names.items() if one.text.replace("\n", " ") != regions.regions[index].name
    }
    left_out = [region for index, region in enumerate(regions.regions) if index not in names]
    pockets = sum(region.kind == "pocket" for region in left_out)
    counts = [
        f"{count:,} {what}{'' if count == 1 else 's'}"
        for count, what in ((len(left_out) - pockets, "region"), (pockets, "pocket"))
        if count
    ]
    without = len(regions.doorways) - widths
    return [
        ", ".join(f"{short} = {letters.writable(name)}" for short, name in _examples(regions, shortened)),
        f"without a name here: {', '.join(counts)}" if counts else "",
        f"without a width: {without:,} of {len(regions.doorways):,} doors" if without else "",
    ]


def _examples(regions: RegionMap, shortened: dict[int, str]) -> list[tuple[str, str]]:
    """Of each kind's short names the first, and every number that stands for a name."""
    seen: set[str] = set()
    examples = []
    for index, short in sorted(shortened.items()):
        region = regions.regions[index]
        if short == str(index + 1) or region.kind not in seen:
            examples.append((short, region.name))
        if short != str(index + 1):
            seen.add(region.kind)
    return examples
