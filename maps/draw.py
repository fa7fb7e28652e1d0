"""Draw the four bundled maps: ``python maps/draw.py [FOLDER]`` writes NAME.png and NAME.yaml.

A floor plan is a table of rooms, one row each, in metres with x to the right and y *down* from the
image's north-west corner (the same way as columns and rows; the ROS origin is the south-west corner):

    name | west north east south | pieces, separated by commas

A room is carved out of the unknown and walled all around; two rooms share a wall when they lie
``WALL_M`` apart, and flow together where they overlap.  A piece is written in one of two ways:

    KIND SIDE AT      stands against wall N, E, S or W, AT metres from that wall's west or north end;
                      doors and windows are cut through the wall, all other kinds stand inside
    block X Y W H     stands free, its north-west corner X, Y metres inside the room's

The map "slam" is not the plan itself but what a laser scanner saw of it on one walk.
"""

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]
Box = tuple[float, float, float, float]  # west, north, east, south

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
RESOLUTION_M = 0.05
WALL_M = 0.2

OPENINGS_M = {"door": 0.9, "wide": 1.2, "gate": 1.8, "window": 0.6}  # along the wall
FURNITURE_M = {  # along the wall, depth into the room
    "desk": (1.6, 0.8),
    "cabinet": (1.2, 0.5),
    "shelf": (2.4, 0.5),
    "counter": (3.0, 0.6),
    "sofa": (2.0, 0.9),
    "bed": (1.0, 2.0),
    "bench": (2.4, 0.6),
}

PUZZLE = """
#############
#1.........2#
#.####8####.#
#.#6.....7#.#
#.#.#####.#.#
#.#.#...#.#.#
#.#.#.G.#.#.#
#.#.#...#.#.#
#.#.##9##.#.#
#.#5.....4#.#
#.#########.#
#S.........3#
#############
"""

OFFICE = """
corridor      |  1.2  9.4 28.8 10.8 |
open-plan     |  1.2  1.2  9.6  9.2 | door S 6.4, block 1.7 1.6 1.6 3.2, block 5.1 1.6 1.6 3.2, shelf W 5.3, desk S 1.6
office north  |  9.8  2.6 14.8  9.2 | door S 0.6, desk N 0.9, desk E 2.6, shelf W 1.6
copy room     | 15.0  4.6 18.2  9.2 | door S 1.9, shelf N 0.4, cabinet W 2.1
meeting room  | 18.4  1.2 24.6  9.2 | door S 0.8, block 2.3 1.9 1.6 3.8, counter E 2.4, cabinet N 2.5
director      | 24.8  2.6 28.8  9.2 | door S 0.7, door W 4.7, block 1.1 1.3 1.8 0.9, shelf E 2.4
office south  |  1.2 11.0  6.4 16.4 | door N 0.7, desk W 2.8, desk S 2.9, cabinet E 0.6
kitchen       |  6.6 11.0 13.6 16.4 | door N 5.4, counter S 0, counter W 2.4, block 3.3 1.8 1.2 1.2
laboratory    | 13.8 11.0 22.0 18.8 | door N 1.0, block 1.7 2.3 4.8 1.2, block 1.7 5.1 4.8 1.2, shelf N 4.6, shelf E 2.7
quiet office  | 22.2 11.0 28.8 17.2 | door N 4.7, shelf N 0.8, desk W 1.7, desk W 4.0, desk S 3.0, cabinet E 3.4
"""

