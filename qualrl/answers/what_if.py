"""What a change does to a plan: closed doorways, an opened wall, other numbers; and where it begins to matter."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.answer import Answer
from qualrl.answers.changed_model import Change, with_numbers
from qualrl.answers.depth import Depth
from qualrl.answers.trying import Trying, trying
from qualrl.answers.ways import Way, course, longer, way_of, worth_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.exits import NO_WAY, exits
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.plan_value import Contrast, contrast, told_apart
from qualrl.solving.exact import ExactValues, exact_values, shifted_rewards
from qualrl.spatial.region_map import RegionMap

NUMBERS = ("gamma", "slip", "step_reward", "goal_reward")
"""Numbers of a world that may be changed little by little."""
NO_WAY_THERE = "no way leads there"
SAME_EXIT = "the best way leaves its region as before"
GAINED = 1e-9
"""Values that rise by a smaller share rise by rounding."""
MOST_NAMED = 3
"""So many regions are named; JSON has all."""
HALVINGS = 14
"""An interval becomes 16,384 times as narrow."""


@dataclass(frozen=True)
class Switch:
    """A change of the best way as a number goes from what it was to what it is to be; there may be more of them."""

    name: str
    same: float
    """A value of it at which the best way is the one from before."""
    other: float
    """One close to it at which the best way is another."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        low, high = sorted((self.same, self.other))
        low_text, high_text = told_apart((low, high))
        between = f"changes between {self.name} {low_text} and {high_text}, which were solved, and may change elsewhere"
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
class Reach:
    """From how many cells a way leads to the goal."""

    arriving: int
    cells: int
    """Of the whole map."""

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"arriving": self.arriving, "cells": self.cells}


