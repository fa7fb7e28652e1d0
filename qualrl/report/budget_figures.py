"""Pictures of what a greedy policy is worth after so many environment steps, and of the paths it takes.

P: looks.  Bands hold 80 % of the runs (10 to 90 %).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap

Floats = NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8c6d1f", "#6a3d9a")
LINES = ("-", "--", "-.", ":", (0, (5, 1)))
OPTIMUM, WALL, FLOOR, DOOR = "#555555", "#222222", "#ffffff", "#e31a1c"
DPI = 120
LONGEST = 1.25
"""Longer paths, as a multiple of the shortest, are drawn at the top."""
NEVER = 1.3


@dataclass(frozen=True, eq=False)
class BudgetCurve:
    """What was seen at each look: (P,) each, median and band over the runs; infinite where no path arrives."""

    label: str
    steps: Floats
    median: Floats
    low: Floats
    high: Floats


def draw_navigation(
    regions: RegionMap,
    walks: Mapping[str, Sequence[Sequence[Cell]]],
    curves: Sequence[BudgetCurve],
    file: Path,
    *,
    title: str,
    optimum: float,
) -> None:
    """The map with the paths learned at the end (left), and how their length came down (right)."""
    figure = _figure((15.5, 7.2), title)
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    _draw_map(left, regions)
    for at, curve in enumerate(curves):
        for walk in walks.get(curve.label, ()):
            rows, columns = zip(*walk, strict=True)
            left.plot(columns, rows, color=COLOURS[at % len(COLOURS)], linewidth=1.3, alpha=0.8)
    ends = next((walk for found in walks.values() for walk in found), ())
    if ends:
        for (row, column), name, marker in ((ends[0], "start", "o"), (ends[-1], "goal", "*")):
            left.plot(column, row, marker, color="black", markersize=8 if marker == "o" else 12)
            left.annotate(name, (column, row), xytext=(8, -12), textcoords="offset points", fontweight="bold")
    left.set_title("greedy paths at the end, of every run that arrives")
    for at, curve in enumerate(curves):
        heights = [_height(line, optimum) for line in (curve.median, curve.low, curve.high)]
        arrived = sum(1 for _ in walks.get(curve.label, ()))
        colour, line = _style(at)
        right.fill_between(curve.steps, heights[1], heights[2], color=colour, alpha=0.15, linewidth=0, step="post")
        right.plot(curve.steps, heights[0], linestyle=line, color=colour, linewidth=1.9, drawstyle="steps-post",
                   label=f"{curve.label}: {arrived} arrive")  # fmt: skip
    right.axhline(1, color=OPTIMUM, linewidth=1, linestyle=(0, (6, 3)), label=f"shortest: {optimum:.0f} steps")
    right.set(xscale="log", xlabel="Environment steps", ylim=(0.99, NEVER + 0.02))
    right.set_ylabel("Greedy path / shortest (median, band of 80 % of the runs)")
    ticks = np.arange(1, LONGEST + 0.01, 0.05)
    right.set_yticks([*ticks, NEVER], [*(f"{tick:.2f}" for tick in ticks), "none\narrives"])
    right.grid(alpha=0.25)
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(file, metadata={"Software": None})


def draw_values(curves: Sequence[BudgetCurve], file: Path, *, title: str, optimum: float) -> None:
    """Mean value of the greedy policy against environment steps."""
    figure = _figure((10, 6.4), title)
    axes = figure.subplots()
    for at, curve in enumerate(curves):
        colour, line = _style(at)
        axes.fill_between(curve.steps, curve.low, curve.high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(curve.steps, curve.median, linestyle=line, color=colour, linewidth=1.9, label=curve.label)
    axes.axhline(optimum, color=OPTIMUM, linewidth=1, linestyle=(0, (6, 3)), label=f"optimum: {optimum:.3g}")
    axes.set(xscale="log", xlabel="Environment steps")
    axes.set_ylabel("Mean value of the greedy policy over all starts\n(median, band of 80 % of the runs)")
    axes.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=3)
    figure.savefig(file, metadata={"Software": None})


def _style(at: int) -> tuple[str, str | tuple[int, tuple[int, int]]]:
    """Colour and line of a curve: no two of the first forty are alike."""
    return COLOURS[at % len(COLOURS)], LINES[at % len(LINES)]


def _draw_map(axes: Axes, regions: RegionMap) -> None:
    height, width = regions.label.shape
    axes.imshow(np.where(regions.grid.free, 1.0, 0.13), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    for door in regions.doorways:
        (top, left), (bottom, right) = door.ends
        axes.plot([left, right], [top, bottom], color=DOOR, linewidth=2)
    for region in regions.regions:
        row, column = region.centre
        axes.text(column, row, region.name, ha="center", va="center", fontsize=8, color="#999999")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axes.set_axis_off()


def _height(steps: Floats, optimum: float) -> Floats:
    """Where a path is drawn."""
    ratio = steps / optimum
    return np.where(np.isfinite(ratio), np.minimum(ratio, LONGEST), NEVER)


def _figure(size: tuple[float, float], title: str) -> Figure:
    figure = Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    return figure
