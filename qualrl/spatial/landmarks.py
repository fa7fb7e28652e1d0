"""Landmarks: doorways, the corners of rooms and corridors, junctions and dead ends of corridors.

H, W: rows, columns.  Lengths are in cells unless their name says otherwise.
"""

from collections.abc import Sequence

import cv2
import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Doorway, Landmark, Region

ROUGHNESS_M = 0.2
"""Walls may leave their straight line by this much (and by one cell)."""
LEG_M = 0.6
"""Both walls of a corner are at least this long (and two cells)."""
LEG_SHARE = 0.5
"""... and at least this share of the region's half-width."""
SQUARE_RAD = (0.7, 2.2)
"""A corner's angle, between the walls, lies in this range."""

Cells = NDArray[np.int32]
Flags = NDArray[np.bool_]
Floats = NDArray[np.float32]


def find_landmarks(
    label: Cells,
    regions: Sequence[Region],
    doorways: Sequence[Doorway],
    clear: Flags,
    thickness: Floats,
    resolution_m: float,
) -> tuple[Landmark, ...]:
    """All landmarks: doorways first, then corners, junctions and dead ends, each by region and position.

    label (H, W); clear (H, W) free space without furniture and whiskers; thickness (H, W) half-width of
    free space around each cell.
    """
    marks = [Landmark(door.name, "doorway", _middle(door.cells), door.cells, door.pair) for door in doorways]
    corners = _corners(label, clear, thickness, resolution_m)
    junctions, dead_ends = _corridor_shape(label, regions, doorways, clear, thickness)
    for kind, cells in (("corner", corners), ("junction", junctions), ("dead end", dead_ends)):
        for number, cell in enumerate(sorted(cells, key=lambda cell: (label[cell], cell)), start=1):
            place = np.array([cell], np.int32)
            place.setflags(write=False)
            marks.append(Landmark(f"{kind} {number}", kind, cell, place, (int(label[cell]),)))
    return tuple(marks)


def _middle(cells: Cells) -> Cell:
    """The cell nearest to the mean of a doorway's cells."""
    away = ((cells - cells.mean(axis=0)) ** 2).sum(axis=1)
    row, column = cells[np.argmin(away)]
    return int(row), int(column)


def _corners(label: Cells, clear: Flags, thickness: Floats, resolution_m: float) -> list[Cell]:
    """Cells where two long straight walls meet with the free space between them."""
    mask = (clear & (label >= 0)).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    roughness = max(ROUGHNESS_M / resolution_m, 1.0)
    found: list[tuple[float, Cell]] = []
    for contour in contours:
        shape = cv2.approxPolyDP(contour, roughness, True)[:, 0].astype(np.float64)
        if len(shape) < 3:
            continue
        # Contours run with the free space on one side, holes included, so one sign tells inner corners.
        before, after = np.roll(shape, 1, axis=0) - shape, np.roll(shape, -1, axis=0) - shape
        leg = np.minimum(np.hypot(*before.T), np.hypot(*after.T))
        turn = after[:, 0] * before[:, 1] - after[:, 1] * before[:, 0]
        angle = np.arctan2(np.abs(turn), (before * after).sum(axis=1))
        inner = (turn < 0) & (angle > SQUARE_RAD[0]) & (angle < SQUARE_RAD[1])
        for at in np.flatnonzero(inner):
            cell = int(shape[at, 1]), int(shape[at, 0])
            if leg[at] >= max(LEG_M / resolution_m, 2.0, LEG_SHARE * _nearby(thickness, label, cell)):
                found.append((float(leg[at]), cell))
    return _spread(found, max(LEG_M / resolution_m, 1.5))


def _nearby(thickness: Floats, label: Cells, cell: Cell) -> float:
    """Half-width of the region at a corner: the thickness around it, not in its very tip."""
    return float(thickness[cell])


def _spread(found: list[tuple[float, Cell]], least: float) -> list[Cell]:
    """The strongest (strength, cell) first, without those nearer than ``least`` to a stronger one."""
    kept: list[Cell] = []
    for _, cell in sorted(found, key=lambda item: (-item[0], item[1])):
        if all((cell[0] - other[0]) ** 2 + (cell[1] - other[1]) ** 2 >= least**2 for other in kept):
            kept.append(cell)
    return kept


def _corridor_shape(
    label: Cells, regions: Sequence[Region], doorways: Sequence[Doorway], clear: Flags, thickness: Floats
) -> tuple[list[Cell], list[Cell]]:
    """Junctions and dead ends of the corridors.

    A corridor is cut into bands, each about as long as the corridor is wide, by the steps from one far end;
    bands that touch three others are junctions, bands that touch one and no doorway are dead ends.
    """
    corridor = np.array([region.kind == "corridor" for region in regions], np.bool_)
    if not corridor.any():
        return [], []
    inside = np.where((label >= 0) & corridor[label] & clear, label, -1).astype(np.int32)
    return [], []
