"""Where the rooms and corridors of a building lie, before it has walls.

H, W: rows, columns.  A layout is an image of places: every cell holds the number of its room or corridor, -1 outside.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

CELL_M = 0.05
"""Side of a cell of every plan."""
FORMS = ("spine", "spine", "spine", "grid", "ring", "home", "double")
"""Kinds of buildings, as often as they stand here: rooms along one corridor, along a net of them, around a ring,
without any, and on both sides of one or several corridors."""

Ints = NDArray[np.int32]
Box = tuple[int, int, int, int]
"""First row, first column, row and column behind the last."""


def cells(length_m: float) -> int:
    """A length in cells, one at least."""
    return max(round(length_m / CELL_M), 1)


@dataclass
class Layout:
    """A building in the making."""

    rng: np.random.Generator
    place: Ints
    """(H, W)"""
    is_corridor: list[bool] = field(default_factory=list)
    """By the number of the place."""

    def new(self, *, corridor: bool = False) -> int:
        """The number of a new place."""
        self.is_corridor.append(corridor)
        return len(self.is_corridor) - 1

    def fill(self, box: Box, number: int) -> None:
        """Give a box to a place."""
        top, left, bottom, right = box
        self.place[top:bottom, left:right] = number


def random_layout(rng: np.random.Generator) -> Layout:
    """A building of some form, every place of it one 4-connected piece."""
    form = str(rng.choice(FORMS))
    width_m, height_m = rng.uniform(20, 50), rng.uniform(10, 24)
    if form == "home":
        width_m, height_m = rng.uniform(9, 22), rng.uniform(8, 16)
    elif form != "spine":
        height_m = rng.uniform(16, 34)
    layout = Layout(rng, np.full((cells(height_m), cells(width_m)), -1, np.int32))
    height, width = layout.place.shape
    if form == "home":
        _halves(layout, (0, 0, height, width), small=False)
    elif form == "spine":
        _along_a_corridor(layout)
    elif form == "ring":
        _around_a_ring(layout)
    else:
        depth = 2 if form == "grid" else int(rng.integers(1, 4))
        _between_corridors(layout, (0, 0, height, width), depth, layout.new(corridor=True))
    _change_rooms(layout)
    if rng.random() < 0.6:
        _widen_corridors(layout)
    _divide_corridors(layout)
    return _in_pieces(layout)


def _corridor_width(rng: np.random.Generator) -> int:
    return cells(rng.uniform(1.4, 3.2) if rng.random() < 0.85 else rng.uniform(1.0, 4.5))


def _along_a_corridor(layout: Layout) -> None:
    """A corridor from end to end with rooms on one side or both, perhaps with a niche and a wing."""
    rng, place = layout.rng, layout.place
    height, width = place.shape
    top = cells(rng.uniform(3.5, 7.5)) if rng.random() < 0.85 else 0
    bottom = top + _corridor_width(rng)
    corridor = layout.new(corridor=True)
    place[top:bottom] = corridor
    if top:
        _row(layout, (0, 0, top, width), across=True)
    end = min(bottom + cells(rng.uniform(3.5, 8)), height)
    _row(layout, (bottom, 0, end, width), across=True)
    layout.place = place = place[:end]
    if rng.random() < 0.35 and width > cells(20):
        left = int(rng.integers(0, width - cells(4)))
        place[bottom : bottom + cells(rng.uniform(0.4, 1.5)), left : left + cells(rng.uniform(1.5, 4))] = corridor
    if rng.random() < 0.35:
        wing = _corridor_width(rng)
        place[bottom:, slice(0, wing) if rng.random() < 0.5 else slice(width - wing, width)] = corridor


def _around_a_ring(layout: Layout) -> None:
    """Rooms outside a corridor that runs in a ring, and perhaps within."""
    rng = layout.rng
    height, width = layout.place.shape
    ring, deep = _corridor_width(rng), cells(rng.uniform(3.5, 7.5))
    layout.place[deep:-deep, deep:-deep] = layout.new(corridor=True)
    _row(layout, (0, 0, deep, width), across=True)
    _row(layout, (height - deep, 0, height, width), across=True)
    _row(layout, (deep, 0, height - deep, deep), across=False)
    _row(layout, (deep, width - deep, height - deep, width), across=False)
    inner = (deep + ring, deep + ring, height - deep - ring, width - deep - ring)
    if inner[2] - inner[0] > cells(1.5) and inner[3] - inner[1] > cells(3):
        _block(layout, inner)


def _between_corridors(layout: Layout, box: Box, depth: int, corridor: int) -> None:
    """Divide a box by strips of a corridor, ``depth`` times at most, and fill what is left with rooms."""
    rng = layout.rng
    top, left, bottom, right = box
    height, width = bottom - top, right - left
    strip = _corridor_width(rng)
    lies = (height > width) != (rng.random() < 0.25)
    if depth == 0 or max(height, width) < cells(11) or min(height, width) < cells(6) + strip:
        _block(layout, box)
    elif lies and height > cells(9):
        at = top + int((height - strip) * rng.uniform(0.35, 0.65))
        layout.fill((at, left, at + strip, right), corridor)
        _between_corridors(layout, (top, left, at, right), depth - 1, corridor)
        _between_corridors(layout, (at + strip, left, bottom, right), depth - 1, corridor)
    elif width > cells(9):
        at = left + int((width - strip) * rng.uniform(0.3, 0.7))
        layout.fill((top, at, bottom, at + strip), corridor)
        _between_corridors(layout, (top, left, bottom, at), depth - 1, corridor)
        _between_corridors(layout, (top, at + strip, bottom, right), depth - 1, corridor)
    else:
        _block(layout, box)


def _block(layout: Layout, box: Box) -> None:
    """Fill what lies between corridors: a hall, rooms in any order, or one or two rows of rooms."""
    rng = layout.rng
    top, left, bottom, right = box
    height, width = bottom - top, right - left
    form = rng.random()
    if min(height, width) < cells(1.2) or form < 0.06:
        layout.fill(box, layout.new())
    elif form < 0.12:
        _halves(layout, box, small=False)
    elif min(height, width) > cells(7.5) and rng.random() < 0.85:
        share = rng.uniform(0.4, 0.6)
        if width >= height:
            at = top + int(height * share)
            _row(layout, (top, left, at, right), across=True)
            _row(layout, (at, left, bottom, right), across=True)
        else:
            at = left + int(width * share)
            _row(layout, (top, left, bottom, at), across=False)
            _row(layout, (top, at, bottom, right), across=False)
    else:
        _row(layout, box, across=width >= height)


def _row(layout: Layout, box: Box, *, across: bool) -> None:
    """Fill a box with rooms side by side, from left to right if across, else from top to bottom."""
    rng = layout.rng
    top, left, bottom, right = box
    length = right - left if across else bottom - top
    least_m, most = rng.uniform(2, 4.5), rng.uniform(1, 2.6)
    usual_m = rng.uniform(least_m, least_m * most) if rng.random() < 0.4 else None
    start = 0
    while start < length:
        size = cells(usual_m or rng.uniform(least_m, least_m * most))
        rare = rng.random()
        if rare < 0.14:
            size = cells(rng.uniform(1.2, 2) if rare < 0.08 else rng.uniform(8, 16))
        end = length if length - start - size < cells(1.4) else start + size
        part = (top, left + start, bottom, left + end) if across else (top + start, left, top + end, right)
        _halves(layout, part, small=True)
        start = end


def _halves(layout: Layout, box: Box, *, small: bool) -> None:
    """Fill a box with rooms by halving it again and again; a small one seldom and once or twice."""
    rng = layout.rng
    top, left, bottom, right = box
    height_m, width_m = (bottom - top) * CELL_M, (right - left) * CELL_M
    if small:
        whole = rng.random() > 0.12 or min(height_m, width_m) < 2.6 or max(height_m, width_m) < 4.5
    else:
        whole = height_m * width_m < rng.uniform(8, 36) or max(height_m, width_m) < 3.5
    if whole:
        layout.fill(box, layout.new())
        return
    share = rng.uniform(0.3, 0.7)
    if width_m >= height_m:
        at = left + int((right - left) * share)
        parts = ((top, left, bottom, at), (top, at, bottom, right))
    else:
        at = top + int((bottom - top) * share)
        parts = ((top, left, at, right), (at, left, bottom, right))
    for part in parts:
        _halves(layout, part, small=small)


def _change_rooms(layout: Layout) -> None:
    """Cut closets out of some rooms, make courts of some, and join some to a neighbour."""
    rng = layout.rng
    for number in range(len(layout.is_corridor)):
        rows, columns = np.nonzero(layout.place == number)
        if layout.is_corridor[number] or not rows.size:
            continue
        box = (int(rows.min()), int(columns.min()), int(rows.max()) + 1, int(columns.max()) + 1)
        change = rng.random()
        if change < 0.06 and rows.size * CELL_M**2 > 14:
            _closet(layout, box)
        elif 0.06 <= change < 0.09:
            layout.place[rows, columns] = -1
        elif 0.09 <= change < 0.13:
            _join(layout, number)


def _closet(layout: Layout, box: Box) -> None:
    """A small room in a corner of a box."""
    rng = layout.rng
    top, left, bottom, right = box
    height, width = (cells(rng.uniform(1.2, 2.4)) for _ in range(2))
    row = top if rng.random() < 0.5 else bottom - height
    column = left if rng.random() < 0.5 else right - width
    layout.fill((row, column, row + height, column + width), layout.new())


def _join(layout: Layout, number: int) -> None:
    """One room of two, which may be bent."""
    inside = (layout.place == number).astype(np.uint8)
    around = np.unique(layout.place[cv2.dilate(inside, np.ones((3, 3), np.uint8)) > 0])
    beside = [int(other) for other in around if other >= 0 and other != number and not layout.is_corridor[other]]
    if beside:
        layout.place[inside > 0] = layout.rng.choice(beside)


def _widen_corridors(layout: Layout) -> None:
    """Give corridors bays, lobbies and wider stretches, at the cost of the rooms beside."""
    rng, place = layout.rng, layout.place
    is_corridor = np.append(layout.is_corridor, False)
    cells_of = np.flatnonzero(is_corridor[place])
    if not cells_of.size:
        return
    for at in rng.choice(cells_of, size=int(rng.integers(1, 6))):
        row, column = divmod(int(at), place.shape[1])
        number = place[row, column]
        half = [cells(rng.uniform(1, 2.4) if rng.random() < 0.6 else rng.uniform(2.4, 6)) // 2 for _ in range(2)]
        rows, columns = (slice(max(at - size, 0), at + size) for at, size in zip((row, column), half, strict=True))
        window = place[rows, columns]
        window[(window >= 0) & ~is_corridor[window]] = number


def _divide_corridors(layout: Layout) -> None:
    """Cut some corridors across, where a door will stand."""
    rng, place = layout.rng, layout.place
    for number in range(len(layout.is_corridor)):
        rows, columns = np.nonzero(place == number)
        if not layout.is_corridor[number] or rows.size < 200 or rng.random() > 0.15:
            continue
        at = int(rng.integers(rows.size))
        upright = (np.ptp(columns) > np.ptp(rows)) != (rng.random() < 0.2)
        beyond = columns >= columns[at] if upright else rows >= rows[at]
        place[rows[beyond], columns[beyond]] = layout.new(corridor=True)


def _in_pieces(layout: Layout) -> Layout:
    """The same layout with a number for each 4-connected piece of more than a square metre."""
    place = np.full(layout.place.shape, -1, np.int32)
    is_corridor: list[bool] = []
    for number, corridor in enumerate(layout.is_corridor):
        count, piece = cv2.connectedComponents((layout.place == number).astype(np.uint8), connectivity=4)
        for part in range(1, count):
            inside = piece == part
            if inside.sum() * CELL_M**2 > 1:
                place[inside] = len(is_corridor)
                is_corridor.append(corridor)
    return Layout(layout.rng, place, is_corridor)
