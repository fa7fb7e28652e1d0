"""Landmarks placed by hand, in the stead of those that were found (paper, section 4.1.1: l = {cell(i, j)})."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from qualrl.errors import PlaceError, ScenarioError, UnknownNameError
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.place import Place, resolve_cell
from qualrl.spatial.region_map import Landmark, RegionMap

PLACED = "placed"
"""The kind of a landmark that was placed, unless it took over a doorway."""


def with_landmarks(regions: RegionMap, places: Mapping[str, Place]) -> RegionMap:
    """The same map with landmarks at these places, name -> place, instead of those that were found.

    A region's name places one at its centre.
    Doorways stay.  A landmark placed in a doorway takes it over: the doorway gets its name, and it joins both
    regions; of two doorways that share the cell, the first.
    Raises UnknownNameError, PlaceError or ScenarioError, each beginning with the landmark it is about.
    """
    cells = {name: _cell_of(name, place, regions) for name, place in places.items()}
    _check_cells(cells)
    taken = _doorways_taken(cells, regions)
    doorways = tuple(replace(door, name=taken.get(door.name, door.name)) for door in regions.doorways)
    kept = [mark for mark in regions.landmarks if mark.kind == "doorway"]
    marks = [
        replace(mark, name=taken[mark.name], cell=cells[taken[mark.name]]) if mark.name in taken else mark
        for mark in kept
    ]
    marks += [_placed(name, cell, regions) for name, cell in cells.items() if name not in taken.values()]
    placed = replace(regions, doorways=doorways, landmarks=tuple(marks))
    _check_names(cells, placed)
    return placed


def _cell_of(name: str, place: Place, regions: RegionMap) -> Cell:
    try:
        return resolve_cell(place, regions)
    except (PlaceError, UnknownNameError) as problem:
        raise type(problem)(f"landmarks.{name}: {problem}") from None


def _check_cells(cells: Mapping[str, Cell]) -> None:
    at: dict[Cell, str] = {}
    for name, cell in cells.items():
        if cell in at:
            raise ScenarioError(f"landmarks.{name}: lies on cell {cell[0]},{cell[1]}, where {at[cell]!r} is already")
        at[cell] = name


def _doorways_taken(cells: Mapping[str, Cell], regions: RegionMap) -> dict[str, str]:
    """Name of a doorway -> the landmark that takes it over."""
    taken: dict[str, str] = {}
    for name, cell in cells.items():
        doors = [door.name for door in regions.doorways if (door.cells == cell).all(axis=1).any()]
        if doors and doors[0] in taken:
            other = taken[doors[0]]
            raise ScenarioError(f"landmarks.{name}: lies in {doors[0]!r} as {other!r} does; one landmark a doorway")
        if doors:
            taken[doors[0]] = name
    return taken


def _placed(name: str, cell: Cell, regions: RegionMap) -> Landmark:
    cells = np.array([cell], np.int32)
    cells.setflags(write=False)
    return Landmark(name, PLACED, cell, cells, (int(regions.label[cell]),))


def _check_names(cells: Mapping[str, Cell], regions: RegionMap) -> None:
    counts = Counter(regions.all_names)
    for name in cells:
        if counts[name] > 1:
            raise ScenarioError(f"landmarks.{name}: another place is called so already; choose another name")
