"""Places as people write them: a name, a cell, or a point in metres; and the cell that each stands for.

A cell is (row, column) in image order, whole numbers; a point is (x, y) in metres, told apart by a decimal
point (or exponent) in at least one of the two numbers.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from qualrl.errors import PlaceError, SettingError, UnknownNameError, shown
from qualrl.spatial.occupancy_grid import Cell, OccupancyGrid
from qualrl.spatial.region_map import RegionMap

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
TWO_NUMBERS = re.compile(rf"\s*({NUMBER})\s*,\s*({NUMBER})\s*", re.ASCII)
BEFORE_COMMA = re.compile(r"""\s*(?:"(?P<one>[^"]+)"|'(?P<two>[^']+)')\s*(?=,|\Z)|(?P<plain>[^,]*)""")
MOST_CELLS = 10**9
"""No map has as many rows or columns."""
MOST_CHARACTERS = 100
EXPECTED = "a name, [row, column] in whole numbers, or [x, y] in metres with a decimal point"


@dataclass(frozen=True)
class PlaceName:
    """A region, doorway or landmark by its name."""

    name: str

    def __post_init__(self) -> None:
        """Refuse what no place could be found by."""
        if not self.name.strip():
            raise PlaceError(f"a place needs a name, got {self.name!r}; write {EXPECTED}")
        if len(self.name) > MOST_CHARACTERS:
            raise PlaceError(f"the name of a place has at most {MOST_CHARACTERS} characters, got {len(self.name)}")
        if TWO_NUMBERS.fullmatch(self.name):
            raise PlaceError(f"{self.name!r} reads as two numbers, so no place can have it as its name")

    def __str__(self) -> str:
        """As messages call it."""
        return self.name


@dataclass(frozen=True)
class PlaceCell:
    """A cell of the map."""

    row: int
    column: int

    def __post_init__(self) -> None:
        """Refuse what no map is large enough for."""
        if max(abs(self.row), abs(self.column)) > MOST_CELLS:
            raise PlaceError(f"no map has a cell {shown([self.row, self.column])}; write {EXPECTED}")

    def __str__(self) -> str:
        """As messages call it."""
        return f"cell {self.row},{self.column}"


@dataclass(frozen=True)
class PlaceMetres:
    """A point of the world."""

    x_m: float
    y_m: float

    def __post_init__(self) -> None:
        """Refuse what is no point."""
        if not (math.isfinite(self.x_m) and math.isfinite(self.y_m)):
            raise PlaceError(f"a point needs two finite numbers, got {self.x_m}, {self.y_m}")

    def __str__(self) -> str:
        """As messages call it."""
        return f"point {self.x_m:g}, {self.y_m:g} m"


Place = PlaceName | PlaceCell | PlaceMetres
PlaceLike = str | tuple[float, float] | list[float] | Place
"""A name, [row, column] in whole numbers, [x, y] in metres with a decimal point, "120,45", or "3.5,2.0"."""


def read_place(text: object) -> Place:
    """A place from a command line's text or from a scenario's text or pair of numbers.

    >>> read_place("120,45"), read_place([3.5, 2])
    (PlaceCell(row=120, column=45), PlaceMetres(x_m=3.5, y_m=2.0))
    """
    if isinstance(text, PlaceName | PlaceCell | PlaceMetres):
        return text
    if isinstance(text, str):
        match = TWO_NUMBERS.fullmatch(text) if len(text) <= MOST_CHARACTERS else None
        return _pair(*(_number(part) for part in match.groups())) if match else PlaceName(text)
    if isinstance(text, list | tuple) and len(text) == 2 and all(type(part) in (int, float) for part in text):
        return _pair(*text)
    hint = "; quote a name that looks like a number" if isinstance(text, int | float) else ""
    raise PlaceError(f"must be {EXPECTED}, got {shown(text)}{hint}")


def resolve_cell(place: Place, regions: RegionMap) -> Cell:
    """The free cell that a place stands for.

    Raises UnknownNameError for a name that is not on the map, PlaceError for a cell or point that lies
    outside the map or where no robot can stand.
    """
    if isinstance(place, PlaceName):
        return _named_cell(place.name, regions)
    grid = regions.grid
    try:
        cell = (place.row, place.column) if isinstance(place, PlaceCell) else grid.to_cell(place.x_m, place.y_m)
        inside = grid.contains(cell)
    except OverflowError:  # so many cells away that their number is no number
        inside = False
    if not inside:
        rows, columns = grid.shape
        raise PlaceError(f"{place} lies outside the map of {rows} x {columns} cells{_extent(place, grid)}")
    if not grid.free[cell]:
        kind = "in a wall" if grid.occupied[cell] else "where the map is unknown"
        if grid.tight is not None and grid.tight[cell]:
            kind = f"too near to a wall or unknown cells for a robot with radius_m {grid.radius_m:g}"
        row, column = _nearest_free(cell, grid)
        raise PlaceError(f"{place} lies {kind}; the nearest free cell is {row},{column}")
    return cell


