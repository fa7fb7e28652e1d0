"""Random floor plans with their true rooms, to learn from and to test with.

H, W: rows, columns of the plan.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.spatial.floor_plans.doors import Door, random_doors
from qualrl.spatial.floor_plans.furniture import furniture
from qualrl.spatial.floor_plans.layout import CELL_M, Layout, cells, random_layout
from qualrl.spatial.floor_plans.scan import patches, scanned
from qualrl.spatial.occupancy_grid import OccupancyGrid

STYLES = ("drawn", "furnished", "scanned", "partly scanned")
"""Walls only; with furniture; as a robot's map of all of it; of a part of it, the rest seen from afar."""
MARGIN_M = 1.5
"""Around the building."""

Flags = NDArray[np.bool_]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """A map, and what its rooms really are."""

    grid: OccupancyGrid
    place: Ints
    """(H, W) number of the room or corridor of each free cell; -1 where not free, and outside the building."""
    is_corridor: tuple[bool, ...]
    """By the number of the place."""
    doors: tuple[Door, ...]
    """As they are in the building; on turned plans not in the plan's rows and columns."""
    style: str
    turned_deg: float
    """How far the building is turned on the map, counter-clockwise."""


def random_floor_plan(seed: int, *, style: str | None = None, crowded: bool = False) -> FloorPlan:
    """A plan of 9 to 60 m with cells of 0.05 m; the same seed and style give the same plan.

    style: one of ``STYLES``; by default any.  crowded: with what is hard to tell from walls and doors: rows of desks,
    walls that are hardly more than a row of doors, corridors that open into rooms over all their width.

    Raises SettingError for a style that there is none of.
    """
    if style is not None and style not in STYLES:
        raise SettingError(f"floor plan: there is no style {style!r}; choose from {', '.join(STYLES)}")
    rng = np.random.default_rng(seed)
    drawn = str(rng.choice(STYLES, p=(0.25, 0.25, 0.35, 0.15)))
    style = style or drawn
    layout = _flipped(random_layout(rng))
    wall_m = float(rng.uniform(0.05, 0.12) if rng.random() < 0.5 else rng.uniform(0.1, 0.3))
    doors, opened = random_doors(layout, wall_m + 2 * CELL_M, crowded)
    wall = _walls(layout.place, wall_m) & ~opened
    _stand_in_the_way(layout, wall, doors, opened, style, crowded)
    grid, place, turned_deg = _mapped(layout, wall, style)
    return FloorPlan(grid, place, tuple(layout.is_corridor), tuple(doors), style, turned_deg)


def _flipped(layout: Layout) -> Layout:
    """The layout with a margin, mirrored and with rows and columns exchanged as chance has it."""
    place = np.pad(layout.place, cells(MARGIN_M), constant_values=-1)
    if layout.rng.random() < 0.5:
        place = place[:, ::-1]
    if layout.rng.random() < 0.5:
        place = place[::-1]
    if layout.rng.random() < 0.4:
        place = place.T
    return Layout(layout.rng, np.ascontiguousarray(place), layout.is_corridor)


def _walls(place: Ints, wall_m: float) -> Flags:
    """(H, W) cells of the walls between all places."""
    edge = np.zeros(place.shape, np.bool_)
    edge[:, :-1] |= place[:, :-1] != place[:, 1:]
    edge[:-1] |= place[:-1] != place[1:]
    edge[:-1, :-1] |= place[:-1, :-1] != place[1:, 1:]
    return np.asarray(cv2.dilate(edge.astype(np.uint8), np.ones((cells(wall_m),) * 2, np.uint8)) > 0)


def _stand_in_the_way(layout: Layout, wall: Flags, doors: list[Door], opened: Flags, style: str, crowded: bool) -> None:
    """Add pillars, stubs of walls, open doors' leaves and furniture to the walls; the doors themselves stay free."""
    rng, inside = layout.rng, layout.place >= 0
    doorsteps = cv2.dilate((opened & inside).astype(np.uint8), np.ones((cells(0.5),) * 2, np.uint8)) > 0
    added = np.zeros(wall.shape, np.uint8)
    if rng.random() < 0.3:
        for at in rng.choice(np.flatnonzero(inside & ~wall), size=int(rng.integers(1, 12))):
            row, column = divmod(int(at), wall.shape[1])
            side = cells(rng.uniform(0.2, 0.5))
            added[row : row + side, column : column + side] = 1
    if rng.random() < 0.3:
        added |= _stubs(layout, wall)
    density = {"drawn": 0.0, "furnished": rng.uniform(0.6, 1.6)}.get(style, rng.uniform(0.3, 2))
    if density:
        added |= furniture(inside & ~wall, layout.place, layout.is_corridor, rng, density, crowded)
    added[doorsteps] = 0
    for door in doors:
        if rng.random() < 0.15 and door.width_m < 1.3:
            _draw_leaf(added, door, float(rng.uniform(0, 2 * np.pi)))
    wall |= (added > 0) & inside


