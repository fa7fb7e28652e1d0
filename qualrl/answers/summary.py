"""The best policy in brief: for each region the doorway to leave it by, the cells for which another is better, and
where the choice matters most.

S states.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.answer import Answer, first_of
from qualrl.answers.depth import Depth
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.choices import Chooser
from qualrl.planning.exits import GOAL_HERE, NO_WAY, exits
from qualrl.planning.on_the_way import compass
from qualrl.planning.values import exact_plan_values
from qualrl.solving.exact import exact_values
from qualrl.spatial.occupancy_grid import Cell, OccupancyGrid
from qualrl.spatial.region_map import RegionMap

MOST_NAMED = 3
"""So many exceptions of a region, and regions in which the choice matters most, are put in words; JSON has all."""
MOST_CLOSED = 12
"""So many regions without a way to the goal are named."""
OFF_CENTRE = 0.25
"""Cells lie on one side of their region if their centroid is off the region's by this share of its cells' typical
distance from there (root mean square)."""
ROUNDING = 1e-9
"""Shifted values that differ by less than this share of them are alike."""


@dataclass(frozen=True)
class Exit:
    """What to do in some cells of a region."""

    door: str | None
    """The doorway to leave by; None where there is none to be taken, and ``words`` say why."""
    to: str | None
    words: str
    cells: int
    share: float
    """Of the region's cells."""
    side: str | None
    """On which side of their region they lie by their centroid, world y being north; None for no side."""
    rows: tuple[int, int]
    columns: tuple[int, int]
    """First and last row and column."""

    def where(self, depth: Depth) -> str:
        """How many cells, and where they are."""
        side = f" in its {self.side}" if self.side else ""
        if depth != Depth.NUMBERS:
            return f"in some cells{side}"
        share = f"{100 * self.share:.2g} %"
        return f"{_cells(self.cells)} ({share}){side} ({_span('row', self.rows)}, {_span('column', self.columns)})"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "door": self.door, "to": self.to, "words": self.words, "cells": self.cells, "share": self.share,
            "side": self.side, "rows": list(self.rows), "columns": list(self.columns),
        }  # fmt: skip


@dataclass(frozen=True)
class Gap:
    """By how much the best doorway of a region is worth more than the second best."""

    mean: float
    """Over the region's cells from which at least two doorways lead on."""
    largest: float
    at: Cell
    """The cell where it is largest: mostly beside a doorway, where any other is a detour."""

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"mean": self.mean, "largest": self.largest, "at": list(self.at)}


