"""What would open a way where there is none: a smaller robot, other thresholds of the map, a doorway.

Each opening is proved: the world is built anew with it, and a way found there.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from qualrl.answers.blocked import Blocked, Crossing, Flags, Kinds, Way
from qualrl.answers.depth import Depth
from qualrl.spatial.footprint import SLACK, clearance, has_room, rounded_down

MOST_TOLD = 3
"""More places of one opening than this are counted, not told."""


@dataclass(frozen=True)
class Opening(ABC):
    """A change that opens a way from the start to the goal, both held where they are."""

    steps: int
    """The fewest moves to the goal then."""
    way: Way
    """One such way, of those that lead over the fewest cells where the robot cannot stand now; 4-connected."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """One of "radius", "thresholds", "doorways" and "clearing"."""

    @abstractmethod
    def brief(self, depth: Depth = Depth.NUMBERS) -> str:
        """The change in a few words."""

    @abstractmethod
    def change(self, depth: Depth) -> str:
        """The change, with what goes with it."""

    @abstractmethod
    def details(self) -> dict[str, Any]:
        """The change as JSON."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        steps = f"; the shortest way then takes {self.steps:,} step{'' if self.steps == 1 else 's'}"
        return f"{self.change(depth)}{depth.at_numbers(steps)}."

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "kind": self.kind, "steps": self.steps, **self.details(), "way": [list(cell) for cell in self.way],
        }  # fmt: skip


@dataclass(frozen=True)
class SmallerRobot(Opening):
    """The largest radius, smaller than the robot's, with which there is a way."""

    radius_m: float
    """Rounded down to four digits."""
    radius_now_m: float
    clearance_cells: float
    """The same, exactly: from the middle of the narrowest cell to the nearest point of one that is not free."""
    narrowest: Crossing
    """The cell of the way with the least room."""

    kind = "radius"

    def brief(self, depth: Depth = Depth.NUMBERS) -> str:
        """See Opening."""
        smaller = f"another{depth.from_signs(', smaller')} radius_m"
        return depth.at_numbers(f"radius_m {self.radius_m:g} instead of {self.radius_now_m:g}", smaller)

    def change(self, depth: Depth) -> str:
        """See Opening."""
        narrowest = depth.from_signs("just fits the narrowest place", "fits the place")
        return f"{self.brief(depth)}, which {narrowest}, {self.narrowest.where(depth)}"

    def details(self) -> dict[str, Any]:
        """See Opening."""
        return {
            "radius_m": self.radius_m, "radius_now_m": self.radius_now_m, "clearance_cells": self.clearance_cells,
            "narrowest": self.narrowest.to_dict(),
        }  # fmt: skip


@dataclass(frozen=True)
class OtherThresholds(Opening):
    """Other settings of a ROS map, under which more of its cells are free."""

    settings: tuple[tuple[str, Any, Any], ...]
    """(key, value now, value then) of each that changes."""
    freed: Kinds
    """Cells of the map that become free."""
    freed_on_way: Kinds
    lost: int
    """Cells of the map that are free now and then no longer."""

    kind = "thresholds"

    def brief(self, depth: Depth = Depth.NUMBERS) -> str:
        """See Opening."""
        return f"{' and '.join(_setting_in_words(*setting, depth) for setting in self.settings)} in the map"

    def change(self, depth: Depth) -> str:
        """See Opening."""
        lost = f"; {depth.at_numbers(f'{self.lost:,}', 'some')} that are free no longer are" if self.lost else ""
        return f"{self.brief(depth)}, which frees {self.freed.in_words(depth)}, {self._on_way(depth)}{lost}"

    def _on_way(self, depth: Depth) -> str:
        if self.freed_on_way == Kinds():
            return "none on that way"
        walls = " (walls, as the map is read now)" if self.freed_on_way.wall else ""
        return f"{self.freed_on_way.in_words(depth)} on that way{walls}"

    def in_words(self, depth: Depth) -> str:
        """See Opening; with a warning where nobody has seen what is there."""
        told = super().in_words(depth)
        if not self.freed_on_way.unknown:
            return told
        return f"{told} Careful: the map does not know whether anything stands on those unknown cells."

    def details(self) -> dict[str, Any]:
        """See Opening."""
        return {
            "settings": {key: {"now": now, "then": then} for key, now, then in self.settings},
            "freed": self.freed.to_dict(), "freed_on_way": self.freed_on_way.to_dict(), "lost": self.lost,
        }  # fmt: skip


@dataclass(frozen=True)
class OpenDoorways(Opening):
    """Closed doorways, opened: as few as can be."""

    doors: tuple[str, ...]

    kind = "doorways"

    def brief(self, depth: Depth = Depth.NUMBERS) -> str:
        """See Opening."""
        return f"{' and '.join(self.doors)} opened"

    def change(self, depth: Depth) -> str:
        """See Opening."""
        return self.brief(depth)

    def details(self) -> dict[str, Any]:
        """See Opening."""
        return {"doors": list(self.doors)}


