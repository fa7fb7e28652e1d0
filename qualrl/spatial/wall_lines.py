"""The walls' two main directions, and the lines that close the gaps between walls that lie in one line.

Doors, and stretches of wall that a scanner did not see, are gaps in a line of walls.  A line across such a gap is
where two places may meet, however wide it is.  After the wall lines of Luperto and Amigoni, "Reconstruction and
prediction of the layout of indoor environments" (2019).

h, w: rows, columns of the view.  L: lines.
"""

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import wall_gaps
from qualrl.kernels.bands import both
from qualrl.kernels.scratch import borrowed

BAND_M, BRIDGE_M, WALL_M, GAP_M = 0.1, 0.3, 0.4, 4.0
"""Walls in one line lie within a band, have holes that are bridged, and a length; gaps are at most so wide."""
BESIDE_M, SLACK_M = 0.15, 0.1
"""Of gaps that lie so near beside each other only that between the longest walls counts."""
DRAWN = 0.4
"""At least this share of the free space's border lies at occupied cells, unless the map draws its walls grey."""
SAMPLE = 5000
"""So many occupied cells tell the walls' directions."""

Flags = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class WallLines:
    """Lines across the gaps of walls."""

    turn_deg: float
    """From the rows of the map to the nearer direction of the walls, -45 to 45."""
    line: NDArray[np.int16] | NDArray[np.int32]
    """(h, w) number of the line on each cell, -1 where none; of lines that cross, the highest."""
    support_m: NDArray[np.float64]
    """(L,) length of the shorter of the two walls beside the gap, from the shortest to the longest."""
    gap_m: NDArray[np.float64]
    """(L,) length of the gap."""


def find_wall_lines(wall: Flags, clear: Flags, cell_m: float) -> WallLines:
    """Lines across the gaps of the walls of a map: wall (h, w), clear (h, w) what is free, side of a cell."""
    turn_deg = main_turn_deg(wall)
    there, size = _upright(turn_deg, wall.shape)
    walls, free = _turned(wall, clear, there, size)
    ends, lengths = [], []
    across = partial(_gaps, *_transposed(walls, free), cell_m)
    for flip, gap in enumerate(both(partial(_gaps, walls, free, cell_m), across)):
        slack = max(round(SLACK_M / cell_m), 1)
        row, first, last = gap[:, 0], gap[:, 1] - slack, gap[:, 2] + slack
        corners = np.stack([first, row, last, row], axis=1).reshape(-1, 2, 2)
        ends.append(corners[:, :, ::-1] if flip else corners)
        lengths.append(np.stack([gap[:, 3:].min(axis=1), gap[:, 2] - gap[:, 1] + 1], axis=1) * cell_m)
    back = cv2.invertAffineTransform(there)
    support_m, gap_m = np.concatenate(lengths).T
    order = np.lexsort((-gap_m, support_m))
    end = np.rint(np.concatenate(ends)[order] @ back[:, :2].T + back[:, 2]).astype(int).tolist()
    line = np.full(wall.shape, -1, np.int16 if len(end) < 2**15 else np.int32)
    for number, (first, last) in enumerate(end):
        cv2.line(line, first, last, number, 1)
    return WallLines(turn_deg, line, support_m[order], gap_m[order])


