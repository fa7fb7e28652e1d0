"""The overlay: the map with its regions, doors, landmarks and a path drawn over it.

H, W: rows, columns of the map.  The picture has the map's orientation: row 0 on top.
"""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib import patheffects
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Region, RegionMap

PALETTE = (
    "#8dd3c7", "#ffed6f", "#bebada", "#fb9a8b", "#80b1d3", "#fdb462", "#b3de69", "#fccde5",
    "#c9b29b", "#ccebc5", "#9ecae1", "#e7cb94",
)  # fmt: skip
WALL, UNKNOWN, DOOR = "#222222", "#d9d9d9", "#e31a1c"
DOOR_STYLES: dict[bool, tuple[Literal["-", ":"], str]] = {False: ("-", "door"), True: (":", "opening")}
MARKS = {
    "corner": ("s", "#5e3c99"),
    "junction": ("D", "#1b7837"),
    "dead end": ("v", "#8c510a"),
    "placed": ("o", "#5e3c99"),
}
WALL_M = 0.4
"""Regions this near to each other get different colours."""
LEAST_NAMED_PX = 24
"""Smaller regions get no name: it would cover its neighbours'."""
MANY_MARKS = 400
"""More landmarks of a kind than this are drawn smaller."""
LONG_SIDE_PX = (1400, 2600)
"""The picture's longer side lies between these, whatever the map's size."""
DPI = 100
MARK_PX = 30
"""A name this near to the mark of the start or of the goal would cover it."""


def draw_overlay(regions: RegionMap, file: Path, path: Sequence[Cell] = (), title: str = "") -> None:
    """Write the overlay as PNG."""
    height, width = regions.label.shape
    long_side = float(np.clip(2 * max(height, width), *LONG_SIDE_PX))
    scale = long_side / max(height, width)
    size = (width * scale / DPI, height * scale / DPI + 0.9)
    figure = Figure(figsize=size, dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    band = 0.9 / size[1]
    axes = figure.add_axes((0.0, band / 2, 1.0, 1.0 - band))
    axes.imshow(_colours(regions, max(1, int(max(height, width) / LONG_SIDE_PX[1]))),
                extent=(-0.5, width - 0.5, height - 0.5, -0.5), interpolation="nearest")  # fmt: skip
    axes.set_axis_off()
    handles = [*_draw_doors(axes, regions), *_draw_landmarks(axes, regions), *_draw_path(axes, path)]
    for region in regions.regions:
        _draw_name(axes, region, scale, marks=(path[0], path[-1]) if path else ())
    _draw_scale(axes, regions)
    figure.text(0.01, 1 - band / 4, title, va="center", fontsize=13)
    if handles:
        figure.legend(handles=handles, loc="lower right", ncols=len(handles), frameon=False, fontsize=10)
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", message="Glyph .* missing"
        )  # the font lacks a script; names stay right elsewhere
        figure.savefig(file, dpi=DPI, metadata={"Software": None})


def _colours(regions: RegionMap, step: int) -> NDArray[np.float64]:
    """(H, W, 3) colours, every ``step``-th cell."""
    table = [to_rgb(PALETTE[number]) for number in _colour_numbers(regions)] + [to_rgb(UNKNOWN), to_rgb(WALL)]
    index = np.where(regions.label >= 0, regions.label, np.where(regions.grid.occupied, -1, -2))
    return np.array(table)[index[::step, ::step]]


def _colour_numbers(regions: RegionMap) -> list[int]:
    """A colour for each region: not that of one behind a door or a wall, and of the rest the least used."""
    neighbours = _neighbours(regions)
    numbers: list[int] = []
    used = [0] * len(PALETTE)
    for index in range(len(regions.regions)):
        taken = {numbers[other] for other in neighbours[index] if other < index}
        number = min(range(len(PALETTE)), key=lambda colour: (colour in taken, used[colour], colour))
        used[number] += 1
        numbers.append(number)
    return numbers