def _named_cell(name: str, regions: RegionMap) -> Cell:
    for region in regions.regions:
        if region.name == name:
            return region.centre
    for mark in regions.landmarks:
        if mark.name == name:
            return mark.cell
    raise UnknownNameError(regions.why_not(name, "no place", regions.all_names))


def _extent(place: Place, grid: OccupancyGrid) -> str:
    if not isinstance(place, PlaceMetres):
        return ""
    rows, columns = grid.shape
    corners = [grid.to_world(row - 0.5, column - 0.5) for row in (0, rows) for column in (0, columns)]
    xs, ys = zip(*corners, strict=True)
    return f", which spans x {min(xs):.2f} to {max(xs):.2f} m and y {min(ys):.2f} to {max(ys):.2f} m"


def _nearest_free(cell: Cell, grid: OccupancyGrid) -> Cell:
    """By straight distance; the upper, then the left one of equals."""
    rows, columns = np.nonzero(grid.free)
    nearest = int(np.argmin((rows - cell[0]) ** 2 + (columns - cell[1]) ** 2))
    return int(rows[nearest]), int(columns[nearest])


def _number(text: str) -> float:
    return float(text) if any(character in text for character in ".eE") else int(text)


def _pair(first: float, second: float) -> Place:
    if isinstance(first, int) and isinstance(second, int):
        return PlaceCell(first, second)
    try:
        return PlaceMetres(float(first), float(second))
    except OverflowError:
        raise PlaceError(f"must be {EXPECTED}, got a number too large for a point") from None


def names_between_commas(text: str, known: Iterable[str]) -> list[str]:
    """Names with commas between; a known one may hold some itself, and quotes may stand around each.

    >>> names_between_commas("room A, lab, upstairs", ["lab, upstairs", "room A"])
    ['room A', 'lab, upstairs']

    Raises SettingError where nothing stands between two commas, and where there are several ways to read known names.
    """
    parts = _between_commas(text)
    if not all(part for part, _ in parts):
        raise SettingError(f"{text!r}: write names with a comma between, as 'room A, corridor 1'")
    named: dict[str, list[str]] = {}
    for name in known:
        named.setdefault(",".join(part.strip() for part in name.split(",")), []).append(name)
    readings = _readings(parts, named)
    if len(readings) > 1:
        one, other = (", ".join(f'"{name}"' for name in names) for names in readings)
        raise SettingError(f"{text!r} can be read as {one} or as {other}: write it so, with quotes around each name")
    return readings[0]


def _between_commas(text: str) -> list[tuple[str, bool]]:
    """What stands between commas, and whether in quotes, which may hold commas."""
    found, at = list[tuple[str, bool]](), 0
    while at <= len(text):
        match = BEFORE_COMMA.match(text, at)
        assert match is not None
        quoted = match["one"] or match["two"]
        found.append((match["plain"].strip(), False) if quoted is None else (quoted, True))
        at = match.end() + 1
    return found


def _readings(parts: Sequence[tuple[str, bool]], named: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Ways to read parts as names, as many of them known as can be; two at most."""
    after = [list[tuple[int, list[str]]]() for _ in parts] + [[(0, list[str]())]]
    for at in range(len(parts) - 1, -1, -1):
        first, is_quoted = parts[at]
        alone = () if not is_quoted and first in named else (first,)
        found = [(unknown + (not is_quoted), [name, *rest]) for name in alone for unknown, rest in after[at + 1]]
        for end in range(at + 1, len(parts) + 1):
            if parts[end - 1][1]:
                break
            names = named.get(",".join(part for part, _ in parts[at:end]), ())
            found += [(unknown, [name, *rest]) for name in names for unknown, rest in after[end]]
        fewest = min(unknown for unknown, _ in found)
        after[at] = [reading for reading in found if reading[0] == fewest][:2]
    return [names for _, names in after[0]]
