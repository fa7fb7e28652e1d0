"""Landmarks: doorways, the corners of rooms and corridors, junctions and dead ends of corridors, region centres.

H, W: rows, columns.  Lengths are in cells unless their name says otherwise.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import both
from qualrl.kernels.labels import fill_holes, only
from qualrl.kernels.thinning import degrees
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import CENTRE, Doorway, Landmark, Region
from qualrl.spatial.skeleton import pruned_skeleton

ROUGHNESS_M = 0.2
"""Walls may leave their straight line by this much (and by one cell)."""
LEG_M = 0.6
"""Both walls of a corner are at least this long (and two cells)."""
LEG_SHARE = 0.5
"""... and at least this share of their region's half-width."""
CLEAR = 0.8
"""Dead ends are at least this share of their corridor's half-width from its walls."""
CORNER_RAD = (0.8, 2.2)
"""The walls of a corner meet at an angle in this range."""

Flags = NDArray[np.bool_]
Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


class Bend(NamedTuple):
    """Where two long straight walls meet with the free space between them."""

    leg: float
    """Length of the shorter of the two."""
    cell: Cell
    outward: tuple[float, float]
    """Rows and columns to go to get farther into the corner."""


def find_landmarks(
    label: Ints,
    regions: Sequence[Region],
    doorways: Sequence[Doorway],
    distance: Floats,
    half_width: Floats,
    bends: Sequence[Bend],
    resolution_m: float,
) -> tuple[Landmark, ...]:
    """All landmarks: doorways, corners, junctions, dead ends, centres; each kind by region and position.

    label (H, W); distance (H, W) to the nearest cell that is not free, 0 on those that are looked past;
    half_width by region.
    """
    marks = [Landmark(door.name, "doorway", middle_of(door.cells), door.cells, door.pair) for door in doorways]
    (junctions, dead_ends), corners = both(
        lambda: _corridor_marks(label, regions, doorways, distance, half_width),
        lambda: _corners(label, half_width, bends, resolution_m),
    )
    centres = [region.centre for region in regions if region.kind != "pocket"]
    for kind, cells in (("corner", corners), ("junction", junctions), ("dead end", dead_ends), (CENTRE, centres)):
        for number, cell in enumerate(sorted(cells, key=lambda cell: (label[cell], cell)), start=1):
            place = np.array([cell], np.int32)
            place.setflags(write=False)
            marks.append(Landmark(f"{kind} {number}", kind, cell, place, (int(label[cell]),)))
    return tuple(marks)


def middle_of(cells: Ints) -> Cell:
    """The cell nearest to the mean of the cells."""
    row, column = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
    return int(row), int(column)


def _least_leg(resolution_m: float) -> float:
    return max(LEG_M / resolution_m, 2.0)


