"""Pictures of studies in the axes of the paper's figures, in colours that all eyes can tell apart (Okabe and Ito).

P: points of a curve.  R: rows of a surface.  Bands hold 80 % of the runs (10 to 90 %).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STYLES: dict[str, tuple[str, str, float]] = {
    "QL": ("#0072B2", "-", 3.5),
    "option QL (with single moves)": ("#009E73", "-", 2.0),
    "option QL (options only)": ("#56B4E9", "-", 2.0),
    "HQL (run)": ("#E69F00", "--", 2.0),
    "HQL (pair)": ("#000000", ":", 2.0),
    "HQL (episode)": ("#D55E00", "-", 2.0),
    "HQL with replay": ("#CC79A7", "-.", 2.0),
}
"""Colour, line and width by label; QL is wide, since readings of HQL lie upon it."""
OPTIMUM = "#555555"
COLUMNS = 3
DPI = 120


@dataclass(frozen=True, eq=False)
class Curve:
    """Steps over episodes: (P,) each, median and band over the runs."""

    label: str
    episodes: Floats
    median: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes."""

    title: str
    curves: Sequence[Curve]


@dataclass(frozen=True, eq=False)
class Surface:
    """Median steps over a setting and episodes."""

    title: str
    setting: str
    values: Floats
    """(R,) of the setting."""
    episodes: Floats
    """(P,)"""
    steps: Floats
    """(R, P)"""


@dataclass(frozen=True, eq=False)
class LawFigure:
    """Episodes x alpha: over learning rates, as (alpha, low, median, high), and over corridors."""

    rates: dict[str, list[tuple[float, float, float, float]]]
    flat: dict[int, float]
    """Length of a corridor -> cost of the learner without landmarks."""
    layered: dict[int, list[tuple[int, float]]]
    """Length of a corridor -> (steps between landmarks, cost)."""
    depth: int
    longest_stretch: int


def draw_curves(
    panels: Sequence[Panel], file: Path, *, title: str, optimum: int, most_steps: float, most_episodes: int
) -> None:
    """Steps per episode against episodes, as in Figures 7, 8, 9 and 11."""
    wide = min(len(panels), COLUMNS)
    rows = -(-len(panels) // wide)
    figure = _figure((max(5.2 * wide, 9), 4.8 * rows + 0.4), title)
    all_axes = figure.subplots(rows, wide, squeeze=False, sharey=True).ravel()
    for axes, panel in zip(all_axes, panels, strict=False):
        shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.92, max(len(panel.curves), 2)))
        for curve, shade in zip(panel.curves, shades, strict=False):
            colour, line, width = STYLES.get(curve.label, (shade, "-", 1.8))
            axes.fill_between(curve.episodes, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
            axes.plot(curve.episodes, curve.median, line, color=colour, linewidth=width, label=curve.label)
        axes.axhline(optimum, color=OPTIMUM, linewidth=1, linestyle=(0, (6, 3)), label=f"optimum: {optimum} steps")
        axes.set(title=panel.title, xlabel="Episodes", xlim=(0, most_episodes), ylim=(0, most_steps))
        axes.grid(alpha=0.25)
        axes.legend(framealpha=0.9)
    all_axes[0].set_ylabel("Steps per episode (median, band of 80 % of the runs)")
    for axes in all_axes[len(panels) :]:
        axes.set_visible(False)
    _save(figure, file)


def draw_surfaces(surfaces: Sequence[Surface], file: Path, *, title: str, most_steps: float) -> None:
    """Steps over a setting and episodes, as in Figures 10 and 12; what is higher is cut off."""
    figure = _figure((5.4 * len(surfaces), 4.9), title)
    for number, surface in enumerate(surfaces, 1):
        axes: Any = figure.add_subplot(1, len(surfaces), number, projection="3d")
        across, along = np.meshgrid(surface.episodes, surface.values)
        height = np.minimum(surface.steps, most_steps)
        axes.plot_surface(
            along, across, height, cmap="viridis", vmin=0, vmax=most_steps,
            rcount=len(surface.values), ccount=len(surface.episodes), linewidth=0.1, edgecolor="#00000033",
        )  # fmt: skip
        axes.set(title=surface.title, zlim=(0, most_steps))
        axes.set_xlabel(surface.setting, labelpad=8)
        axes.set_ylabel("Episodes", labelpad=10)
        axes.set_zlabel("Steps per episode", labelpad=4)
        axes.set_xlim(surface.values.max(), surface.values.min())
        axes.view_init(elev=28, azim=35)
        axes.set_xticks(surface.values[1::2])
        axes.set_box_aspect((1.0, 1.25, 0.8), zoom=0.95)
    _save(figure, file)


def draw_law(law: LawFigure, file: Path, *, title: str) -> None:
    """Episodes x alpha over alpha (left), and over the steps between landmarks in corridors (right)."""
    figure = _figure((13, 5.4), title)
    left, right = figure.subplots(1, 2)
    _draw_rates(left, law)
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.9, len(law.layered)))
    for (length, points), shade in zip(law.layered.items(), shades, strict=True):
        spacings, costs = zip(*points, strict=True)
        right.plot(spacings, costs, "o-", color=shade, label=f"HQL, {length} steps long")
        right.plot([length], [law.flat[length]], "D", color=shade, markersize=8, markeredgecolor="black")
    right.plot([], [], "D", color="white", markeredgecolor="black", label="QL (no landmarks)")
    lengths = list(law.layered)
    right.set(xlabel="Steps between landmarks (QL: the corridor's length)", ylabel="Episodes x alpha", xscale="log",
              title="corridors, eta counted by episode", ylim=(0, None))  # fmt: skip
    ticks = sorted({spacing for points in law.layered.values() for spacing, _ in points} | set(lengths))
    right.set_xticks(ticks, [str(tick) for tick in ticks])
    right.set_xticks([], minor=True)
    right.grid(alpha=0.25)
    right.legend()
    _save(figure, file)


def _draw_rates(axes: Axes, law: LawFigure) -> None:
    for label, points in law.rates.items():
        alphas, low, median, high = (np.array(column) for column in zip(*points, strict=True))
        colour, line, width = STYLES[label]
        axes.fill_between(alphas, low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(alphas, median, line, marker="o", color=colour, linewidth=width, label=label)
    axes.axhline(law.depth, color=OPTIMUM, linestyle=(0, (6, 3)), linewidth=1)
    axes.text(0.005, law.depth + 0.4, f"depth: {law.depth} cells", color=OPTIMUM)
    axes.axhline(law.longest_stretch, color=OPTIMUM, linestyle=(0, (2, 2)), linewidth=1)
    axes.text(
        0.2, law.longest_stretch - 1.6, f"longest stretch: {law.longest_stretch} cells", color=OPTIMUM, ha="right"
    )
    ticks = (0.005, 0.01, 0.02, 0.04, 0.08, 0.2)
    axes.set(xlabel="Learning rate alpha", ylabel="Episodes x alpha (median, band of 80 % of the runs)", xscale="log",
             title="the puzzle", ylim=(0, 45))  # fmt: skip
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.grid(alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(0.0, 0.42))


def _figure(size: tuple[float, float], title: str) -> Figure:
    figure = Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    return figure


def _save(figure: Figure, file: Path) -> None:
    figure.savefig(file, metadata={"Software": None})
