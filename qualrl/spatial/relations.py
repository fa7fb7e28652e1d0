"""How the places of a map lie to each other: directions, walking distance, doorways between them, touching.

Places are regions, and zones where there are some.  North is where y of the map's frame grows; on a map whose origin
is turned (yaw) that is not up in the image.  Coordinates east and north are in cells, rounded so that equal ones are.
P places, R regions.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import UnknownNameError, did_you_mean
from qualrl.kernels import labels, routing
from qualrl.kernels.tiles import tile_counts
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.topology import contacts, rcc8
from qualrl.spatial.zones import Zone

TILES = ("north-west", "north", "north-east", "west", "middle", "east", "south-west", "south", "south-east")
"""The nine tiles that the sides of the box around a place divide the plane into, as one reads."""
SIDES = ("north", "west", "east", "south")
HALF = 0.5
"""A place lies in a direction if more than this share of its cells does."""
AROUND = "around"
"""The direction of what lies in none, and not between the sides of the other's box either."""
DIGITS = 6
"""Coordinates are rounded to so many, far below a cell, since turning leaves errors in the last digits."""

Floats = NDArray[np.float64]


class Relations:
    """The relations between any two places of a map, by their names; each sort is worked out when first asked for."""

    def __init__(self, regions: RegionMap, zones: Sequence[Zone] = ()) -> None:
        self.regions = regions
        self.zones = tuple(zones)
        self.names = (*regions.region_names, *(zone.name for zone in zones))
        self._number = {name: at for at, name in enumerate(self.names)}

    def number(self, name: str) -> int:
        """The number of a place in ``names``.  Raises UnknownNameError."""
        if name not in self._number:
            raise UnknownNameError(f"no region or zone is called {name!r}; {did_you_mean(name, self.names)}")
        return self._number[name]

    def is_region(self, name: str) -> bool:
        """Whether a place is a region and no zone."""
        return self.number(name) < len(self.regions.regions)

    def shares(self, of: str, seen_from: str) -> dict[str, float]:
        """The share of a place's cells in each tile around another one, tiles without any left out."""
        counts = self._tiles[self.number(of), self.number(seen_from)]
        return {tile: float(count / counts.sum()) for tile, count in zip(TILES, counts, strict=True) if count}

    def direction(self, of: str, seen_from: str) -> str:
        """Where most of a place lies, seen from another one: one of TILES, or AROUND where more than half lies nowhere.

        A corner, if more than half lies in its tile; else the side beyond which most lies, if that is more than half.
        """
        counts = self._tiles[self.number(of), self.number(seen_from)]
        most = int(counts.argmax())
        if counts[most] > HALF * counts.sum():
            return TILES[most]
        side = max(SIDES, key=lambda side: self.share_towards(side, of, seen_from))
        return side if self.share_towards(side, of, seen_from) > HALF else AROUND

    def share_towards(self, direction: str, of: str, seen_from: str) -> float:
        """The share of a place's cells beyond another one, in a direction.

        direction: one of TILES but "middle"; north counts the north-western and north-eastern tiles too.
        """
        counts = self._tiles[self.number(of), self.number(seen_from)]
        beyond = [direction in (tile, *tile.split("-")) for tile in TILES]
        return float(counts[beyond].sum() / counts.sum())

    def extent(self, of: str, axis: int) -> tuple[float, float, float, float]:
        """Along an axis (0 to the east, 1 to the north): the first, the two in the middle, and the last of its cells.

        Of an odd number of cells there is one in the middle, which is told twice.
        """
        along = self._coordinates[self.number(of)][axis]
        first, lower, upper, last = np.sort(along)[[0, (len(along) - 1) // 2, len(along) // 2, -1]].tolist()
        return first, lower, upper, last

    def middle(self, of: str) -> tuple[float, float]:
        """The median of a place's cells east, and that north."""
        east, north = self._middles[self.number(of)].tolist()
        return east, north

    def distance_m(self, of: str, to: str) -> float:
        """Metres walked from centre to centre in steps up, down, left and right; infinite where no way leads."""
        steps = int(self._steps[self.number(of), self.number(to)])
        return steps * self.regions.grid.resolution_m if steps >= 0 else math.inf

    def doorways(self, of: str, to: str) -> tuple[str, ...]:
        """The names of the doorways between two regions; zones have none."""
        pair = tuple(sorted((self.number(of), self.number(to))))
        return self._doorways.get(pair, ())

    def topology(self, of: str, to: str) -> str:
        """The RCC8 relation of two places' cells: see ``spatial.topology``."""
        pair = self.number(of), self.number(to)
        if max(pair) >= len(self.regions.regions):
            return rcc8(*(self._mask(place) for place in pair))
        return "EQ" if pair[0] == pair[1] else "EC" if (min(pair), max(pair)) in self._contacts else "DC"

    def centre(self, of: str) -> Cell:
        """The cell from which distances to a place are walked."""
        return self._centres[self.number(of)]

    @cached_property
    def _centres(self) -> tuple[Cell, ...]:
        return (*(region.centre for region in self.regions.regions), *(zone.centre for zone in self.zones))

    @cached_property
    def _doorways(self) -> dict[tuple[int, ...], tuple[str, ...]]:
        found: dict[tuple[int, ...], tuple[str, ...]] = {}
        for door in self.regions.doorways:
            found[door.pair] = (*found.get(door.pair, ()), door.name)
        return found

    @cached_property
    def _contacts(self) -> set[tuple[int, int]]:
        return contacts(self.regions.label)

    def _mask(self, place: int) -> NDArray[np.bool_]:
        zone = place - len(self.regions.regions)
        return self.zones[zone].cells if zone >= 0 else self.regions.label == place

    @cached_property
    def _coordinates(self) -> list[tuple[Floats, Floats]]:
        """By place: how far east and north each of its cells lies."""
        label = self.regions.label
        (east_down, north_down), (east_right, north_right) = self.regions.grid.compass
        found = []
        for place, (top, bottom, left, right) in enumerate(labels.boxes(label, len(self.regions.regions)).tolist()):
            found.append(np.argwhere(label[top:bottom, left:right] == place) + np.array((top, left)))
        found += [np.argwhere(zone.cells) for zone in self.zones]
        return [
            (
                np.round(cells @ (east_down, east_right), DIGITS),
                np.round(cells @ (north_down, north_right), DIGITS),
            )
            for cells in found
        ]

    @cached_property
    def _tiles(self) -> NDArray[np.int64]:
        """(P, P, 9) how many cells of the first place lie in which tile around the second."""
        return np.array([tile_counts(east, north, self._boxes) for east, north in self._coordinates])

    @cached_property
    def _boxes(self) -> Floats:
        """(P, 4) how far west, east, south and north the cells of each place reach."""
        return np.array([[e.min(), e.max(), n.min(), n.max()] for e, n in self._coordinates])

    @cached_property
    def _middles(self) -> Floats:
        """(P, 2)"""
        found = np.array([[np.median(east), np.median(north)] for east, north in self._coordinates])
        return np.round(found, DIGITS + 1)  # of two middle cells the mean, which leaves errors too

    @cached_property
    def _steps(self) -> NDArray[np.int32]:
        """(P, P) steps from centre to centre; -1 where no way leads."""
        label = np.ascontiguousarray(self.regions.label)
        allowed = np.ones(len(self.regions.regions), np.bool_)
        seen, scratch = np.zeros(label.size, np.int32), (np.empty(label.size, np.int32), np.zeros(label.size, np.bool_))
        at = np.array([row * label.shape[1] + column for row, column in self._centres], np.int32)
        found = np.empty((len(at), len(at)), np.int32)
        most = int(np.iinfo(np.int32).max)
        for place in range(len(at)):
            seen[:] = 0
            routing.walk(label, allowed, at[[place]], at, len(at), 0, most, seen, 1, *scratch)
            found[place] = seen[at] - 1
        return found
