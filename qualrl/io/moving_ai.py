"""MovingAI grid maps and their lists of start and goal, the benchmarks of grid path planning.

A map is text, one character a cell, row 0 on top.  Files say x, y; here cells are (row, column) = (y, x).
"""

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from qualrl.errors import MapError
from qualrl.io.files import read_bytes
from qualrl.io.images import MOST_FILE_BYTES, MOST_PIXELS
from qualrl.spatial.occupancy_grid import Cell, OccupancyGrid

PASSABLE = b".GS"
"""Ground, ground, swamp."""
BLOCKED = b"@OTW"
"""Out of bounds, out of bounds, trees, water."""
FIELDS = 9


@dataclass(frozen=True)
class PathTask:
    """One line of a .scen file: a start, a goal, and how long the best path between them is."""

    bucket: int
    map: str
    shape: tuple[int, int]
    """Rows and columns that the cells are counted in."""
    start: Cell
    goal: Cell
    optimal_length: float
    """In cells, 8 directions, a diagonal step is sqrt 2, corners are not cut."""


def read_moving_ai(path: str | Path, resolution_m: float = 1.0) -> OccupancyGrid:
    """Read a .map file. Raises MapError that points at the line."""
    data = read_bytes(Path(path), what="map", most_bytes=MOST_FILE_BYTES, error=MapError)
    return parse_moving_ai(data, str(path), resolution_m)


def parse_moving_ai(data: bytes, source: str, resolution_m: float = 1.0) -> OccupancyGrid:
    """Read the bytes of a .map file; ``source`` is what messages call it."""
    lines = [line.rstrip(b"\r") for line in data.split(b"\n")]
    height, width = _read_header(lines, source)
    rows = lines[4 : 4 + height]
    after = [line for line in lines[4 + height :] if line.strip()]
    if len(rows) < height or (rows and not rows[-1]):
        found = sum(bool(row) for row in rows)
        raise MapError(f"{source}:2:8: the header promises {height} rows, the file has {found}; correct one of them")
    if after:
        raise MapError(f"{source}:{5 + height}:1: more rows than the {height} that the header promises; correct one")
    for number, row in enumerate(rows, start=5):
        if len(row) != width:
            raise MapError(
                f"{source}:{number}:1: the row has {len(row)} cells, the header promises {width}; correct one"
            )
    cells = np.frombuffer(b"".join(rows), np.uint8).reshape(height, width)
    free, blocked = np.isin(cells, list(PASSABLE)), np.isin(cells, list(BLOCKED))
    strange = np.flatnonzero(~(free | blocked))
    if strange.size:
        above, left = divmod(int(strange[0]), width)
        what = f"{chr(cells[above, left])!r} is no MovingAI terrain; use one of {(PASSABLE + BLOCKED).decode()}"
        raise MapError(f"{source}:{above + 5}:{left + 1}: {what}")
    return OccupancyGrid(free, blocked, resolution_m, source=source, sha256=hashlib.sha256(data).hexdigest())


def _read_header(lines: list[bytes], source: str) -> tuple[int, int]:
    """(height, width)."""
    numbers = []
    for number, expected in enumerate(("type octile", "height HEIGHT", "width WIDTH", "map"), start=1):
        line = lines[number - 1].decode("latin-1") if number <= len(lines) else ""
        words, wanted = line.split(), expected.split()
        counts = wanted[-1].isupper()
        if words[:1] != wanted[:1] or len(words) != len(wanted) or not (counts or words == wanted):
            raise MapError(f"{source}:{number}:1: expected '{expected}', got {line[:40]!r}; is it a MovingAI map?")
        if counts:
            if not (words[1].isascii() and words[1].isdigit() and len(words[1]) < 10 and int(words[1]) > 0):
                raise MapError(f"{source}:{number}:{len(words[0]) + 2}: {words[0]} must be a whole number above 0")
            numbers.append(int(words[1]))
    height, width = numbers
    if height * width > MOST_PIXELS:
        raise MapError(f"{source}:2:1: {height} x {width} cells are more than the {MOST_PIXELS:,} that can be read")
    return height, width


def read_scenarios(path: str | Path) -> list[PathTask]:
    """Read a .scen file. Raises MapError that points at the line."""
    data = read_bytes(Path(path), what="scenario list", most_bytes=MOST_FILE_BYTES, error=MapError)
    first, *lines = data.decode("latin-1").splitlines() or [""]
    if first.split() not in (["version", "1"], ["version", "1.0"]):
        raise MapError(f"{path}:1:1: expected 'version 1', got {first[:40]!r}; is it a MovingAI .scen file?")
    return [_read_task(line, f"{path}:{number}:1") for number, line in enumerate(lines, start=2) if line.strip()]


def _read_task(line: str, where: str) -> PathTask:
    fields = line.strip().split("\t") if "\t" in line else line.split()
    if len(fields) != FIELDS:
        raise MapError(f"{where}: expected {FIELDS} fields separated by tabs, got {len(fields)}")
    try:
        bucket, width, height, start_x, start_y, goal_x, goal_y = (int(fields[at]) for at in (0, 2, 3, 4, 5, 6, 7))
        length = float(fields[8])
    except ValueError:
        what = "expected numbers, but for the map's path: bucket, map, width, height, start x, y, goal x, y, length"
        raise MapError(f"{where}: {what}") from None
    inside = 0 <= start_x < width and 0 <= goal_x < width and 0 <= start_y < height and 0 <= goal_y < height
    if not inside or not (math.isfinite(length) and length >= 0):
        raise MapError(
            f"{where}: start and goal must lie inside {width} x {height} cells, the length must be 0 or more"
        )
    return PathTask(bucket, fields[1], (height, width), (start_y, start_x), (goal_y, goal_x), length)
