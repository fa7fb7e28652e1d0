"""The best way to the goal that passes given places first, one after the other.

S states, A actions.  It is solved from the end: what lies behind a stop is what the states of the stop are worth on
the way to it; the goal, which would end the way too early, is a wall until then.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.slope import Slope
from qualrl.errors import NoPlanError, UnknownNameError
from qualrl.kernels.grid import breadth_first
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import ExactValues, settle_outward
from qualrl.spatial.region_map import RegionMap


@dataclass(frozen=True)
class StoppingWay:
    """A way by some stops, as it goes when no move slips, and what it is worth when some do."""

    parts: tuple[tuple[int, ...], ...]
    """States from the start to the first stop, from there to the next one, and so on to the goal."""
    shifted: float
    """That value, shifted as exact values are."""

    @property
    def walk(self) -> tuple[int, ...]:
        """All states, from the start to the goal."""
        return self.parts[0] + tuple(state for part in self.parts[1:] for state in part[1:])


def way_by(model: HybridMDP, exact: ExactValues, start: int, stops: Sequence[str]) -> StoppingWay:
    """The best way from a state to the goal by the stops (regions, doorways or landmarks), in their order.

    Raises UnknownNameError for a stop that is not on the map and NoPlanError where no way leads by it.
    """
    world = model.grid
    before_goal = _without_goal(world)
    places = _places(model, stops)
    values = _values(world, before_goal, exact, places)
    parts, here = list[tuple[int, ...]](), start
    for (name, stop), ahead in zip(places, values, strict=False):
        if not np.isfinite(ahead[here]):
            raise NoPlanError(f"no way leads from {model.describe(here)} to {name} without passing the goal first")
        slope = Slope(world, before_goal, ahead, exact.shift, has_goal=False)
        parts.append(tuple(slope.walk(here, _is_in(world, stop))))
        here = parts[-1][-1]
    parts.append(tuple(exact_walk(model, exact, here)))
    return StoppingWay(tuple(parts), float(values[0][start]))


def worth_by(model: HybridMDP, exact: ExactValues, start: int, stops: Sequence[str]) -> float:
    """What that way is worth, shifted as exact values are."""
    return float(_values(model.grid, _without_goal(model.grid), exact, _places(model, stops))[0][start])


def _places(model: HybridMDP, stops: Sequence[str]) -> list[tuple[str, NDArray[np.int64]]]:
    """Each stop and its states; those that are the goal alone are left out."""
    found = [(stop, states_at(model, stop)) for stop in stops]
    return [(stop, states) for stop, states in found if len(states)]


def _values(
    world: GridWorld, before_goal: NDArray[np.uint32], exact: ExactValues, places: list[tuple[str, NDArray[np.int64]]]
) -> list[NDArray[np.float64]]:
    """Shifted values (S,) on the way to each place, and after the last of them."""
    values = [exact.shifted]
    for name, states in reversed(places):
        values.append(_values_to(world, before_goal, states, values[-1], exact.shift, name))
    return values[::-1]


def states_at(model: HybridMDP, name: str) -> NDArray[np.int64]:
    """The states of a region, of a doorway (both sides), or of a landmark; not the goal, where every way ends."""
    regions, world = model.regions, model.grid
    assert regions is not None
    if name in regions.region_names:
        found = np.flatnonzero(model.region_of == regions.region_names.index(name))
    else:
        found = np.array(sorted({int(world.state_of[cell]) for cell in _cells(regions, name)}), np.int64)
    states: NDArray[np.int64] = found[found != world.goal]
    return states


def _cells(regions: RegionMap, name: str) -> list[tuple[int, int]]:
    for door in regions.doorways:
        if door.name == name:
            return [cell for crossing in crossings_of(regions, door) for cell in crossing]
    for mark in regions.landmarks:
        if mark.name == name:
            return [mark.cell]
    raise UnknownNameError(regions.why_not(name, "no place", regions.all_names))


def _is_in(world: GridWorld, states: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(S,) whether a state is one of some."""
    found = np.zeros(len(world), np.bool_)
    found[states] = True
    return found


def _without_goal(world: GridWorld) -> NDArray[np.uint32]:
    """(S, A) where moves lead when the goal is a wall."""
    own = np.arange(len(world), dtype=np.uint32)[:, None]
    return np.where(world.successor == world.goal, own, world.successor)


def _values_to(
    world: GridWorld, successor: NDArray[np.uint32], stop: NDArray[np.int64], behind: NDArray[np.float64],
    shift: float, name: str,
) -> NDArray[np.float64]:  # fmt: skip
    """(S,) shifted values of all states on the way to a stop; -inf where no way leads to it."""
    open_stop = stop[np.isfinite(behind[stop]) & (world.steps_to_goal[stop] >= 0)]
    if not len(open_stop):
        raise NoPlanError(f"no way leads from {name} to the goal")
    order, steps = breadth_first(successor, open_stop)
    value = np.full(len(world), -np.inf)
    value[open_stop] = behind[open_stop]
    rest = order[len(open_stop) :]
    value[rest] = 0.0
    settle_outward(
        successor, rest, steps[rest], world.move_reward + shift * (1 - world.gamma), -1, 0.0, world.gamma, world.slip,
        value,
    )  # fmt: skip
    return value
