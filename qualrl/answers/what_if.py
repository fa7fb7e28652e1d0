"""What a change does to a plan: closed doorways, an opened wall, other numbers; and where it begins to matter."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.answer import Answer
from qualrl.answers.changed_model import Change, with_numbers
from qualrl.answers.depth import Depth
from qualrl.answers.trying import Trying, trying
from qualrl.answers.ways import Way, course, longer, way_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.exits import ASTRAY, exits
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.plan_value import Contrast, contrast
from qualrl.solving.exact import ExactValues, exact_values

NUMBERS = ("gamma", "slip", "step_reward", "goal_reward")
"""Numbers of a world that may be changed little by little."""
NO_WAY_LEFT = "no way"
GAINED = 1e-9
"""Values that rise by a smaller share rise by rounding."""
MOST_NAMED = 3
"""So many regions are named; JSON has all."""
HALVINGS = 14
"""An interval becomes 16,384 times as narrow."""


@dataclass(frozen=True)
class Switch:
    """The first change of the best way that was found as a number goes from what it was to what it is to be."""

    name: str
    same: float
    """A value of it at which the best way is the one from before."""
    other: float
    """One close to it at which the best way is another."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        low, high = sorted((self.same, self.other))
        between = f"first changes between {self.name} {low:.6g} and {high:.6g}; both were solved exactly"
        grows = depth.from_signs(f" as it {'grows' if self.other > self.same else 'falls'}")
        return f"The best way {depth.at_numbers(between, f'changes with {self.name}{grows}')}."

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"name": self.name, "same": self.same, "other": self.other}


@dataclass(frozen=True)
class Turned:
    """How many cells of a region are left by another doorway than before."""

    region: str
    cells: int
    cut_off: int
    """Of these, cells from which no way is left."""
    of: int
    """Cells of the region."""

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"region": self.region, "cells": self.cells, "cut_off": self.cut_off, "of": self.of}


@dataclass(frozen=True)
class WhatIf(Answer):
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    changes: tuple[Change, ...]
    before: Way
    after: Way | None
    """None where no way leads to the goal any more."""
    turned: tuple[Turned, ...]
    """Regions from some cells of which the best way leaves by another doorway, or has none left, most cells first."""
    is_comparable: bool
    """Whether values before and after are of the same gamma."""
    chance: float | None
    """The probability, asked about, that closed doorways are open after all."""
    trying: Trying | None
    """Whether to try the closed doorways when they may be open; None where the best way passes none of them."""
    switch: Switch | None
    """None unless one number alone is changed, and the best way with it."""
    contrast: Contrast | None
    """The ways before and after for every gamma, where gamma alone is changed, and no move slips."""

    @property
    def is_same_way(self) -> bool:
        """Whether the best way leads through the same places and doorways as before."""
        return self.after is not None and _course_of(self.before) == _course_of(self.after)

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        yield f"Now from {self.start} to {self.goal}: {self.before.with_worth(depth)}."
        yield f"With {', '.join(change.in_words(depth) for change in self.changes)}: {self._after_in_words(depth)}."
        yield from self._turned_in_words(depth)
        if self.trying is not None:
            yield from self.trying.lines(depth)
        elif self.chance is not None:
            why = "no way leads round" if self.after is None else "the best way does not pass what is closed"
            yield f"Whether to go and see is no question: {why}."
        if self.switch is not None:
            yield self.switch.in_words(depth)
        if self.contrast is not None and depth != Depth.NAMES:
            words = self.contrast.in_words("the old one", "the new one", depth == Depth.NUMBERS)
            yield f"Of these two ways, {words}."

    def _after_in_words(self, depth: Depth) -> str:
        if self.after is None:
            return f"no way leads from {self.start} to {self.goal}"
        difference = self.after.value - self.before.value
        worth = f"{abs(difference):.3g} {'more' if difference >= 0 else 'less'}"
        worth = depth.at_numbers(worth, self.after.worth_beside(self.before))
        if not self.is_comparable:
            worth = "which is of another gamma" if depth == Depth.NUMBERS else "what it is worth is of another gamma"
        if self.is_same_way and self.after.steps == self.before.steps:
            value = depth.at_numbers(f", worth {self.after.value:.6g}")
            return f"the same way{value}{depth.from_signs(f', {worth}')}"
        beside = depth.from_signs(f", {worth}; {longer(self.after, self.before, depth)}")
        return f"{self.after.with_worth(depth)}{beside}"

    def _turned_in_words(self, depth: Depth) -> list[str]:
        turned = [(of.region, of.cells - of.cut_off, of.of) for of in self.turned]
        lost = [(of.region, of.cut_off, of.of) for of in self.turned]
        words = (
            _counted(turned, "the best way leaves its region otherwise than before", depth),
            _counted(lost, "no way is left", depth),
        )
        return [line for line in words if line] or ["From every cell the best way leaves its region as before."]

    def facts(self) -> dict[str, Any]:
        """See Answer; with the formulas and the certificates."""
        return {
            "question": "what-if", "from": self.start, "to": self.goal,
            "changes": [change.words for change in self.changes],
            "before": self.before.to_dict(), "after": None if self.after is None else self.after.to_dict(),
            "is_comparable": self.is_comparable, "chance": self.chance,
            "turned": [turned.to_dict() for turned in self.turned],
            "trying": None if self.trying is None else self.trying.to_dict(),
            "switch": None if self.switch is None else self.switch.to_dict(),
            "contrast": None if self.contrast is None else self.contrast.to_dict("before", "after"),
        }  # fmt: skip


