"""Slow twins of the loops that move landmarks to where they belong: a cell at a time, in plain Python."""

import numpy as np

from tests.oracles_regions import beside


def into_corner(label, cell, outward, most):
    """The cell a few steps on into a corner."""
    for _ in range(most):
        gains = [
            ((after[0] - cell[0]) * outward[0] + (after[1] - cell[1]) * outward[1], after)
            for after in beside(cell, label.shape)
            if label[after] == label[cell]
        ]
        gain, after = max(gains, default=(0.0, cell))
        if gain < 0.5:
            break
        cell = after
    return cell


def nearest_of_region(label, cell, region):
    """The nearest cell of a region; of equally near ones the first."""
    cells = np.argwhere(label == region)
    away = ((cells - cell) ** 2).sum(axis=1)
    return tuple(cells[np.argmin(away)].tolist())


def within_reach(cell, others, reach):
    """Whether one of some cells is within reach of a cell, in rows and in columns."""
    return any(max(abs(row - cell[0]), abs(column - cell[1])) <= reach for row, column in others)


def clear_of_walls(line, tip, distance, clear, most):
    """The first cell of a line, from its tip on, that is far enough from the walls; no further than where it parts."""
    seen, here = {tip}, tip
    while distance[here] < clear and len(seen) <= most:
        following = [cell for cell in beside(here, line.shape) if line[cell] == line[here] and cell not in seen]
        if len(following) != 1:
            break
        (here,) = following
        seen.add(here)
    return here
