"""The best way from a state that leaves its region by a given doorway.

S states, A actions.  All other doorways of the region are shut until it is left (paper, equation (10)); what lies
beyond the doorway is worth what it is worth in the whole world.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.slope import Slope
from qualrl.errors import NoPlanError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.one_doorway import OneDoorway, Room
from qualrl.planning.planner import exact_walk
from qualrl.solving.exact import ExactValues
from qualrl.spatial.region_map import Doorway


@dataclass(frozen=True, eq=False)
class ThroughWay:
    """A way through a doorway, as it goes when no move slips, and what it is worth when some do."""

    parts: tuple[tuple[int, ...], ...]
    """States up to the first one beyond the doorway, and from there to the goal; or all to the goal in one part."""
    shifted: float
    """That value, shifted as exact values are."""
    slope: Slope
    """Of the region and just beyond the doorway, the region's other doorways shut; -inf elsewhere."""

    @property
    def walk(self) -> tuple[int, ...]:
        """All states, from the start to the goal."""
        return self.parts[0] + tuple(state for part in self.parts[1:] for state in part[1:])


def way_through(model: HybridMDP, exact: ExactValues, start: int, door: Doorway | None) -> ThroughWay:
    """The best way from a state, which leaves its region by a doorway of it.  Raises NoPlanError where none does.

    door: None for the best way that stays in the goal's region.
    """
    room = left_by(model, start, door)
    world, shifted, successor = model.grid, np.full(len(model), -np.inf), model.grid.successor.copy()
    shifted[room.inside] = _values(model, exact, start, door, room)
    shifted[room.beyond] = exact.shifted[room.beyond]
    successor[room.inside] = room.of_world
    slope = Slope(world, successor, shifted, exact.shift)
    first = slope.walk(start, np.isin(np.arange(len(model)), room.beyond))
    parts = [tuple(first)]
    if door is not None:
        parts.append(tuple(first[-1:] if first[-1] == world.goal else exact_walk(model, exact, first[-1])))
    return ThroughWay(tuple(parts), float(shifted[start]), slope)


def value_through(
    model: HybridMDP, exact: ExactValues, start: int, door: Doorway | None
) -> float:  # fmt: skip
    """The shifted value of a state whose region is left by one doorway, which slips do not change.

    exact: of the whole world, with the same slips.
    Raises NoPlanError where no way leads from the state through the doorway and on, even back, to the goal.
    """
    return value_in(left_by(model, start, door), model, exact, start, door)


def value_in(
    room: OneDoorway, model: HybridMDP, exact: ExactValues, start: int, door: Doorway | None
) -> float:  # fmt: skip
    """The same, once the region is known as one that is left by the doorway, whatever the slips: ``left_by``."""
    return float(_values(model, exact, start, door, room)[np.searchsorted(room.inside, start)])


def left_by(model: HybridMDP, start: int, door: Doorway | None) -> OneDoorway:
    """The region of a state when it is left by one doorway; None: when it is not left but for the goal."""
    assert model.regions is not None
    inside = np.flatnonzero(model.region_of == model.region_of[start])
    return Room.of(model, model.regions, inside).left_by(door)


def _values(
    model: HybridMDP, exact: ExactValues, start: int, door: Doorway | None, room: OneDoorway
) -> NDArray[np.float64]:
    values = room.values(exact.shifted, exact.shift, model.grid.slip)
    if not np.isfinite(values[np.searchsorted(room.inside, start)]):
        what = "the goal" if door is None else door.name
        raise NoPlanError(f"{what} cannot be reached from {model.describe(start)} inside its region")
    return values