def _stubs(layout: Layout, wall: Flags) -> NDArray[np.uint8]:
    """(H, W) short walls that narrow corridors from their sides, and divide nothing."""
    rng, place = layout.rng, layout.place
    added = np.zeros(wall.shape, np.uint8)
    stands = np.flatnonzero(np.append(layout.is_corridor, False)[place] & ~wall)
    for at in rng.choice(stands, size=min(stands.size, int(rng.integers(1, 5)))):
        row, column = divmod(int(at), wall.shape[1])
        inside = (place == place[row, column]) & ~wall
        lines = ((inside[row], column, added[row : row + 3]), (inside[:, column], row, added[:, column : column + 3].T))
        line, here, image = min(lines, key=lambda line: _run(line[0], line[1])[1])
        first, length = _run(line, here)
        if cells(1.2) <= length <= cells(5):
            narrowed, left = int(length * rng.uniform(0.1, 0.4)), rng.choice([0, rng.random(), 1])
            image[:, first : first + int(narrowed * left)] = 1
            image[:, first + length - (narrowed - int(narrowed * left)) : first + length] = 1
    return added


def _run(inside: Flags, here: int) -> tuple[int, int]:
    """First cell and length of the run of cells that holds one of them."""
    outside = np.flatnonzero(~inside)
    after = int(np.searchsorted(outside, here))
    first = int(outside[after - 1]) + 1 if after else 0
    return first, (int(outside[after]) if after < outside.size else inside.size) - first


def _draw_leaf(image: NDArray[np.uint8], door: Door, angle: float) -> None:
    """Draw the leaf of a door that stands open."""
    (row, column), length = door.middle, door.width_m / CELL_M
    hinge = (column, row - length / 2) if door.upright else (column - length / 2, row)
    tip = (hinge[0] + np.cos(angle) * length, hinge[1] + np.sin(angle) * length)
    cv2.line(image, (round(hinge[0]), round(hinge[1])), (round(tip[0]), round(tip[1])), 1, 1)


def _mapped(layout: Layout, wall: Flags, style: str) -> tuple[OccupancyGrid, Ints, float]:
    """The map of a building, the place of each of its free cells, and by how many degrees it was turned."""
    rng, place = layout.rng, layout.place
    inside = place >= 0
    free, occupied = inside & ~wall, wall
    bent = 0.0
    if style in ("drawn", "furnished"):
        if rng.random() < 0.3:
            occupied = occupied | ~inside
        if rng.random() < 0.3:
            rough = cv2.dilate(occupied.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            occupied = occupied | (rough & (rng.random(place.shape) < 0.01))
        bent = float(rng.uniform(0.5, 2)) if rng.random() < 0.2 else 0.0
        if rng.random() < 0.4:
            occupied = occupied & ~_left_out(inside, rng)
    else:
        free, occupied = scanned(free, wall, place, layout.is_corridor, rng, everywhere=style == "scanned")
        bent = float(rng.uniform(0.3, 2.5))
    if rng.random() < 0.1:  # hardly a wall is straight
        bent = float(rng.uniform(4, 14))
    known = np.where(occupied, 2, np.where(free, 1, 0)).astype(np.float32)
    turned_deg = 0.0
    if rng.random() < 0.35:
        turned_deg = float(rng.choice([rng.uniform(-15, 15), 45, rng.uniform(-3, 3)]))
    known, shown = _warped((known, place.astype(np.float32)), rng, bent, turned_deg)
    free, occupied = known == 1, known == 2
    if rng.random() < 0.1:  # walls drawn in grey are unknown to a map server
        occupied = np.zeros_like(occupied)
    grid = OccupancyGrid(free=free, occupied=occupied, resolution_m=CELL_M, origin=(0.0, 0.0, 0.0))
    return grid, np.where(free, shown, -1).astype(np.int32), turned_deg


def _left_out(inside: Flags, rng: np.random.Generator) -> Flags:
    """(H, W) where a drawing leaves walls out, so that free space ends where nothing is known: outside, or anywhere."""
    near_outside = cv2.dilate((~inside).astype(np.uint8), np.ones((cells(0.5),) * 2, np.uint8)) > 0
    anywhere = patches(inside.shape, float(rng.uniform(1, 6)), rng) < rng.choice([0, rng.uniform(0.05, 0.6)])
    return np.asarray((near_outside & (rng.random() < 0.7)) | anywhere)


def _warped(
    images: tuple[NDArray[np.float32], NDArray[np.float32]], rng: np.random.Generator, bent: float, turned_deg: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What is known (0 outside) and places (-1 outside), bent by about so many cells and turned about the middle."""
    height, width = images[0].shape
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), turned_deg, 1.0)
    cos, sin = abs(turn[0, 0]), abs(turn[0, 1])
    size = (width, height) if turned_deg == 0 else (int(height * sin + width * cos), int(height * cos + width * sin))
    turn[:, 2] += (size[0] - width) / 2, (size[1] - height) / 2
    back = cv2.invertAffineTransform(turn)
    x, y = np.meshgrid(np.arange(size[0], dtype=np.float32), np.arange(size[1], dtype=np.float32))
    from_x = (back[0, 0] * x + back[0, 1] * y + back[0, 2]).astype(np.float32) + bent * _waves(size, rng)
    from_y = (back[1, 0] * x + back[1, 1] * y + back[1, 2]).astype(np.float32) + bent * _waves(size, rng)
    known, place = (
        np.asarray(cv2.remap(image, from_x, from_y, cv2.INTER_NEAREST, borderValue=outside), np.float32)
        for image, outside in zip(images, (0, -1), strict=True)
    )
    return known, place


def _waves(size: tuple[int, int], rng: np.random.Generator) -> NDArray[np.float32]:
    """(H, W) smooth noise of about 1, its waves some 8 m long."""
    coarse = rng.normal(size=tuple(max(side // cells(8), 2) + 1 for side in size[::-1])).astype(np.float32)
    return np.asarray(cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC), np.float32)
