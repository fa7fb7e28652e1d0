"""The best way to the goal that passes given places first, one after the other.

S states, A actions.  It is solved from the end: what lies behind a stop is what the states of the stop are worth on
the way to it; the goal, which would end the way too early, is a wall until then.  A region or a landmark is passed
where one of its cells is entered; a doorway, where a step is made through it: such steps lead to states of their own,
S and on, which are worth what lies behind.
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
from qualrl.solving.exact import ExactValues, settle_outward, shifted_rewards
from qualrl.spatial.region_map import RegionMap


@dataclass(frozen=True)
class StoppingWay:
    """A way by some stops, as it goes when no move slips, and what it is worth when some do."""

    parts: tuple[tuple[int, ...], ...]
    """States from the start to the first stop, from there to the next one, and so on to the goal."""
    shifted: float
    """That value, shifted as exact values are."""
    stops: tuple[str | None, ...]
    """Where each part but the last ends: a landmark by its name, None for a doorway or a region's border."""

    @property
    def walk(self) -> tuple[int, ...]:
        """All states, from the start to the goal."""
        return self.parts[0] + tuple(state for part in self.parts[1:] for state in part[1:])


@dataclass(frozen=True, eq=False)
class _Stop:
    """What must be entered, or which steps made."""

    name: str
    states: NDArray[np.int64]
    """(N,) to enter one of them; of a doorway, those in front of it."""
    moves: NDArray[np.int64] | None
    """(N,) of a doorway, the move from each of them that leads through it."""


@dataclass(frozen=True, eq=False)
class _Layer:
    """The way to a stop."""

    name: str
    slope: Slope
    passed: NDArray[np.bool_]
    """(S + M,) where the stop is passed."""
    beyond: NDArray[np.int64]
    """(M,) where the steps through a doorway lead."""

    def walk(self, start: int) -> tuple[int, ...]:
        """States from a start to the first one where the stop is passed."""
        walk = self.slope.walk(start, self.passed)
        if walk[-1] >= len(self.slope.world):
            walk[-1] = int(self.beyond[walk[-1] - len(self.slope.world)])
        return tuple(walk)


def way_by(model: HybridMDP, exact: ExactValues, start: int, stops: Sequence[str]) -> StoppingWay:
    """The best way from a state to the goal by the stops (regions, doorways or landmarks), in their order.

    Raises UnknownNameError for a stop that is not on the map and NoPlanError where no way leads by it.
    """
    layers = _layers(model, exact, stops)
    parts, here = list[tuple[int, ...]](), start
    for layer in layers:
        if not np.isfinite(layer.slope.shifted[here]):
            through = f"{model.describe(here)} to {layer.name}"
            raise NoPlanError(f"no way leads from {through} and on to the goal without passing the goal first")
        parts.append(layer.walk(here))
        here = parts[-1][-1]
    parts.append(tuple(exact_walk(model, exact, here)))
    others = {*model.region_names, *(door.name for door in model.regions.doorways)} if model.regions else set[str]()
    names = tuple(None if layer.name in others else layer.name for layer in layers)
    return StoppingWay(tuple(parts), _worth(layers, exact, start), names)


def worth_by(model: HybridMDP, exact: ExactValues, start: int, stops: Sequence[str]) -> float:
    """What that way is worth, shifted as exact values are."""
    return _worth(_layers(model, exact, stops), exact, start)


def _worth(layers: Sequence[_Layer], exact: ExactValues, start: int) -> float:
    return float(layers[0].slope.shifted[start] if layers else exact.shifted[start])


def _layers(model: HybridMDP, exact: ExactValues, stops: Sequence[str]) -> list[_Layer]:
    """The way to each stop, in their order; a stop that is the goal alone is left out."""
    found = [stop for name in stops if len((stop := _stop(model, name)).states)]
    layers, behind = list[_Layer](), exact.shifted
    for stop in reversed(found):
        layers.append(_layer(model.grid, stop, behind, exact.shift))
        behind = layers[-1].slope.shifted[: len(model)]
    return layers[::-1]


def _stop(model: HybridMDP, name: str) -> _Stop:
    assert model.regions is not None
    if name not in (door.name for door in model.regions.doorways):
        return _Stop(name, states_at(model, name), None)
    opened, shut = model.grid.successor, model.with_closed([name]).grid.successor
    states, moves = np.nonzero((opened != shut) & (np.arange(len(model)) != model.grid.goal)[:, None])
    return _Stop(name, states, moves)


def states_at(model: HybridMDP, name: str) -> NDArray[np.int64]:
    """The states of a region or of a landmark; not the goal, where every way ends."""
    regions, world = model.regions, model.grid
    assert regions is not None
    if name in regions.region_names:
        found = np.flatnonzero(model.region_of == regions.region_names.index(name))
    else:
        found = np.array([int(world.state_of[_landmark(regions, name)])], np.int64)
    states: NDArray[np.int64] = found[found != world.goal]
    return states


def _landmark(regions: RegionMap, name: str) -> tuple[int, int]:
    for mark in regions.landmarks:
        if mark.name == name:
            return mark.cell
    raise UnknownNameError(regions.why_not(name, "no place", regions.all_names))


def _without_goal(world: GridWorld) -> NDArray[np.uint32]:
    """(S, A) where moves lead when the goal is a wall."""
    own = np.arange(len(world), dtype=np.uint32)[:, None]
    return np.where(world.successor == world.goal, own, world.successor)


def _layer(world: GridWorld, stop: _Stop, behind: NDArray[np.float64], shift: float) -> _Layer:
    """Shifted values of all states on the way to a stop; -inf where no way leads to it."""
    reward = shifted_rewards(world.move_reward, shift, world.gamma)
    successor = _without_goal(world)
    states, moves = stop.states, stop.moves
    ahead = states if moves is None else world.successor[states, moves].astype(np.int64)
    open_ahead = np.isfinite(behind[ahead]) & (world.steps_to_goal[ahead] >= 0)
    states, ahead = states[open_ahead], ahead[open_ahead]
    if not len(states):
        raise NoPlanError(f"no way leads from {stop.name} to the goal")
    if moves is None:
        order, steps = breadth_first(successor, states)
        order, beyond, behind_it = order[len(states) :], np.empty(0, np.int64), np.empty(0)
    else:
        moves = moves[open_ahead]
        at_goal = ahead == world.goal
        behind_it = np.where(at_goal, (world.goal_reward + shift - reward[moves]) / (world.gamma or 1.0), behind[ahead])
        successor[states, moves] = states
        order, steps = breadth_first(successor, np.unique(states))
        successor[states, moves] = len(world) + np.arange(len(states), dtype=np.uint32)
        beyond = ahead
    value = np.concatenate([np.full(len(world), -np.inf), behind_it])
    passed = np.arange(len(value)) >= len(world)
    if moves is None:
        value[states], passed[states] = behind[states], True
    value[order] = 0.0
    settle_outward(successor, order, steps[order], reward, -1, 0.0, world.gamma, world.slip, value)
    return _Layer(stop.name, Slope(world, successor, value, shift, has_goal=False), passed, beyond)
