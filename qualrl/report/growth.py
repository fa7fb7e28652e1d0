"""How a map became known: what a robot made of it, stage by stage."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from qualrl.learning.growth import Growth
from qualrl.report.region_colours import NOT_FREE, PALETTE, colour_index

COLUMNS = 3


def draw_growth(growth: Growth, file: Path) -> None:
    """Write the snapshots as PNG, side by side; a name has the same colour in all of them."""
    rows = -(-len(growth.snapshots) // COLUMNS)
    height, width = growth.regions.label.shape
    figure = Figure(figsize=(12, 0.4 + rows * (0.3 + 4 * height / width)), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    names = list(dict.fromkeys(name for regions in growth.snapshots for name in regions.region_names))
    for number, regions in enumerate(growth.snapshots, 1):
        table = [to_rgb(PALETTE[names.index(name) % len(PALETTE)]) for name in regions.region_names]
        axes = figure.add_subplot(rows, COLUMNS, number)
        axes.imshow(np.array([*table, *map(to_rgb, NOT_FREE)])[colour_index(regions)], interpolation="nearest")
        for region in regions.regions:
            if region.kind != "pocket":
                axes.text(*region.centre[::-1], region.name, ha="center", va="center", fontsize=7)
        axes.set_title(f"{int(regions.grid.free.sum()):,} of {growth.free_cells:,} cells known", fontsize=9)
        axes.set_axis_off()
    figure.savefig(file, metadata={"Software": None})
