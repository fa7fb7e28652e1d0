"""Making a plan: follow the values to the goal, cut the walk at the doors, and say why at each."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import NoPlanError
from qualrl.learning.run import LearningRun
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.choices import Choice, Chooser
from qualrl.planning.crossings import door_taken
from qualrl.planning.legs import Leg, legs_of
from qualrl.planning.on_the_way import passages, seen_on_stretches
from qualrl.planning.plan import Plan, Step, in_steps
from qualrl.planning.values import PlanValues, exact_plan_values, learned_plan_values
from qualrl.solving.exact import ExactValues, crossings_to_goal, exact_values, off_of
from qualrl.solving.policy import ActionValues, greedy_walk
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import Doorway, RegionMap

TOO_NEAR = 1e-9
"""Nearer to 1 a gamma leaves no digits for a step."""


def plan_exactly(
    model: HybridMDP, start: int, names: tuple[str, str], *, exact: ExactValues | None = None,
    notes: Sequence[str] = (),
) -> Plan:  # fmt: skip
    """The optimal plan.  names: what to call start and goal.  Raises NoPlanError when no way leads to the goal."""
    model.check_reachable(start)
    solved = exact or exact_values(model.world)
    walk = exact_walk(model, solved, start)
    return _plan(model, walk, exact_plan_values(model, solved), names, notes)


def exact_walk(model: HybridMDP, solved: ExactValues, start: int) -> list[int]:
    """States of the best way to the goal as it goes when no move slips.  Raises NoPlanError where values fade."""
    values = exact_plan_values(model, solved)
    crossings = None
    if isinstance(model.world, GridWorld):
        crossings = crossings_to_goal(model.world, solved, model.region_of)
    walk, arrived = greedy_walk(model.world, values.actions, start, crossings)
    if not arrived and isinstance(model.world, GridWorld) and model.world.slip > 0:
        walk, arrived = greedy_walk(model.world, _values_ahead(model.world, solved), start, crossings)
    if not arrived:
        raise NoPlanError(
            f"on the way from {model.describe(start)} to the goal float64 cannot tell one move from another: "
            f"{why_alike(model.gamma)}"
        )
    return walk


def why_alike(gamma: float) -> str:
    """Why moves are too much alike at a gamma, and what to do about it."""
    if 1 - gamma < TOO_NEAR:
        return f"at gamma {gamma} a step costs too little of all there is to lose; choose gamma farther from 1"
    return f"gamma {gamma} fades to nothing; choose gamma nearer to 1"


def climb_values(world: GridWorld, solved: ExactValues) -> NDArray[np.float64]:
    """(S,) what to walk up where moves mostly slip, and aiming at a cell is not the way to get there."""
    ahead = solved.shifted.copy()
    ahead[world.goal] = 1 + 2 * np.abs(ahead).max()
    return ahead


def _values_ahead(world: GridWorld, solved: ExactValues) -> ActionValues:
    """Each move worth what the cell ahead is."""
    ahead = climb_values(world, solved)

    def values(state: int) -> NDArray[np.float64]:
        found: NDArray[np.float64] = ahead[world.successor[state]]
        return found

    return values


def plan_from_run(run: LearningRun, start: int, names: tuple[str, str]) -> Plan:
    """The plan that the learned values give; where they do not lead to the goal, the exact one, and it says so."""
    model = run.model
    model.check_reachable(start)
    if not run.chooses:
        note = f"Note: {run.algorithm} learns what a policy is worth, not what to do, so this plan is the exact one."
        return plan_exactly(model, start, names, exact=run.exact, notes=[note])
    values = learned_plan_values(run)
    walk, arrived = greedy_walk(model.world, values.actions, start)
    if arrived:
        return _plan(model, walk, values, names, ())
    note = (
        f"Note: what {run.algorithm} learned in {len(run.steps)} episodes does not lead there (its best moves go round "
        f"in circles from {model.describe(walk[-1])} on), so this plan is the exact one."
    )
    return plan_exactly(model, start, names, exact=run.exact, notes=[note])


def _plan(model: HybridMDP, walk: list[int], values: PlanValues, names: tuple[str, str], notes: Sequence[str]) -> Plan:
    legs = legs_of(model, walk)
    chooser = None if model.regions is None else Chooser(model, model.regions, values)
    steps = [
        _step(model, walk, leg, following, values, chooser)
        for leg, following in zip(legs, [*legs[1:], None], strict=True)
    ]
    path = tuple(model.cell_of(state) for state in walk) if model.regions else ()
    if model.regions is not None:
        steps = _as_walked(model.regions, steps, legs, path)
    notes = list(notes)
    if isinstance(model.world, GridWorld) and model.world.slip > 0:
        notes.append(
            f"Moves slip with probability {model.world.slip:g}: the path is the one without slips, "
            "the values expect them."
        )
    shortest = int(model.world.steps_to_goal[walk[0]]) if isinstance(model.world, GridWorld) else None
    if values.source == "exact" and shortest is not None and len(walk) - 1 > shortest:
        notes.append(
            f"There is a way of {shortest} moves, but this one is worth more: a diagonal costs more than a straight "
            "move and is discounted as one, and slips count."
        )
    return Plan(
        start=names[0],
        goal=names[1],
        places=tuple(model.region_names[leg.region] for leg in legs),
        steps=tuple(steps),
        path=path,
        length_steps=len(walk) - 1,
        length_m=length_m(model, walk),
        shortest_steps=shortest,
        value=values.plain(values.shifted[walk[0]]) if len(walk) > 1 else 0.0,
        source=values.source,
        notes=tuple(notes),
    )


def _as_walked(regions: RegionMap, steps: Sequence[Step], legs: Sequence[Leg], path: Sequence[Cell]) -> list[Step]:
    """The steps with what a walker needs to know: where to turn, and what there is to see on the way."""
    walked = passages(regions, path)
    doors = [{door for door in (passage.entered_by, passage.left_by) if door is not None} for passage in walked]
    seen = seen_on_stretches(regions, path, [(leg.first, leg.last) for leg in legs], doors)
    return [
        replace(step, side=passage.side, compass=passage.compass, passes=passed)
        for step, passage, passed in zip(steps, walked, seen, strict=True)
    ]


def length_m(model: HybridMDP, walk: Sequence[int]) -> float | None:
    """Length of a walk in metres; None without a map."""
    if model.regions is None:
        return None
    moves = np.diff(model.grid.cells[np.asarray(walk)], axis=0)
    return float(np.hypot(moves[:, 0], moves[:, 1]).sum() * model.regions.grid.resolution_m)


def _step(
    model: HybridMDP, walk: list[int], leg: Leg, following: Leg | None, values: PlanValues, chooser: Chooser | None
) -> Step:  # fmt: skip
    end = leg.last if following is None else following.first
    part = walk[leg.first : end + 1]
    far_m = length_m(model, part)
    place = model.region_names[leg.region]
    if following is None:
        value = values.plain(values.shifted[walk[leg.first]]) if len(part) > 1 else 0.0
        reason = (
            f"the goal is in {place}, {in_steps(len(part) - 1)} on, worth {value:.6g}"
            if len(part) > 1
            else "this is the goal"
        )
        return Step(place, "walk to the goal", place, value, reason, None, None, None, len(part) - 1, far_m)
    to = model.region_names[following.region]
    if chooser is None:
        return _step_without_map(model, walk[leg.first], place, to, len(part) - 1, values)
    door = door_taken(model, chooser.regions, walk[end - 1], walk[end])
    return _step_through(chooser, walk[leg.first], door, following.region, len(part) - 1, far_m)


def _step_through(
    chooser: Chooser, state: int, door: Doorway, to_region: int, steps: int, length_m: float | None
) -> Step:  # fmt: skip
    model, values = chooser.model, chooser.values
    region = int(model.region_of[state])
    place, to = model.region_names[region], model.region_names[to_region]
    choices = chooser.at(state, door)
    taken = next(choice for choice in choices if choice.door is door)
    others = [choice for choice in choices if choice.door is not door]
    value, said = values.plain(taken.shifted), f"go through {door.name} to {to}"
    margin = taken.shifted - others[0].shifted if others else 0.0
    shifted = float(values.shifted[state])
    turns = abs(shifted - taken.shifted) > _off(model, values, shifted, taken.shifted)
    turns |= bool(others) and -margin > _off(model, values, taken.shifted, others[0].shifted)
    free = values.plain(shifted) if turns and values.source == "exact" else None
    if not others:
        back = " without coming back" if chooser.can_come_back(region) else ""
        reason = f"the only way on from {place} to the goal{back}, worth {value if free is None else free:.6g}"
        return Step(place, said, to, value, reason, None, None, None, steps, length_m, free_value=free)
    other = others[0]
    return Step(
        place, said, to, value, _reason(chooser, taken, other, free), _named(model, other),
        values.plain(other.shifted), margin, steps, length_m, free_value=free,
    )  # fmt: skip


def _named(model: HybridMDP, choice: Choice) -> str:
    region = model.region_names[choice.to_region]
    return f"staying in {region}" if choice.door is None else f"{choice.door.name} to {region}"


def _off(model: HybridMDP, values: PlanValues, *shifted: float) -> float:
    """By how much values may be off together."""
    return float(sum(off_of(model.grid, value, values.shift) for value in shifted))


def _reason(chooser: Chooser, taken: Choice, other: Choice, free: float | None) -> str:
    """Why one doorway is taken and not another.

    free: what it is worth where slips may change which doorway it is, or the way leads over the border of another
    region for a moment, if that makes a difference.
    """
    model, values = chooser.model, chooser.values
    margin = taken.shifted - other.shifted
    off = _off(model, values, taken.shifted, other.shifted)
    value, other_value = values.plain(taken.shifted), values.plain(other.shifted)
    assert taken.door is not None
    than = f"{_named(model, other)} ({other_value:.6g})"
    if free is not None:
        more = f"{abs(margin):.3g} {'more' if margin > 0 else 'less'} than"
        if abs(margin) <= off:
            more = f"to within {off:.1g} as much as"
        shut = "the others shut to slips, too," if model.grid.slip > 0 else "the others shut,"
        beside = than if other.door is None else f"bound to {than}"
        return f"worth {free:.6g}; bound to {taken.door.name}, {shut} {value:.6g}, {more} {beside}"
    if abs(margin) <= off:
        alike = f"to within {off:.1g} as much" if model.grid.slip > 0 else "exactly as much"
        return f"worth {value:.6g}, {alike} as {_named(model, other)}"
    if margin > 0:
        return f"worth {value:.6g}, which is {margin:.3g} more than the next best, {than}"
    return (
        f"worth {value:.6g} by what was learned; {_named(model, other)} would be worth {-margin:.3g} more "
        f"({other_value:.6g}), a difference that learning has not settled"
    )


def _step_without_map(model: HybridMDP, state: int, place: str, to: str, steps: int, values: PlanValues) -> Step:
    """A step of a model without doors: its reason compares the first primitive action with the next best."""
    q = values.actions(state)
    best, second = np.argsort(-q, kind="stable")[:2] if len(q) > 1 else (0, None)
    names = model.world.action_names
    value = values.plain(q[best])
    if second is None:
        return Step(place, f"move to {to}", to, value, "the only action there is", None, None, None, steps, None)
    margin = float(q[best] - q[second])
    reason = (
        f"starting with {names[best]!r}, worth {value:.6g}, {margin:.3g} more than the next best, {names[second]!r}"
    )
    return Step(place, f"move to {to}", to, value, reason, names[second], values.plain(q[second]), margin, steps, None)
