"""Landmarks: doorways, the corners of rooms and corridors, junctions and dead ends of corridors, region centres.

H, W: rows, columns.  Lengths are in cells unless their name says otherwise.
"""

from collections.abc import Sequence

import cv2
import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import regions as kernels
from qualrl.kernels.labels import measured
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import CENTRE, Doorway, Landmark, Region

ROUGHNESS_M = 0.2
"""Walls may leave their straight line by this much (and by one cell)."""
LEG_M = 0.6
"""Both walls of a corner are at least this long (and two cells)."""
LEG_SHARE = 0.5
"""... and at least this share of their region's half-width."""
CORNER_RAD = (0.8, 2.2)
"""The walls of a corner meet at an angle in this range."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


def find_landmarks(
    label: Ints,
    regions: Sequence[Region],
    doorways: Sequence[Doorway],
    distance: Floats,
    half_width: Floats,
    resolution_m: float,
) -> tuple[Landmark, ...]:
    """All landmarks: doorways, corners, junctions, dead ends, centres; each kind by region and position.

    label (H, W); distance (H, W) to the nearest cell that is not free, 0 on those that are looked past;
    half_width by region.
    """
    marks = [Landmark(door.name, "doorway", _middle(door.cells), door.cells, door.pair) for door in doorways]
    corners = _corners(label, distance, half_width, resolution_m)
    junctions, dead_ends = _corridor_marks(label, regions, doorways, distance, half_width)
    centres = [region.centre for region in regions if region.kind != "pocket"]
    for kind, cells in (("corner", corners), ("junction", junctions), ("dead end", dead_ends), (CENTRE, centres)):
        for number, cell in enumerate(sorted(cells, key=lambda cell: (label[cell], cell)), start=1):
            place = np.array([cell], np.int32)
            place.setflags(write=False)
            marks.append(Landmark(f"{kind} {number}", kind, cell, place, (int(label[cell]),)))
    return tuple(marks)


def _middle(cells: Ints) -> Cell:
    """The cell nearest to the mean of the cells."""
    row, column = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
    return int(row), int(column)


def _corners(label: Ints, distance: Floats, half_width: Floats, resolution_m: float) -> list[Cell]:
    """Cells where two long straight walls meet with the free space between them."""
    mask = ((distance > 0) & (label >= 0)).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    roughness, leg = max(ROUGHNESS_M / resolution_m, 1.0), max(LEG_M / resolution_m, 2.0)
    found: list[tuple[float, Cell]] = []
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
            cell = _tip(label, (int(shape[at, 1]), int(shape[at, 0])), (float(outward[1]), float(outward[0])))
            if shorter[at] >= LEG_SHARE * half_width[label[cell]]:
                found.append((float(shorter[at]), cell))
    return _spread(found, leg)


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
    """Junctions and dead ends of the corridors.

    The steps from one far end cut a corridor into bands, each about as long as the corridor is wide.
    Bands that touch three others are junctions; bands that touch one, and no doorway, are dead ends.
    """
    is_corridor = np.array([region.kind == "corridor" for region in regions], np.bool_)
    inside = np.where((label >= 0) & (distance > 0) & is_corridor[label], label, -1).astype(np.int32)
    if (inside < 0).all():
        return [], []
    somewhere = _deepest(inside, distance)
    steps = kernels.steps_from(inside, _deepest(inside, kernels.steps_from(inside, somewhere)))
    width = np.maximum(np.rint(2 * half_width), 1).astype(np.int32)
    banded = np.where((inside >= 0) & (steps >= 0), inside + len(regions) * (steps // width[inside]), -1)
    band, _ = kernels.pieces(banded.astype(np.int32))
    middle = np.stack(np.divmod(_deepest(band, distance), label.shape[1]), axis=1)
    near_door: set[int] = set()
    for door in doorways:
        near_door.update(_around(band, door.cells, int(width[list(door.pair)].max())).tolist())
    junctions: list[tuple[float, Cell]] = []
    dead_ends: list[Cell] = []
    graph = _without_niches(_band_graph(band, inside))
    for node, degree in graph.degree:
        row, column = middle[node]
        if degree > 2:
            junctions.append((float(degree), (int(row), int(column))))
        elif degree == 1 and node not in near_door:
            dead_ends.append((int(row), int(column)))
    return _spread(junctions, float(width[is_corridor].mean()) + 1.0), dead_ends


def _deepest(label: Ints, depth: Floats | Ints) -> Ints:
    """For each label in use, in order, the flat index of its cell of greatest depth."""
    cell = measured(label, int(label.max()) + 1, depth.astype(np.float32))[2]
    return cell[cell >= 0]


def _around(band: Ints, cells: Ints, reach: int) -> Ints:
    """The bands in the box around some cells, ``reach`` cells wider on each side."""
    (top, left), (bottom, right) = np.maximum(cells.min(axis=0) - reach, 0), cells.max(axis=0) + reach + 1
    found = np.unique(band[top:bottom, left:right])
    return found[found >= 0]


def _band_graph(band: Ints, inside: Ints) -> "nx.Graph[int]":
    """Bands as nodes, joined where bands of the same corridor touch."""
    ends = kernels.crossings(band)
    ends = ends[inside.ravel()[ends[:, 0]] == inside.ravel()[ends[:, 1]]]
    graph: nx.Graph[int] = nx.Graph()
    graph.add_edges_from(np.unique(np.sort(band.ravel()[ends], axis=1), axis=0).tolist())
    return graph


def _without_niches(graph: "nx.Graph[int]") -> "nx.Graph[int]":
    """The graph without arms of a single band: niches, and what the bands' slant makes of corners."""
    arms = [node for node, degree in graph.degree if degree == 1]
    graph.remove_nodes_from([node for node in arms if graph.degree[next(iter(graph[node]))] > 2])
    return graph
