"""What stands around a map: title, scale bar, north arrow, legend, caption.

x, y: pixels from the sheet's top left corner.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from qualrl.report.lettering import SMALLEST_PX, Lettering, px
from qualrl.report.sheet import Sheet
from qualrl.spatial.occupancy_grid import OccupancyGrid

ROW_EM, HANDLE_EM, SPACE_EM = 1.55, 1.7, 0.9
"""Height of a row of the legend, width of a handle, space between entries."""
BAR_SHARE = 0.2
"""The scale bar is at most this share of the sheet's width."""


@dataclass(frozen=True)
class Entry:
    """A line of the legend: how the thing is drawn (arguments of Line2D), and what it is."""

    label: str
    style: dict[str, Any]


@dataclass(frozen=True)
class Legend:
    """Entries with the places they flow to: (x, row) of each."""

    entries: tuple[Entry, ...]
    places: tuple[tuple[float, int], ...]
    rows: int


def flow(entries: Sequence[Entry], first: float, width: float, em: float, letters: Lettering) -> Legend:
    """The legend in as many rows as it takes between ``first`` and the sheet's width."""
    places: list[tuple[float, int]] = []
    x, row = first, 0
    for entry in entries:
        long = HANDLE_EM * em + letters.box(entry.label, legend_size(em))[0]
        if x > first and x + long > width - 0.5 * em:
            x, row = first, row + 1
        places.append((x, row))
        x += long + SPACE_EM * em
    return Legend(tuple(entries), tuple(places), row + 1)


def legend_size(em: float) -> float:
    """Size of the legend's text, in pixels."""
    return max(SMALLEST_PX, 0.9 * em)


def draw_legend(axes: Axes, legend: Legend, top: float, em: float, letters: Lettering) -> None:
    """The entries, the middle of the first row half a row below ``top``."""
    for entry, (x, row) in zip(legend.entries, legend.places, strict=True):
        y = top + (row + 0.5) * ROW_EM * em
        alone = entry.style.get("linestyle") == "none"
        xs = [x + 0.65 * em] if alone else [x, x + 1.3 * em]
        axes.add_line(Line2D(xs, [y] * len(xs), **entry.style))
        letters.write(axes, x + HANDLE_EM * em, y, entry.label, legend_size(em), centred=False)


def round_length(longest_m: float) -> float:
    """The longest of 1, 2, 5, 10, .. metres (or their decimal parts) that is no longer than that.

    >>> round_length(7.0), round_length(0.3)
    (5.0, 0.2)
    """
    power = 10.0 ** math.floor(math.log10(longest_m) + 1e-9)
    return max((k * power for k in (1, 2, 5) if k * power <= longest_m * (1 + 1e-9)), default=power)


def length_text(length_m: float) -> str:
    """Metres in words: 50 m, 0.2 m, 2 km."""
    return f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"


def draw_scale(axes: Axes, sheet: Sheet, resolution_m: float, y: float, letters: Lettering) -> float:
    """A bar of a round length, with ends.  Returns the x where its text ends."""
    length_m = round_length(BAR_SHARE * sheet.width / sheet.scale * resolution_m)
    x, tick = 0.7 * sheet.em, 0.25 * sheet.em
    end = x + length_m / resolution_m * sheet.scale
    xs, ys = [x, x, x, end, end, end], [y - tick, y + tick, y, y, y - tick, y + tick]
    axes.add_line(Line2D(xs, ys, color="black", linewidth=px(0.13 * sheet.em), gid="scale bar"))
    text = length_text(length_m)
    written = letters.write(axes, end + 0.4 * sheet.em, y, text, legend_size(sheet.em), centred=False)
    written.set_gid("scale text")
    return end + 0.4 * sheet.em + letters.box(text, legend_size(sheet.em))[0]


def north_of(grid: OccupancyGrid) -> tuple[float, float]:
    """The unit step (to the right, downwards) in the picture that goes along world y, north."""
    rows, columns = grid.shape
    corner = np.array(grid.to_world(0, 0))
    right, down = np.array(grid.to_world(0, columns)) - corner, np.array(grid.to_world(rows, 0)) - corner
    step = np.array([right[1] / columns, down[1] / rows]) / grid.resolution_m
    length = float(np.hypot(*step))
    return (float(step[0] / length), float(step[1] / length)) if length > 0 else (0.0, -1.0)


def draw_north(axes: Axes, grid: OccupancyGrid, x: float, y: float, em: float, letters: Lettering) -> None:
    """An arrow along world y with its N, within a square of 2.6 em around (x, y)."""
    north = np.array(north_of(grid))
    foot, tip = np.array([x, y]) - 1.2 * em * north, np.array([x, y]) + 0.35 * em * north
    arrow = axes.annotate(
        "", xy=tuple(tip), xytext=tuple(foot), xycoords="data", annotation_clip=False,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": px(0.12 * em), "mutation_scale": 0.6 * em,
                    "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    arrow.set_gid("north")
    beyond = np.array([x, y]) + 0.85 * em * north
    letters.write(axes, float(beyond[0]), float(beyond[1]), "N", max(SMALLEST_PX, 0.85 * em))


def wrap(parts: Sequence[str], size: float, width: float, lines: int, letters: Lettering) -> list[str]:
    """The parts, separated by semicolons, in at most so many lines; the last ends with dots if there are more."""
    words = "; ".join(part for part in parts if part).split(" ")
    done: list[str] = []
    for word in words:
        longer = f"{done[-1]} {word}" if done else word
        if done and letters.box(longer, size)[0] <= width:
            done[-1] = longer
        elif len(done) < lines:
            done.append(letters.fitted(word, size, width)[0])
        else:
            cut = done[-1]
            while " " in cut and letters.box(f"{cut} …", size)[0] > width:
                cut = cut.rsplit(" ", 1)[0]
            done[-1] = f"{cut} …"
            break
    return done