CLINIC = """
main corridor |  1.2 19.0 58.8 21.4 |
west corridor | 17.0  9.0 19.0 38.8 | bench W 13.5, cabinet W 24.3
east corridor | 41.0  1.2 43.0 38.8 | bench E 31.4
ring corridor | 19.0  9.0 41.0 10.8 |
ward corridor |  8.0  1.2  9.8 19.0 |
rear corridor | 43.0 29.2 58.8 31.0 |
link corridor | 57.0 21.4 58.8 29.2 |
ward 1        |  1.2  1.2  7.8  6.2 | wide E 2.2, bed W 0.6, bed W 2.4, bed W 4.1, cabinet N 4.4
ward 2        |  1.2  6.4  7.8 13.0 | wide E 3.2, bed W 0.7, bed W 2.6, bed W 4.5, cabinet S 4.0
ward 3        |  1.2 13.2  7.8 18.8 | wide E 1.4, bed W 0.7, bed W 2.4, desk S 3.4
nurses        | 10.0  1.2 16.8  5.2 | door W 1.5, desk E 0.6, desk N 1.2, shelf S 2.7
ward 4        | 10.0  5.4 16.8 11.3 | wide W 2.6, bed E 0.6, bed E 2.5, bed E 4.3, cabinet N 1.4
ward 5        | 10.0 11.5 16.8 18.8 | wide W 1.2, wide E 5.4, bed N 1.0, bed N 2.9, bed N 4.8, sofa S 2.2
pharmacy      | 17.0  2.2 23.0  8.8 | door S 4.4, block 1.3 1.5 2.6 0.6, block 1.3 3.4 2.6 0.6, shelf E 1.4, shelf N 0.8
laboratory    | 23.2  1.2 29.6  8.8 | door S 0.8, door E 5.4, counter N 1.6, counter W 2.0, block 2.6 2.3 1.4 2.8
blood samples | 29.8  3.6 34.4  8.8 | door S 2.8, desk N 0.5, cabinet E 1.8, cabinet W 1.6
doctors       | 34.6  2.0 40.8  8.8 | door S 1.0, door E 4.8, desk N 0.8, desk N 3.6, sofa W 2.8, block 2.6 2.8 1.6 1.2
theatre 1     | 19.2 11.0 26.2 18.8 | wide N 3.0, wide S 2.4, block 2.6 3.0 0.9 2.2, counter W 2.0, shelf E 1.2
scrub room    | 26.4 11.0 29.2 16.2 | door N 0.9, door W 3.8, cabinet E 1.6
sterile store | 26.4 16.4 33.8 18.8 | door S 4.7, shelf N 0.6, shelf N 3.4
recovery      | 29.4 11.0 33.8 16.2 | wide N 0.7, wide E 3.4, bed S 0.5, bed S 2.2
theatre 2     | 34.0 11.0 40.8 18.8 | wide N 3.6, wide S 3.8, block 2.9 3.2 0.9 2.2, counter E 2.4, cabinet W 1.2
x-ray         | 43.2  1.2 50.4  6.8 | wide W 2.0, block 3.4 1.7 2.2 1.0, block 5.6 4.1 1.6 1.5, cabinet S 1.0
ultrasound    | 43.2  7.0 49.6 12.0 | door W 2.6, bed E 1.4, desk N 1.4
scanner       | 43.2 12.2 52.2 18.8 | wide W 1.2, wide S 4.0, block 4.2 1.5 2.4 2.0, desk E 3.4, cabinet N 1.2
therapy       | 52.4 10.4 58.8 18.8 | door S 1.2, bed E 0.8, bed E 2.7, sofa N 1.0, cabinet W 2.2
treatment 1   |  1.2 21.6  5.6 27.4 | door N 2.6, bed W 1.6, desk S 1.4
treatment 2   |  5.8 21.6 10.8 28.0 | door N 3.1, bed W 2.0, desk S 2.2, cabinet E 2.4
emergency     | 11.0 21.6 16.8 29.6 | gate N 1.0, wide E 5.5, bed W 2.0, bed W 4.0, bed W 6.0, cabinet E 1.6
store         |  9.2 29.8 16.8 33.6 | door E 1.4, shelf N 1.0, shelf S 1.0, shelf S 3.7, cabinet W 0.8
staff room    |  7.8 33.8 16.8 38.0 | door E 2.7, block 3.4 1.7 2.4 1.2, counter S 2.0, sofa W 1.6, cabinet N 2.0
waiting hall  | 19.2 21.6 32.4 31.2 | gate N 2.2, gate N 9.2, wide W 7.4, block 2.0 2.7 4.0 0.6,
                                        block 2.0 4.7 4.0 0.6, block 8.2 2.7 0.6 3.6, block 10.4 2.7 0.6 3.6,
                                       block 2.6 7.0 3.4 0.8
records       | 19.2 31.4 25.2 38.8 | door W 5.2, door N 4.3, block 1.5 1.4 0.6 4.2, block 3.5 1.6 0.6 4.0, shelf E 2.6
office        | 25.4 31.4 32.4 38.0 | door N 3.0, desk W 1.6, desk S 2.0, desk E 2.8
children      | 32.6 21.6 40.8 26.0 | door N 1.2, door E 1.8, bed S 5.6, desk S 1.2
surgery 1     | 32.6 26.2 40.8 30.6 | door E 1.4, door W 2.6, bed N 5.2, desk S 2.4, cabinet N 1.4
surgery 2     | 32.6 30.8 40.8 36.2 | door E 3.5, bed W 2.0, desk N 3.4, sofa S 4.0
eye clinic    | 43.2 21.6 49.8 29.0 | door N 1.0, door S 4.6, desk E 2.0, block 2.0 3.1 1.2 1.8, shelf W 4.0
dentist       | 50.0 21.6 56.8 29.0 | door E 4.4, block 2.1 2.6 0.9 2.2, counter W 1.6, cabinet N 4.0
bath          | 43.2 31.2 47.0 36.4 | door N 0.8, bed W 2.2, cabinet E 2.2
ward 6        | 47.2 31.2 53.4 38.8 | wide N 1.2, bed S 0.7, bed S 2.6, bed S 4.5, cabinet W 2.6
ward 7        | 53.6 31.2 58.8 38.0 | wide N 1.0, bed E 1.6, bed E 3.6, desk S 0.8
"""

