"""Landmarks: doorways, the corners of rooms and corridors, junctions and dead ends of corridors, region centres.

H, W: rows, columns.  Lengths are in cells unless their name says otherwise.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import marks as kernels
from qualrl.kernels.labels import fill_holes, only
from qualrl.kernels.scratch import borrowed
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
MOST_ROUNDING = 4
"""Corners are rounded off by so many cells at most."""
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


class CorridorLines(NamedTuple):
    """The lines midway between the walls of corridors, N cells of them."""

    line: Ints
    """(H, W) a number of its own for each corridor, -1 elsewhere."""
    cells: NDArray[np.int64]
    """(N,) flat indices."""
    region: Ints
    """(N,)"""
    ways: Ints
    """(N,) how many cells of the same line share a side with each."""


def find_landmarks(
    label: Ints,
    regions: Sequence[Region],
    doorways: Sequence[Doorway],
    distance: Floats,
    half_width: Floats,
    corners: Sequence[Cell],
    lines: CorridorLines,
) -> tuple[Landmark, ...]:
    """All landmarks: doorways, corners, junctions, dead ends, centres; each kind by region and position.

    label (H, W); distance (H, W) to the nearest cell that is not free, 0 on those that are looked past;
    half_width by region; corners: see ``find_corners``.
    """
    marks = [Landmark(door.name, "doorway", middle_of(door.cells), door.cells, door.pair) for door in doorways]
    junctions, dead_ends = _corridor_marks(label, regions, doorways, distance, half_width, lines)
    centres = [region.centre for region in regions if region.kind != "pocket"]
    for kind, cells in (("corner", corners), ("junction", junctions), ("dead end", dead_ends), (CENTRE, centres)):
        listed = sorted(cells, key=lambda cell: (label[cell], cell))
        places = np.array(listed, np.int32).reshape(-1, 1, 2)
        places.setflags(write=False)
        for number, (cell, place) in enumerate(zip(listed, places, strict=True), start=1):
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


def find_corners(label: Ints, half_width: Floats, bends: Sequence[Bend], resolution_m: float) -> list[Cell]:
    """The cells in bends whose walls are long for their region's width; label (H, W), half_width by region."""
    if not bends:
        return []
    legs, cells, outward = (np.array(column) for column in zip(*bends, strict=True))
    # Corners may have been rounded off where whiskers were taken off.
    tips = kernels.into_corners(label, np.ravel_multi_index(tuple(cells.T), label.shape), outward, MOST_ROUNDING)
    long = legs.astype(np.float32) >= np.float32(LEG_SHARE) * half_width[label.ravel()[tips]]
    found = zip(legs[long].tolist(), _cells(tips[long], label), strict=True)
    return _spread(list(found), _least_leg(resolution_m))


def _cells(flat: NDArray[np.int64], label: Ints) -> list[Cell]:
    """Rows and columns of cells that are given as flat indices."""
    rows, columns = np.divmod(flat, label.shape[1])
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


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


def corridor_lines(label: Ints, is_corridor: Flags, distance: Floats, half_width: Floats) -> CorridorLines:
    """The lines of corridors: label (H, W), is_corridor and half_width by region, distance (H, W) as above."""
    if not is_corridor.any():
        return CorridorLines(np.zeros((0, 0), np.int32), np.zeros(0, np.int64), *np.zeros((2, 0), np.int32))
    shape = _without_holes(only(label, is_corridor, distance), 2 * half_width)
    line, cells = pruned_skeleton(shape, distance)
    return CorridorLines(line, cells.astype(np.int64), shape.ravel()[cells], degrees(line, cells))


def _corridor_marks(
    label: Ints, regions: Sequence[Region], doorways: Sequence[Doorway], distance: Floats, half_width: Floats,
    lines: CorridorLines,
) -> tuple[list[Cell], list[Cell]]:  # fmt: skip
    """Junctions and dead ends of the corridors: where lines of their skeletons meet, and end at no doorway."""
    is_corridor = np.array([region.kind == "corridor" for region in regions], np.bool_)
    if not is_corridor.any():
        return [], []
    line, nodes, region, ways = lines
    is_joint, is_tip = ways > 2, ways <= 1
    joints = kernels.nearest_of_region(label, nodes[is_joint], region[is_joint])
    junctions = list(zip(distance.ravel()[nodes[is_joint]].tolist(), _cells(joints, label), strict=True))
    ends = _dead_ends(label, line, nodes[is_tip], region[is_tip], doorways, distance, half_width)
    return _spread(junctions, float((2 * half_width)[is_corridor].mean()) + 1.0), list(
        dict.fromkeys(_cells(ends, label))
    )


def _dead_ends(
    label: Ints, line: Ints, tips: NDArray[np.int64], region: Ints, doorways: Sequence[Doorway], distance: Floats,
    half_width: Floats,
) -> NDArray[np.int64]:  # fmt: skip
    """A cell well inside the corridor for each tip (N,) of its lines (H, W) that lies at no doorway of its region."""
    doors = sorted((side, at) for at, door in enumerate(doorways) for side in door.pair)
    passed = np.concatenate([np.zeros((0, 2), np.int32), *(doorways[at].cells for _, at in doors)])
    owner = np.repeat([side for side, _ in doors], [len(doorways[at].cells) for _, at in doors])
    start = np.searchsorted(owner, np.arange(half_width.size + 1))
    reach = np.maximum(2 * half_width, np.float32(1))
    is_dead = ~kernels.within_reach(tips, label.shape[1], passed, start, region, reach)
    tips, region = tips[is_dead], region[is_dead]
    wide = half_width[region].astype(np.float64)
    # Tips lie in corners.
    ends = kernels.clear_of_walls(
        line, tips, distance, (CLEAR * wide).astype(np.float32), np.floor(2 * wide).astype(np.int32)
    )
    return kernels.nearest_of_region(label, ends, region)


def _without_holes(inside: Ints, width: Floats) -> Ints:
    """The shapes (H, W), updated: what stands free in them and is shorter than they are wide is filled."""
    room = borrowed(inside.shape, np.int32)
    _, hole, stats, _ = cv2.connectedComponentsWithStats((inside < 0).view(np.uint8), room, connectivity=8)
    fill_holes(inside, hole, stats, width)
    return inside