def find_bends(free: Flags, resolution_m: float) -> list[Bend]:
    """All bends of the walls around free cells (H, W)."""
    contours, _ = cv2.findContours(free.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    roughness, leg = max(ROUGHNESS_M / resolution_m, 1.0), _least_leg(resolution_m)
    found: list[Bend] = []
    for contour in contours:
        if len(contour) < 2 * leg:
            continue
        shape = cv2.approxPolyDP(contour, roughness, True)[:, 0].astype(np.float64)
        before, after = np.roll(shape, 1, axis=0) - shape, np.roll(shape, -1, axis=0) - shape
        shorter = np.minimum(np.hypot(before[:, 0], before[:, 1]), np.hypot(after[:, 0], after[:, 1]))
        # Contours, of holes too, run with the free space on one side, so one sign tells inner corners.
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        angle = np.arctan2(turn, (before * after).sum(axis=1))
        for at in np.flatnonzero((shorter >= leg) & (angle > CORNER_RAD[0]) & (angle < CORNER_RAD[1])):
            outward = -(before[at] / np.hypot(*before[at]) + after[at] / np.hypot(*after[at]))
            cell = int(shape[at, 1]), int(shape[at, 0])
            found.append(Bend(float(shorter[at]), cell, (float(outward[1]), float(outward[0]))))
    return found


def _corners(label: Ints, half_width: Floats, bends: Sequence[Bend], resolution_m: float) -> list[Cell]:
    """The cells in bends whose walls are long for their region's width."""
    tips = [(leg, _tip(label, cell, outward)) for leg, cell, outward in bends]
    long = [(leg, cell) for leg, cell in tips if leg >= LEG_SHARE * half_width[label[cell]]]
    return _spread(long, _least_leg(resolution_m))


def _tip(label: Ints, cell: Cell, outward: tuple[float, float], most: int = 4) -> Cell:
    """The cell a few steps on into a corner, which may have been rounded off where whiskers were taken off."""
    for _ in range(most):
        row, column = cell
        gains = [
            (down * outward[0] + right * outward[1], (row + down, column + right))
            for down, right in ((-1, 0), (0, -1), (0, 1), (1, 0))
            if 0 <= row + down < label.shape[0]
            and 0 <= column + right < label.shape[1]
            and label[row + down, column + right] == label[cell]
        ]
        gain, after = max(gains, default=(0.0, cell))
        if gain < 0.5:
            break
        cell = after
    return cell


def _spread(found: list[tuple[float, Cell]], least: float) -> list[Cell]:
    """The strongest (strength, cell) first, without those nearer than ``least`` to a stronger one."""
    kept: list[Cell] = []
    tiles: dict[Cell, list[Cell]] = {}
    for _, cell in sorted(found, key=lambda item: (-item[0], item[1])):
        row, column = int(cell[0] // least), int(cell[1] // least)
        near = [
            other
            for r in (row - 1, row, row + 1)
            for c in (column - 1, column, column + 1)
            for other in tiles.get((r, c), ())
        ]
        if all((cell[0] - other[0]) ** 2 + (cell[1] - other[1]) ** 2 >= least**2 for other in near):
            kept.append(cell)
            tiles.setdefault((row, column), []).append(cell)
    return kept


def _corridor_marks(
    label: Ints, regions: Sequence[Region], doorways: Sequence[Doorway], distance: Floats, half_width: Floats
) -> tuple[list[Cell], list[Cell]]:
    """Junctions and dead ends of the corridors: where lines of their skeletons meet, and end at no doorway."""
    is_corridor = np.array([region.kind == "corridor" for region in regions], np.bool_)
    if not is_corridor.any():
        return [], []
    inside = only(label, is_corridor, distance)
    width = 2 * half_width
    shape = _without_holes(inside, width)
    line = pruned_skeleton(shape, distance)
    nodes = np.flatnonzero(line >= 0)
    ways = degrees(line, nodes)
    special = ways != 2
    doors_of: dict[int, list[Ints]] = {}
    for door in doorways:
        for side in door.pair:
            doors_of.setdefault(side, []).append(door.cells)
    gateway = {region: np.concatenate(cells) for region, cells in doors_of.items()}
    junctions: list[tuple[float, Cell]] = []
    dead_ends: list[Cell] = []
    for node, degree in zip(nodes[special].tolist(), ways[special].tolist(), strict=True):
        cell = divmod(node, label.shape[1])
        region = int(shape[cell])
        if degree > 2:
            junctions.append((float(distance[cell]), _free_beside(label, region, cell)))
        elif degree <= 1 and not _is_near(gateway.get(region), cell, float(width[region])):
            end = _clear_of_walls(line, cell, distance, float(half_width[region]))
            dead_ends.append(_free_beside(label, region, end))
    return _spread(junctions, float(width[is_corridor].mean()) + 1.0), list(dict.fromkeys(dead_ends))


def _without_holes(inside: Ints, width: Floats) -> Ints:
    """The shapes (H, W), updated: what stands free in them and is shorter than they are wide is filled."""
    _, hole, stats, _ = cv2.connectedComponentsWithStats((inside < 0).view(np.uint8), connectivity=8)
    fill_holes(inside, hole, stats, width)
    return inside


def _free_beside(label: Ints, region: int, cell: Cell) -> Cell:
    """The cell itself, or the nearest one of its region if a thing stands there; of equally near ones the first."""
    reach = 1
    while label[cell] != region:
        top, left = max(cell[0] - reach, 0), max(cell[1] - reach, 0)
        around = label[top : cell[0] + reach + 1, left : cell[1] + reach + 1]
        cells = np.argwhere(around == region) + np.array((top, left))
        away = ((cells - cell) ** 2).sum(axis=1)
        if away.size and away.min() <= reach**2:  # what lies beyond the square is farther
            row, column = cells[np.argmin(away)]
            return int(row), int(column)
        reach *= 2
    return cell


def _clear_of_walls(line: Ints, tip: Cell, distance: Floats, half_width: float) -> Cell:
    """The first cell of a line, from its tip on, that lies well inside its corridor: tips lie in corners."""
    seen, here = {tip}, tip
    while distance[here] < CLEAR * half_width and len(seen) <= 2 * half_width:
        following = [cell for cell in _along(line, here) if cell not in seen]
        if len(following) != 1:
            break
        (here,) = following
        seen.add(here)
    return here


def _along(line: Ints, cell: Cell) -> list[Cell]:
    """The cells of the same line that share a side with this one."""
    row, column = cell
    return [
        (r, c)
        for r, c in ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
        if 0 <= r < line.shape[0] and 0 <= c < line.shape[1] and line[r, c] == line[cell]
    ]


def _is_near(cells: Ints | None, cell: Cell, reach: float) -> bool:
    """Whether one of some cells (N, 2), if there are any, is within reach of a cell."""
    return cells is not None and bool((np.abs(cells - cell).max(axis=1) <= max(reach, 1.0)).any())