SLAM = """
hallway       |  3.4  8.2 20.6 10.2 |
workshop      |  3.4  2.8  9.2  8.0 | door S 3.9, desk W 1.0, desk N 2.0, block 2.6 2.2 1.4 1.0,
                                       window N 4.3, window W 3.0
office        |  9.4  2.8 13.2  8.0 | door S 1.2, desk E 1.8, cabinet W 1.0, window N 1.2
lounge        | 13.4  2.8 20.6  8.0 | door S 0.9, sofa E 2.1, block 2.6 1.8 1.6 1.2, shelf S 3.4,
                                       window N 1.0, window N 4.4
storage       |  3.4 10.4  7.6 15.2 | door N 1.9, block 0.6 1.5 0.8 2.4, block 2.8 2.0 0.7 2.0
classroom     |  7.8 10.4 15.0 15.2 | door N 1.2, door N 5.2, desk S 0.8, desk S 3.4, block 1.8 1.7 1.4 0.7,
                                        block 4.2 1.7 1.4 0.7, window S 5.3
archive       | 15.2 10.4 20.6 15.2 | door N 3.4, shelf W 1.2, block 2.0 1.9 0.6 1.8, window E 2.2
"""

# The scanner's walk through the plan above, x and y: two rooms are only glanced into.
WALK_M = (
    (4.4, 9.2), (7.7, 9.1), (7.8, 6.9), (5.0, 6.3), (7.8, 6.9), (7.8, 9.0), (9.6, 9.2), (11.0, 8.8), (11.1, 5.4),
    (11.0, 8.9), (14.7, 9.2), (14.8, 6.6), (18.6, 6.2), (14.8, 6.6), (14.7, 9.2), (13.4, 9.6), (13.4, 13.3),
    (9.6, 13.4), (9.5, 11.0), (9.4, 9.5), (14.0, 9.2), (19.0, 9.3), (19.1, 10.3),
)  # fmt: skip
SCAN_EVERY_M = 0.3
RANGE_M = 9.0
BEAMS = 360
SLIP_CELLS, SLIP_RAD, RANGE_ERROR_CELLS = 0.5, 0.004, 1.0  # largest error of a scan's place, turn and ranges
HIT_WEIGHT = 3  # beams that must pass a cell to make up for one that struck it
TILT = (0.9964, 0.0848)  # cosine and sine of the building's turn against the image, 4.9 degrees
SPECKS = ((FREE, OCCUPIED, 36), (FREE, UNKNOWN, 90), (UNKNOWN, FREE, 12), (UNKNOWN, OCCUPIED, 15))
SEED = 13


@dataclass(frozen=True)
class Room:
    """One row of a plan: the floor, what is cut through its walls and what stands on it (metres)."""

    name: str
    floor: Box
    openings: tuple[Box, ...]
    furniture: tuple[Box, ...]