@dataclass(frozen=True)
class RegionRule:
    """What the policy does in a region."""

    name: str
    cells: int
    steps_to_goal: int | None
    """From its nearest cell; None where no way leads there."""
    exits: tuple[Exit, ...]
    """What to do in most cells first; the others are exceptions."""
    gap: Gap | None
    """None where at most one doorway leads on to the goal, and where the goal is."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        rule, *others = self.exits
        parts = [f"{self.name}{depth.at_numbers(f' ({_cells(self.cells)})')}: {rule.words}"]
        parts += [f"except {other.where(depth)}: {other.words}" for other in others[:MOST_NAMED]]
        if rest := others[MOST_NAMED:]:
            counted = f"{_cells(sum(other.cells for other in rest))} more, in {len(rest)} other ways"
            parts.append(f"and except {depth.at_numbers(counted, 'in other cells, in other ways')}")
        return "; ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "region": self.name, "cells": self.cells, "steps_to_goal": self.steps_to_goal,
            "exits": [found.to_dict() for found in self.exits], "gap": None if self.gap is None else self.gap.to_dict(),
        }  # fmt: skip


@dataclass(frozen=True)
class Summary(Answer):
    """The answer."""

    goal: str
    gamma: float
    slip: float
    rules: tuple[RegionRule, ...]
    """Of all regions, the nearest to the goal first, those without a way there last."""

    @property
    def important(self) -> tuple[RegionRule, ...]:
        """The regions in which the second-best doorway loses something, those where it loses most on average first."""
        felt = [rule for rule in self.rules if rule.gap is not None and rule.gap.mean > 0]
        return tuple(sorted(felt, key=lambda rule: -rule.gap.mean if rule.gap else 0.0))

    def lines(self, depth: Depth) -> Iterator[str]:
        """A line a region."""
        slip = f", moves slipping{depth.at_numbers(f' with probability {self.slip:g}')}" if self.slip else ""
        best = f"Best{depth.at_numbers(f' at gamma {self.gamma:.12g}')}{slip}"
        first = depth.at_signs(", what is nearest to it first") if len(self.rules) > 1 else ""
        yield f"{best}, wherever one is, to reach {self.goal}{first}:"
        yield from (rule.in_words(depth) for rule in self.rules if rule.steps_to_goal is not None)
        closed = [rule for rule in self.rules if rule.steps_to_goal is None]
        if closed:
            yield f"No way leads to the goal from {_closed_in_words(closed, depth)}."
        if self.important and depth != Depth.NAMES:
            told = [
                rule.name + depth.at_numbers(f" ({rule.gap.mean:.3g} on average, {rule.gap.largest:.3g} at most)")
                for rule in self.important[:MOST_NAMED]
                if rule.gap
            ]
            yield f"By the second-best doorway most is lost in {', '.join(told)}."

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "summary", "to": self.goal, "gamma": self.gamma, "slip": self.slip,
            "regions": [rule.to_dict() for rule in self.rules],
            "important": [rule.name for rule in self.important],
        }  # fmt: skip


def summary(model: HybridMDP, goal: str) -> Summary:
    """Sum up the best policy, region by region.  goal: what to call it."""
    if model.regions is None:
        raise SettingError("a model without a map has no doorways")
    exact = exact_values(model.world)
    leaves = exits(model, model.regions, exact)
    chooser = Chooser(model, model.regions, exact_plan_values(model, exact))
    rules = [_rule(model, model.regions, leaves, chooser, region) for region in range(len(model.region_names))]
    rules.sort(key=lambda rule: math.inf if rule.steps_to_goal is None else rule.steps_to_goal)
    return Summary(goal, model.gamma, model.grid.slip, tuple(rules))


def _rule(
    model: HybridMDP, regions: RegionMap, leaves: NDArray[np.int32], chooser: Chooser, region: int
) -> RegionRule:  # fmt: skip
    states = chooser.states[region]
    steps = model.grid.steps_to_goal[states]
    codes, counts = np.unique(leaves[states], return_counts=True)
    found = [
        _exit(model, regions, region, states, int(code), states[leaves[states] == code])
        for code in codes[np.argsort(-counts, kind="stable")]
    ]
    nearest = int(steps[steps >= 0].min(initial=2**31 - 1)) if (steps >= 0).any() else None
    gap = None if nearest is None or nearest == 0 else _gap(model, chooser, region)
    return RegionRule(model.region_names[region], len(states), nearest, tuple(found), gap)


def _exit(
    model: HybridMDP, regions: RegionMap, region: int, states: NDArray[np.int64], code: int, cells: NDArray[np.int64]
) -> Exit:  # fmt: skip
    door = to = None
    if code >= 0:
        passed = regions.doorways[code]
        door, to = passed.name, model.region_names[passed.pair[passed.pair[0] == region]]
        words = f"go through {door} to {to}"
    elif code == GOAL_HERE:
        words = "walk to the goal, which is here"
    elif code == NO_WAY:
        words = "no way leads to the goal"
    else:
        words = "values fade before the goal, so that they do not tell the way"
    at = model.grid.cells[cells]
    (top, left), (bottom, right) = at.min(axis=0).tolist(), at.max(axis=0).tolist()
    side = _side(regions.grid, model.grid.cells[states], at) if len(cells) < len(states) else None
    share = len(cells) / len(states)
    return Exit(door, to, words, len(cells), share, side, (top, bottom), (left, right))


def _side(grid: OccupancyGrid, region: NDArray[np.int32], part: NDArray[np.int32]) -> str | None:
    """On which side of a region (N, 2) a part of its cells (M, 2) lies."""
    middle, centroid = region.mean(axis=0), part.mean(axis=0)
    typical_m = math.sqrt(((region - middle) ** 2).sum(axis=1).mean()) * grid.resolution_m
    (x_m, y_m), (from_x_m, from_y_m) = grid.to_world(*centroid.tolist()), grid.to_world(*middle.tolist())
    east_m, north_m = x_m - from_x_m, y_m - from_y_m
    if math.hypot(east_m, north_m) < OFF_CENTRE * typical_m:
        return None
    return compass(east_m, north_m)


def _gap(model: HybridMDP, chooser: Chooser, region: int) -> Gap | None:
    doors, values = chooser.throughout(region)
    if len(doors) < 2:
        return None
    second, best = np.sort(values, axis=0)[-2:]
    choice = second > 0
    if not choice.any():
        return None
    gap = np.where(choice & (best - second > ROUNDING * best), best - second, 0.0)
    most = int(gap.argmax())
    return Gap(
        float(gap[choice].mean()), float(gap[most]), model.cell_of(int(chooser.states[region][most]))
    )  # fmt: skip


def _closed_in_words(closed: Sequence[RegionRule], depth: Depth) -> str:
    """Regions from which no way leads on."""
    names = [rule.name for rule in closed]
    if depth != Depth.NUMBERS:
        return first_of(names, MOST_CLOSED)
    more = f" and {len(closed) - MOST_CLOSED} more" if len(closed) > MOST_CLOSED else ""
    return f"{', '.join(names[:MOST_CLOSED])}{more} ({_cells(sum(rule.cells for rule in closed))})"


def _span(what: str, ends: tuple[int, int]) -> str:
    return f"{what} {ends[0]}" if ends[0] == ends[1] else f"{what}s {ends[0]} to {ends[1]}"


def _cells(count: int) -> str:
    return f"{count} cell{'' if count == 1 else 's'}"