@dataclass(frozen=True)
class WhatIf(Answer):
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    gamma: float
    """Before."""
    changes: tuple[Change, ...]
    before: Way | None
    """None where no way leads to the goal as it is."""
    after: Way | None
    """None where no way leads to the goal with the changes."""
    reach: tuple[Reach, Reach]
    """Before and after."""
    turned: tuple[Turned, ...] | None
    """Regions from some cells of which the best way leaves by another doorway, or has none left, most cells first; None
    where the maps are of different size."""
    is_opened: bool
    """Whether walls are opened and nothing else is changed; then only cells that gain by it count as turned."""
    is_comparable: bool
    """Whether values before and after are of the same gamma."""
    chance: float | None
    """The probability, asked about, that closed doorways are open after all."""
    trying: Trying | None
    """Whether to try the closed doorways when they may be open; None where the best way passes none of them, where none
    leads round, and where moves slip."""
    switch: Switch | None
    """None unless one number alone is changed, and the best way with it."""
    contrast: Contrast | None
    """The ways before and after for every gamma, where gamma alone is changed, and no move slips."""

    @property
    def is_same_way(self) -> bool:
        """Whether the best way leads through the same places and doorways as before."""
        if self.before is None or self.after is None:
            return False
        return _course_of(self.before) == _course_of(self.after)

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        now = NO_WAY_THERE if self.before is None else self.before.with_worth(depth)
        yield f"Now from {self.start} to {self.goal}{at}: {now}."
        yield f"With {', '.join(change.in_words(depth) for change in self.changes)}: {self._after_in_words(depth)}."
        if self.before is None and self.after is None:
            yield self._out_of_reach(depth)
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
            still = "still " if self.before is None else ""
            return f"{still}no way leads from {self.start} to {self.goal}"
        if self.before is None:
            return f"{self.after.with_worth(depth)}"
        difference = self.after.worth.beside(self.before.worth)
        worth = self.after.worth.alike(self.before.worth)
        if difference:
            worth = f"{abs(difference):.3g} {'more' if difference > 0 else 'less'}"
        worth = depth.at_numbers(worth, self.after.worth_beside(self.before))
        if not self.is_comparable:
            worth = "which is of another gamma" if depth == Depth.NUMBERS else "what it is worth is of another gamma"
        if self.is_same_way and self.after.steps == self.before.steps:
            value = depth.at_numbers(f", worth {self.after.value:.6g}")
            return f"the same way{value}{depth.from_signs(f', {worth}')}"
        beside = depth.from_signs(f", {worth}; {longer(self.after, self.before, depth)}")
        return f"{self.after.with_worth(depth)}{beside}"

    def _out_of_reach(self, depth: Depth) -> str:
        """From where a way leads, if none does from the start."""
        before, after = (f"from {of.arriving} of {of.cells} cells" for of in self.reach)
        where = f"{after} with that and without" if before == after else f"{after} with that, {before} without"
        there = depth.at_numbers(where, "from other cells only")
        return f"{self.goal} can be reached {there}; 'qualrl why-unreachable' tells what is in the way."

    def _turned_in_words(self, depth: Depth) -> list[str]:
        if self.turned is None:
            return ["The map is of another size, so what its cells are left by is not set beside what it was."]
        turned = [(of.region, of.cells - of.cut_off, of.of) for of in self.turned]
        lost = [(of.region, of.cut_off, of.of) for of in self.turned]
        words = (
            _counted(turned, "the best way leaves its region otherwise than before", depth),
            _counted(lost, "no way is left", depth),
        )
        same = "to leave its region as before is as good as any way" if self.is_opened else SAME_EXIT
        return [line for line in words if line] or [f"From every cell {same}."]

    def facts(self) -> dict[str, Any]:
        """See Answer; with the formulas and the certificates."""
        return {
            "question": "what-if", "from": self.start, "to": self.goal,
            "gamma": self.gamma, "changes": [change.words for change in self.changes],
            "before": None if self.before is None else self.before.to_dict(),
            "after": None if self.after is None else self.after.to_dict(),
            "reach": [of.to_dict() for of in self.reach],
            "is_comparable": self.is_comparable, "chance": self.chance,
            "turned": None if self.turned is None else [turned.to_dict() for turned in self.turned],
            "is_opened": self.is_opened,
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
    chance: float | None = None, unclosed: HybridMDP | None = None,
) -> WhatIf:  # fmt: skip
    """Ask what a change does to the plan from a state, whose numbers in the two models are ``starts``.

    names: what to call start and goal.  chance: the probability that doorways closed in ``after``
    are open after all; unclosed: the model after all other changes, if doorways are closed.
    Raises SettingError without a change.
    """
    if not changes:
        raise SettingError("say what to change: a doorway to close, a wall to open, or a setting")
    exact, exact_after = exact_values(before.world), exact_values(after.world)
    is_opened = before.grid.differs_in(after.grid) == {"free"} and before.grid.free.shape == after.grid.free.shape
    is_opened = is_opened and not (before.grid.free & ~after.grid.free).any()
    turned, is_comparable = _turned(before, after, exact, exact_after, is_opened), before.gamma == after.gamma
    walk, way = _walked(before, exact, starts[0])
    walk_after, way_after = _walked(after, exact_after, starts[1])
    tried = compared = switch = None
    if way is not None and way_after is not None:
        number = next((name for name in NUMBERS if before.grid.differs_in(after.grid) == {name}), None)
        if number == "gamma" and before.grid.slip == 0 and _course_of(way) != _course_of(way_after):
            compared = contrast(course(before, walk), course(after, walk_after))
        switch = None if number is None else _switch(before, walk, number, getattr(after.grid, number), way)
        if unclosed is not None:
            open_exact = exact if unclosed is before else exact_values(unclosed.world)
            open_walk = walk if unclosed is before else exact_walk(unclosed, open_exact, starts[1])
            tried = trying(unclosed, after, open_walk, walk_after, exact_after, chance, open_exact)
    reach = _reach(before), _reach(after)
    return WhatIf(
        *names, before.gamma, changes, way, way_after, reach, turned, is_opened, is_comparable, chance, tried, switch,
        compared,
    )  # fmt: skip


def _reach(model: HybridMDP) -> Reach:
    return Reach(int(model.can_reach.sum()), len(model))