def _against(floor: Box, side: str, at: float, along: float, depth: float) -> Box:
    """Box of that length and depth on a wall of the room; a negative depth reaches into the wall."""
    west, north, east, south = floor
    if side in "NS":
        edge, inward = (north, 1.0) if side == "N" else (south, -1.0)
        low, high = sorted((edge, edge + inward * depth))
        return west + at, low, west + at + along, high
    edge, inward = (west, 1.0) if side == "W" else (east, -1.0)
    low, high = sorted((edge, edge + inward * depth))
    return low, north + at, high, north + at + along


def _piece(floor: Box, words: list[str]) -> Box:
    """Return the box of one piece, given as its words."""
    kind = words[0]
    if kind == "block":
        x, y, width, height = map(float, words[1:])
        return floor[0] + x, floor[1] + y, floor[0] + x + width, floor[1] + y + height
    along, depth = FURNITURE_M[kind] if kind in FURNITURE_M else (OPENINGS_M[kind], -WALL_M)
    return _against(floor, words[1], float(words[2]), along, depth)


def read_plan(text: str) -> list[Room]:
    """Read the rooms of a plan table; a row that ends in a comma goes on in the next line."""
    rooms = []
    for row in text.replace(",\n", ", ").strip().splitlines():
        name, corners, pieces = (field.strip() for field in row.split("|"))
        west, north, east, south = map(float, corners.split())
        floor = (west, north, east, south)
        words = [piece.split() for piece in pieces.split(",") if piece]
        openings = tuple(_piece(floor, w) for w in words if w[0] in OPENINGS_M)
        furniture = tuple(_piece(floor, w) for w in words if w[0] not in OPENINGS_M)
        rooms.append(Room(name, floor, openings, furniture))
    return rooms


def _fill(image: Grey, box: Box, value: int) -> None:
    west, north, east, south = (round(edge / RESOLUTION_M) for edge in box)
    image[north:south, west:east] = value