@dataclass(frozen=True)
class Cleared(Opening):
    """Cells made free: those in the way, and for a robot that is no point all that are too near to them."""

    crossings: tuple[Crossing, ...]
    """The places where that is done."""
    cleared: Kinds
    cells: Way
    """All that are cleared."""
    doors: tuple[str, ...]
    """Closed doorways on the way, which are opened too."""
    radius_m: float
    resolution_m: float

    kind = "clearing"

    def brief(self, depth: Depth = Depth.NUMBERS) -> str:
        """See Opening."""
        doors = f", and {' and '.join(self.doors)} opened" if self.doors else ""
        return f"{self.cleared.in_words(depth)} cleared{doors}"

    def change(self, depth: Depth) -> str:
        """See Opening."""
        places = [self._at(place, depth) for place in self.crossings[:MOST_TOLD]]
        if len(self.crossings) > MOST_TOLD:
            places.append(depth.at_numbers(f"{len(self.crossings) - MOST_TOLD} places more", "in other places"))
        return f"{' and '.join(places)}: {self.brief(depth)}"

    def _at(self, place: Crossing, depth: Depth) -> str:
        """What must be done at a place."""
        kinds = place.kinds
        what = (
            "a doorway through the wall" if kinds.wall else "unknown space mapped as free" if kinds.unknown else "a way"
        )
        wide = (
            f" wide enough for {depth.at_numbers(f'radius_m {self.radius_m:g}', 'the robot')}" if self.radius_m else ""
        )
        thick = kinds.wall + kinds.unknown
        cells = f", {thick} cell{'' if thick == 1 else 's'} ({thick * self.resolution_m:.2f} m) thick" if thick else ""
        return f"{what}{wide} {place.sides()}{depth.at_numbers(cells)}"

    def details(self) -> dict[str, Any]:
        """See Opening."""
        return {
            "crossings": [place.to_dict() for place in self.crossings], "cleared": self.cleared.to_dict(),
            "cells": [list(cell) for cell in self.cells], "doors": list(self.doors),
            "radius_m": self.radius_m, "resolution_m": self.resolution_m,
        }  # fmt: skip


def _setting_in_words(key: str, now: Any, then: Any, depth: Depth) -> str:
    """A setting of a map and its two values; of numbers at the depth of signs, which way it goes."""
    if depth == Depth.NUMBERS or isinstance(now, str):
        return f"{key} {_plain(then)} instead of {_plain(now)}"
    return f"another{depth.from_signs(', higher' if then > now else ', lower')} {key}"


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def first_to_open(count: int, opens: Callable[[int], bool]) -> int | None:
    """The least number below ``count`` that opens a way, if all above it do; None where the last does not."""
    if count == 0 or not opens(count - 1):
        return None
    low, high = 0, count - 1
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if opens(middle) else (middle + 1, high)
    return low


def smaller_robot(blocked: Blocked) -> SmallerRobot | None:
    """The largest smaller radius with a way; None for a robot that is a point, or where no radius has one.

    Exact: what counts is how the room of the narrowest cell compares to the radius, and there are only so many rooms.
    """
    grid = blocked.grid
    if grid.radius_m == 0:
        return None
    room = clearance(blocked.map_free)
    rooms = np.unique(room[blocked.map_free])
    rooms = rooms[rooms + SLACK < blocked.radius][::-1]
    at = first_to_open(len(rooms), lambda number: blocked.steps(has_room(room, rooms[number])) >= 0)
    if at is None:
        return None
    radius_m = rounded_down(rooms[at] * grid.resolution_m)
    standing = has_room(room, radius_m / grid.resolution_m)
    way = blocked.way_changing_least(standing)
    narrow = int(np.argmin(room[tuple(np.array(way).T)]))
    place = blocked.crossing(way, narrow, narrow)
    return SmallerRobot(blocked.steps(standing), way, radius_m, grid.radius_m, float(rooms[at]), place)


def open_doorways(blocked: Blocked, way: Way, crossings: Sequence[Crossing]) -> OpenDoorways | None:
    """The closed doorways that the least obstacle consists of; None where cells are in the way too."""
    doors = _doors(crossings)
    if not doors or any(place.door is None for place in crossings):
        return None
    return OpenDoorways(_steps_with(blocked, blocked.grid.free, doors), way, doors)


def cleared(blocked: Blocked, way: Way, crossings: Sequence[Crossing]) -> Cleared | None:
    """The least obstacle cleared away; None where it consists of closed doorways."""
    places = tuple(place for place in crossings if place.door is None)
    if not places:
        return None
    gone = _around([cell for place in places for cell in place.cells], blocked) & ~blocked.map_free
    doors = _doors(crossings)
    cells = tuple((row, column) for row, column in np.argwhere(gone).tolist())
    return Cleared(
        _steps_with(blocked, blocked.standing(blocked.map_free | gone), doors), way, places, blocked.kinds(gone), cells,
        doors, blocked.grid.radius_m, blocked.grid.resolution_m,
    )  # fmt: skip


def _doors(crossings: Sequence[Crossing]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(place.door for place in crossings if place.door is not None))


def _steps_with(blocked: Blocked, standing: Flags, opened: Sequence[str]) -> int:
    """The fewest moves with some closed doorways opened."""
    left = tuple(wall for wall in blocked.model.grid.closed if blocked.closed_doors[wall] not in opened)
    return blocked.steps(standing, left)


def _around(cells: Sequence[tuple[int, int]], blocked: Blocked) -> Flags:
    """(H, W) some cells, and all that a robot with its centre on one of them would touch."""
    reach = int(blocked.radius + 1)
    apart = np.maximum(np.abs(np.arange(-reach, reach + 1)) - 0.5, 0)
    disc = np.hypot(apart[:, None], apart[None]) + SLACK < blocked.radius
    disc[reach, reach] = True
    height, width = blocked.grid.shape
    touched = np.zeros((height + 2 * reach, width + 2 * reach), np.bool_)
    for row, column in cells:
        touched[row : row + 2 * reach + 1, column : column + 2 * reach + 1] |= disc
    return touched[reach : reach + height, reach : reach + width]