def without_specks(occupied: Flags) -> Flags:
    """(H, W) occupied cells but those by themselves, which are noise and no wall."""
    near = cv2.boxFilter(occupied.view(np.uint8), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    found = np.asarray(near).view(np.bool_)
    np.greater(near, 1, out=found)
    found &= occupied
    return found


def walls_of(occupied: Flags, clear: Flags) -> Flags:
    """(h, w) what is wall: what is occupied, and on maps that draw their walls grey all that borders free space."""
    rim = np.asarray(cv2.dilate(clear.view(np.uint8), np.ones((3, 3), np.uint8))).view(np.bool_)
    np.greater(rim, clear, out=rim)
    near = np.asarray(cv2.dilate(occupied.view(np.uint8), np.ones((5, 5), np.uint8))).view(np.bool_)
    near &= rim
    drawn = np.count_nonzero(near) >= DRAWN * np.count_nonzero(rim)
    return occupied if drawn else occupied | rim


def main_turn_deg(wall: Flags) -> float:
    """From the rows to the nearer direction of the walls, -45 to 45 degrees: where their two profiles are sharpest."""
    cells = np.flatnonzero(wall)
    cells = cells[:: max(cells.size // SAMPLE, 1)]
    if cells.size < 20:
        return 0.0
    y, x = (along.astype(np.float64) for along in np.divmod(cells, wall.shape[1]))
    rough = _sharpest(x, y, range(-45, 45), 1)
    turn_deg = _sharpest(x, y, range(10 * rough - 10, 10 * rough + 11), 10) / 10
    return turn_deg if turn_deg >= -45 else turn_deg + 90


def _sharpest(x: NDArray[np.float64], y: NDArray[np.float64], turns: range, parts: int) -> int:
    """Of some turns, in so many parts of a degree, the one with the sharpest profiles; of equals the one nearest 0."""
    radians = [np.radians(turn / parts) for turn in turns]
    sharpness = wall_gaps.sharpness(x, y, np.cos(radians), np.sin(radians)).tolist()
    return max(zip(sharpness, turns, strict=True), key=lambda found: (found[0], -abs(found[1])))[1]


def _upright(turn_deg: float, shape: tuple[int, ...]) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """The affine map (2, 3) of x, y that turns walls upright, and width and height of what holds the turned map."""
    height, width = shape
    there = np.asarray(cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), turn_deg, 1), np.float64)
    if turn_deg == 0:
        return there, (width, height)
    cosine, sine = abs(there[0, 0]), abs(there[0, 1])
    size = int(height * sine + width * cosine) + 2, int(height * cosine + width * sine) + 2
    there[:, 2] += np.array([size[0] - width, size[1] - height]) / 2
    return there, size


def _turned(wall: Flags, clear: Flags, there: NDArray[np.float64], size: tuple[int, int]) -> tuple[Bytes, Bytes]:
    """The walls and what is free (h, w), turned upright: 1 where they are, else 0."""
    walls, free = np.ascontiguousarray(wall).view(np.uint8), np.ascontiguousarray(clear).view(np.uint8)
    if size == wall.shape[::-1] and (there == np.eye(2, 3)).all():
        return walls, free
    upright, found = borrowed((2, size[1], size[0]), np.uint8)  # one piece of memory, as large as other arrays need
    cv2.warpAffine(walls * np.uint8(255), there, size, upright, flags=cv2.INTER_LINEAR)
    np.greater(upright, 100, out=upright.view(np.bool_))
    cv2.warpAffine(free, there, size, found, flags=cv2.INTER_NEAREST)
    return upright, found


def _transposed(walls: Bytes, free: Bytes) -> tuple[Bytes, Bytes]:
    """Both (rows, columns) with rows as columns."""
    down, across = borrowed((2, *walls.shape[::-1]), np.uint8)
    cv2.transpose(walls, down)
    cv2.transpose(free, across)
    return down, across


def _gaps(wall: Bytes, clear: Bytes, cell_m: float) -> Ints:
    """(G, 5) the gaps of walls along the rows: see ``wall_gaps.gaps``; of those side by side the best supported."""
    band = np.ones((2 * round(BAND_M / cell_m) + 1, 1), np.uint8)
    thick = np.asarray(cv2.dilate(wall, band, borrowed(wall.shape, np.uint8)))
    bridge, least, most = (round(metres / cell_m) for metres in (BRIDGE_M, WALL_M, GAP_M))
    found = wall_gaps.gaps(thick.view(np.bool_), clear.view(np.bool_), bridge, max(least, 1), most)
    del thick
    found = found[wall_gaps.off_middle(found) <= 1]
    order = np.lexsort((-found[:, 3:].max(axis=1), -found[:, 3:].min(axis=1))).astype(np.int32)
    beside, slack = round(BESIDE_M / cell_m), max(round(SLACK_M / cell_m), 1)
    return found[wall_gaps.apart(found, order, wall.shape[0], wall.shape[1], beside, slack)]