def draw_plan(text: str, width_m: float, height_m: float) -> Grey:
    """Draw a plan cleanly: floors free, walls and furniture occupied, all else unknown."""
    shape = round(height_m / RESOLUTION_M), round(width_m / RESOLUTION_M)
    image = np.full(shape, UNKNOWN, np.uint8)
    rooms = read_plan(text)
    for room in rooms:
        _fill(image, room.floor, FREE)
    reach = 2 * round(WALL_M / RESOLUTION_M) + 1
    near_floor = cv2.dilate((image == FREE).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    image[near_floor & (image != FREE)] = OCCUPIED
    for room in rooms:
        for box in room.openings:
            _fill(image, box, FREE)
    for room in rooms:
        for box in room.furniture:
            _fill(image, box, OCCUPIED)
    return image


def draw_puzzle() -> Grey:
    """Draw the 13 x 13 maze of the paper's Example 1; digits, S and G mark cells and are free."""
    rows = PUZZLE.split()
    return np.array([[OCCUPIED if mark == "#" else FREE for mark in row] for row in rows], np.uint8)


def _poses() -> NDArray[np.float64]:
    """(N, 2) x, y (metres) of the scans, about ``SCAN_EVERY_M`` apart along the walk."""
    corners = np.array(WALK_M)
    stretches = []
    for start, end in pairwise(corners):
        scans = max(1, round(float(np.abs(end - start).max()) / SCAN_EVERY_M))
        stretches.append(start + (end - start) * (np.arange(scans) / scans)[:, None])
    return np.concatenate([*stretches, corners[-1:]])


def _map_cells(x: NDArray[np.float64], y: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Flat index of the map cell at plan position x, y (in cells), the plan turned about the middle; -1 outside."""
    rows, cols = shape
    cos, sin = TILT
    dx, dy = x - cols / 2, y - rows / 2
    col = np.floor(cols / 2 + cos * dx - sin * dy).astype(np.intp)
    row = np.floor(rows / 2 + sin * dx + cos * dy).astype(np.intp)
    return np.where((row >= 0) & (row < rows) & (col >= 0) & (col < cols), row * cols + col, -1)


def _scan(solid: NDArray[np.bool_], x: float, y: float, rng: np.random.Generator) -> tuple[NDArray[np.intp], ...]:
    """Map cells that one turn of the scanner at x, y (cells of the plan) saw free, and those it saw solid."""
    angle = 2 * np.pi * (np.arange(BEAMS) + rng.uniform(-0.5, 0.5, BEAMS)) / BEAMS
    # Rounded, since the last bits of cos and sin differ between processors and the map must not.
    cos, sin = np.round(np.cos(angle), 9)[:, None], np.round(np.sin(angle), 9)[:, None]
    along = np.arange(0.0, RANGE_M / RESOLUTION_M, 0.5)
    row = np.floor(y + sin * along).astype(np.intp).clip(0, solid.shape[0] - 1)
    col = np.floor(x + cos * along).astype(np.intp).clip(0, solid.shape[1] - 1)
    struck = solid[row, col]
    first = np.where(struck.any(axis=1), struck.argmax(axis=1), along.size)
    # The scanner's error: where the map puts the same beams is off by a little in place, turn and range.
    shift_x, shift_y, turn = rng.uniform(-1.0, 1.0, 3) * (SLIP_CELLS, SLIP_CELLS, SLIP_RAD)
    cos, sin = cos - turn * sin, sin + turn * cos
    far = first / 2 + rng.uniform(-1.0, 1.0, BEAMS) * RANGE_ERROR_CELLS
    cells = _map_cells(x + shift_x + cos * along, y + shift_y + sin * along, solid.shape)
    free = cells[along[None, :] < far[:, None] - 0.7]
    ends = _map_cells(x + shift_x + cos[:, 0] * far, y + shift_y + sin[:, 0] * far, solid.shape)
    hits = ends[first < along.size]
    return free[free >= 0], hits[hits >= 0]


def _speckle(image: Grey, rng: np.random.Generator) -> None:
    """Spoil single cells: ghosts and holes on the floor, stray free specks out in the unknown."""
    for seen, value, count in SPECKS:
        cells = np.flatnonzero(image == seen)
        image.flat[rng.choice(cells, count, replace=False)] = value
    for row, col in rng.integers((8, 8), np.array(image.shape) - 8, (10, 2)):
        if (image[row - 4 : row + 6, col - 4 : col + 6] == UNKNOWN).all():
            image[row : row + 2, col : col + 2] = FREE


def draw_slam() -> Grey:
    """Draw what a laser scanner makes of the plan: ragged walls, fans through windows, rooms half seen."""
    rng = np.random.default_rng(SEED)
    solid = draw_plan(SLAM, 24.0, 18.0) == OCCUPIED
    passes, hits = np.zeros(solid.size, np.int64), np.zeros(solid.size, np.int64)
    for x, y in _poses() / RESOLUTION_M:
        free, struck = _scan(solid, float(x), float(y), rng)
        passes += np.bincount(free, minlength=solid.size)
        hits += np.bincount(struck, minlength=solid.size)
    image = np.full(solid.size, UNKNOWN, np.uint8)
    image[passes > 0] = FREE
    image[(hits > 0) & (hits * HIT_WEIGHT >= passes)] = OCCUPIED
    image = image.reshape(solid.shape)
    _speckle(image, rng)
    return image


def write_map(folder: Path, name: str, image: Grey, resolution_m: float, origin_m: tuple[float, float]) -> None:
    """NAME.png and its ROS map file NAME.yaml; the origin is the image's south-west corner."""
    done, png = cv2.imencode(".png", image)
    if not done:
        raise OSError(f"OpenCV could not encode {name}.png")
    (folder / f"{name}.png").write_bytes(png.tobytes())
    x, y = origin_m
    lines = (
        f"image: {name}.png",
        "mode: trinary",
        f"resolution: {resolution_m}",
        f"origin: [{x}, {y}, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    )
    (folder / f"{name}.yaml").write_bytes(("\n".join(lines) + "\n").encode())


def main(folder: Path) -> None:
    """Draw and write all four maps."""
    folder.mkdir(parents=True, exist_ok=True)
    write_map(folder, "puzzle", draw_puzzle(), 1.0, (0.0, 0.0))
    write_map(folder, "office", draw_plan(OFFICE, 30.0, 20.0), RESOLUTION_M, (0.0, 0.0))
    write_map(folder, "clinic", draw_plan(CLINIC, 60.0, 40.0), RESOLUTION_M, (0.0, 0.0))
    write_map(folder, "slam", draw_slam(), RESOLUTION_M, (-12.4, -8.85))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