def _walked(model: HybridMDP, exact: ExactValues, start: int) -> tuple[list[int], Way | None]:
    """The best way from a state; None where none leads to the goal."""
    if not model.can_reach[start]:
        return [], None
    walk = exact_walk(model, exact, start)
    return walk, way_of(model, [walk], exact.shifted[start], exact.shift)


def _turned(
    before: HybridMDP, after: HybridMDP, exact: ExactValues, exact_after: ExactValues, is_opened: bool
) -> tuple[Turned, ...] | None:
    """Regions whose cells, those that are on both maps, are left otherwise; None for maps of different size.

    Of equally good ways that counts which a plan takes; but where a wall alone was opened and a cell gained nothing,
    its old way is as good as ever.
    """
    assert before.regions is not None
    assert after.regions is not None
    if before.grid.free.shape != after.grid.free.shape:
        return None
    first, second = exits(before, before.regions, exact), exits(after, after.regions, exact_after)
    second = np.where(second >= 0, _same_doorways(before.regions, after.regions)[np.maximum(second, -1)], second)
    both = before.grid.free & after.grid.free
    here, there = before.grid.state_of[both], after.grid.state_of[both]
    changed = first[here] != second[there]
    if is_opened:
        changed &= exact_after.shifted[there] > exact.shifted[here] * (1 + GAINED)
    cut_off = changed & (second[there] == NO_WAY)
    size = len(before.region_names)
    cells, lost, of = (
        np.bincount(before.region_of[states], minlength=size)
        for states in (here[changed], here[cut_off], np.arange(len(before)))
    )
    order = np.argsort(-cells, kind="stable")[: np.count_nonzero(cells)]
    return tuple(Turned(before.region_names[at], int(cells[at]), int(lost[at]), int(of[at])) for at in order.tolist())


def _same_doorways(before: RegionMap, after: RegionMap) -> NDArray[np.int64]:
    """(D + 1,) of each doorway afterwards the one before with which it shares most cells, whatever both are called.

    Others have numbers of their own; one more stands for none.
    """
    at = {cell: number for number, door in enumerate(before.doorways) for cell in map(tuple, door.cells.tolist())}
    found = []
    for number, door in enumerate(after.doorways):
        shared = Counter(at[cell] for cell in map(tuple, door.cells.tolist()) if cell in at)
        found.append(shared.most_common(1)[0][0] if shared else len(before.doorways) + number)
    return np.array([*found, -1], np.int64)


def _switch(model: HybridMDP, walk: Sequence[int], name: str, to: float, way: Way) -> Switch | None:
    """Halve the interval between a number and another one, at whose end the best way is another, again and again."""

    def is_same(number: float) -> bool:
        """Whether the way is as good as any: where moves slip, whether it is the one that is taken."""
        changed = with_numbers(model, **{name: number})
        exact = exact_values(changed.world)
        if changed.grid.slip == 0:
            worth = worth_of(changed.grid, _worth_along(changed, walk, exact.shift), exact.shift)
            return worth.beside(worth_of(changed.grid, exact.shifted[walk[0]], exact.shift)) >= 0
        return _course_of(way_of(changed, [exact_walk(changed, exact, walk[0])], 0.0)) == _course_of(way)

    if is_same(to):
        return None
    same, other = getattr(model.grid, name), to
    for _ in range(HALVINGS):
        middle = (same + other) / 2
        same, other = (middle, other) if is_same(middle) else (same, middle)
    return Switch(name, same, other)


def _worth_along(model: HybridMDP, walk: Sequence[int], shift: float) -> float:
    """What a walk is worth, shifted: from its end, so that the digits stay."""
    rewards = [stretch.reward for stretch in course(model, walk).stretches for _ in range(stretch.steps)]
    if not rewards:
        return shift
    worth = rewards.pop() + shift
    for reward in shifted_rewards(np.array(rewards), shift, model.gamma)[::-1].tolist():
        worth = reward + model.gamma * worth
    return worth


def _course_of(way: Way) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return way.places, way.doors