def _neighbours(regions: RegionMap) -> list[set[int]]:
    """For each region those within a wall's thickness, straight up, down, left or right."""
    neighbours: list[set[int]] = [set() for _ in regions.regions]
    count = len(regions.regions)
    step = max(1, max(regions.label.shape) // LONG_SIDE_PX[1])
    label = regions.label[::step, ::step]
    wall = max(1, round(WALL_M / (regions.grid.resolution_m * step)))
    for shift in sorted({1, max(1, wall // 2), wall}):
        for here, there in ((label[shift:], label[:-shift]), (label[:, shift:], label[:, :-shift])):
            apart = (here != there) & (here >= 0) & (there >= 0)
            pairs = np.unique(here[apart].astype(np.int64) * count + there[apart])
            for pair in pairs.tolist():
                neighbours[pair // count].add(pair % count)
                neighbours[pair % count].add(pair // count)
    return neighbours


def _draw_doors(axes: Axes, regions: RegionMap) -> list[Artist]:
    """Doors as chords; openings, the borders that no wall narrows, dotted."""
    handles: list[Artist] = []
    for is_open, (style, kind) in DOOR_STYLES.items():
        doors = [door for door in regions.doorways if door.is_open == is_open]
        if doors:
            ends = np.array([door.ends for door in doors], float)[:, :, ::-1]
            single = (ends[:, 0] == ends[:, 1]).all(axis=1)  # a door of one cell is a mark as wide as it
            ends[single] += np.array([[-0.3, 0.0], [0.3, 0.0]])
            axes.add_collection(LineCollection(list(ends), colors=DOOR, linestyles=style, linewidths=3))
            handles.append(Line2D([], [], color=DOOR, linestyle=style, linewidth=3, label=kind))
    return handles


def _draw_landmarks(axes: Axes, regions: RegionMap) -> list[Artist]:
    handles: list[Artist] = []
    for kind, (marker, colour) in MARKS.items():
        cells = np.array([mark.cell for mark in regions.landmarks if mark.kind == kind]).reshape(-1, 2)
        if len(cells):
            size = 5 if len(cells) <= MANY_MARKS else 2
            drawn = axes.plot(cells[:, 1], cells[:, 0], marker, color=colour, markersize=size, alpha=0.8, label=kind)
            handles.extend(drawn)
    return handles


def _draw_path(axes: Axes, path: Sequence[Cell]) -> list[Artist]:
    if not path:
        return []
    cells = np.array(path)
    axes.plot(cells[:, 1], cells[:, 0], color="#08306b", linewidth=2.5)
    axes.plot(*cells[0][::-1], "o", color="#08306b", markersize=11, markerfacecolor="white", markeredgewidth=3)
    axes.plot(*cells[-1][::-1], "*", color="#08306b", markersize=20)
    return [
        Line2D([], [], color="#08306b", linewidth=2.5, label="path"),
        Line2D([], [], color="#08306b", marker="o", markerfacecolor="white", linestyle="none", label="start"),
        Line2D([], [], color="#08306b", marker="*", markersize=12, linestyle="none", label="goal"),
    ]


def _draw_name(axes: Axes, region: Region, scale: float, marks: Sequence[Cell]) -> None:
    """At the region's centre, or above a mark there."""
    across_px = float(np.sqrt(region.cells)) * scale
    if region.kind == "pocket" or across_px < LEAST_NAMED_PX:
        return
    size = float(np.clip(across_px / len(region.name) * 0.9, 7, 15))
    row, column = region.centre
    covers = any(max(abs(row - r), abs(column - c)) * scale < MARK_PX for r, c in marks)
    text = axes.annotate(
        region.name, (column, row), (0, 14 if covers else 0), textcoords="offset points", ha="center",
        va="bottom" if covers else "center", fontsize=size, color="black", zorder=5,
    )  # fmt: skip
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white", alpha=0.85)])


def _draw_scale(axes: Axes, regions: RegionMap) -> None:
    """A bar of a round length, and an arrow to the map's north (world y) when the map is turned."""
    height, width = regions.label.shape
    span_m = width * regions.grid.resolution_m
    length_m = 10.0 ** np.floor(np.log10(span_m / 4))
    length_m *= max(k for k in (1, 2, 5) if k * length_m <= span_m / 4)
    end = 0.02 + length_m / span_m
    axes.plot([0.02, end], [-0.012] * 2, color="black", linewidth=3, transform=axes.transAxes, clip_on=False)
    axes.text(end + 0.01, -0.012, f"{length_m:g} m", va="center", fontsize=10, transform=axes.transAxes)
    yaw = regions.grid.origin[2]
    shape = np.array([width, height]) / max(width, height)
    tip = np.array([np.sin(yaw), np.cos(yaw)]) * 0.03 / shape
    foot = np.array([0.97, 0.93])
    arrow = axes.annotate(
        "N", xy=tuple(foot + tip), xytext=tuple(foot - tip), xycoords="axes fraction", ha="center", va="center",
        fontsize=12, fontweight="bold", arrowprops={"arrowstyle": "-|>", "color": "black"},
    )  # fmt: skip
    halo = patheffects.withStroke(linewidth=3, foreground="white")
    arrow.set_path_effects([halo])
    if arrow.arrow_patch is not None:
        arrow.arrow_patch.set_path_effects([halo])