def _counted(counts: Sequence[tuple[str, int, int]], what: str, depth: Depth) -> str:
    """Something that is so of some cells of some regions; empty for no cells."""
    felt = sorted((of for of in counts if of[1]), key=lambda of: -of[1])
    cells = sum(count for _, count, _ in felt)
    if not cells:
        return ""
    told = [f"{depth.at_numbers(f'{count} of {total} ')}in {region}" for region, count, total in felt[:MOST_NAMED]]
    if len(felt) > MOST_NAMED:
        told.append(depth.at_numbers(f"{sum(count for _, count, _ in felt[MOST_NAMED:])} ") + "elsewhere")
    first = depth.at_signs(", most cells first") if len(felt) > 1 else ""
    some = depth.at_numbers("1 cell" if cells == 1 else f"{cells} cells", "some cells")
    return f"From {some} {what}{first}: {', '.join(told)}."


def what_if(
    before: HybridMDP, after: HybridMDP, starts: tuple[int, int], names: tuple[str, str], changes: tuple[Change, ...],
    chance: float | None = None,
) -> WhatIf:  # fmt: skip
    """Ask what a change does to the plan from a state, whose numbers in the two models are ``starts``.

    names: what to call start and goal.  chance: the probability that doorways closed in ``after``
    are open after all.  Raises NoPlanError where no way leads to the goal before, SettingError without a change.
    """
    if not changes:
        raise SettingError("say what to change: a doorway to close, a wall to open, or a setting")
    before.check_reachable(starts[0])
    exact = exact_values(before.world)
    walk = exact_walk(before, exact, starts[0])
    way = way_of(before, [walk], float(exact.value[starts[0]]))
    exact_after = exact_values(after.world)
    turned = _turned(before, after, exact, exact_after)
    if not after.can_reach[starts[1]]:
        return WhatIf(*names, changes, way, None, turned, before.gamma == after.gamma, chance, None, None, None)
    walk_after = exact_walk(after, exact_after, starts[1])
    way_after = way_of(after, [walk_after], float(exact_after.value[starts[1]]))
    number = next((name for name in NUMBERS if before.grid.differs_in(after.grid) == {name}), None)
    compared = None
    if number == "gamma" and before.grid.slip == 0 and _course_of(way) != _course_of(way_after):
        compared = contrast(course(before, walk), course(after, walk_after))
    return WhatIf(
        *names, changes, way, way_after, turned, before.gamma == after.gamma, chance,
        trying(before, after, walk, walk_after, exact_after, chance, exact),
        None if number is None else _switch(before, starts[0], number, getattr(after.grid, number), way), compared,
    )  # fmt: skip


def _turned(before: HybridMDP, after: HybridMDP, exact: ExactValues, exact_after: ExactValues) -> tuple[Turned, ...]:
    """Regions whose cells, those that are on both maps, are left otherwise; () for maps of different size.

    Of equally good ways that counts which a plan takes; but where a wall alone was opened and a cell gained nothing,
    its old way is as good as ever.
    """
    if before.grid.free.shape != after.grid.free.shape:
        return ()
    first, second = _exit_names(before, exact), _exit_names(after, exact_after)
    both = before.grid.free & after.grid.free
    here, there = before.grid.state_of[both], after.grid.state_of[both]
    changed = first[here] != second[there]
    if before.grid.differs_in(after.grid) == {"free"}:
        changed &= exact_after.shifted[there] > exact.shifted[here] * (1 + GAINED)
    cut_off = changed & (second[there] == NO_WAY_LEFT)
    size = len(before.region_names)
    cells, lost, of = (
        np.bincount(before.region_of[states], minlength=size)
        for states in (here[changed], here[cut_off], np.arange(len(before)))
    )
    order = np.argsort(-cells, kind="stable")[: np.count_nonzero(cells)]
    return tuple(Turned(before.region_names[at], int(cells[at]), int(lost[at]), int(of[at])) for at in order.tolist())


def _exit_names(model: HybridMDP, exact: ExactValues) -> NDArray[np.str_]:
    """(S,) the doorway by which the best way leaves the region, or that it does not, or that there is none."""
    assert model.regions is not None
    names = ["values fade", NO_WAY_LEFT, "goal here", *(door.name for door in model.regions.doorways)]
    return np.array(names)[exits(model, model.regions, exact) - ASTRAY]


def _switch(model: HybridMDP, start: int, name: str, to: float, way: Way) -> Switch | None:
    """Halve the interval between a number and another one, at whose end the best way is another, again and again."""

    def is_same(number: float) -> bool:
        changed = with_numbers(model, **{name: number})
        exact = exact_values(changed.world)
        return _course_of(way_of(changed, [exact_walk(changed, exact, start)], 0.0)) == _course_of(way)

    if is_same(to):
        return None
    same, other = getattr(model.grid, name), to
    for _ in range(HALVINGS):
        middle = (same + other) / 2
        same, other = (middle, other) if is_same(middle) else (same, middle)
    return Switch(name, same, other)


def _course_of(way: Way) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return way.places, way.doors
