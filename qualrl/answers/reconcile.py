"""The smallest change of a map under which the plan that somebody expects would be best.

What may change is which regions are joined: a doorway closed, or a wall opened where two places that are to follow
each other have no doorway.  Openings are what the expected plan cannot do without; the closings are found by search.
A set of closings that makes the expected plan best must close some doorway of every better way, so only doorways of
the best way so far are tried.  Where moves slip, a value hangs on doorways beside its way too, so all that may be
reached are tried, and the plan that is best is told by the regions that it passes if no move slips.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np

from qualrl.answers.answer import Answer
from qualrl.answers.changed_model import Change, with_opened
from qualrl.answers.depth import Depth
from qualrl.answers.ways import Way, longer, way_of
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import exact_values

MOST_SOLVED = 1000
"""Models that are solved at most to find the smallest set of closings."""

MOST_SOLVED_SLIPPING = 60
"""The same where moves slip, and each takes longer."""

Doors = frozenset[str]


@dataclass(frozen=True)
class Reconciled(Answer):
    """The answer."""

    start: str
    goal: str
    gamma: float
    expected: tuple[str, ...]
    best: Way | None
    """As things are; None where no way leads to the goal."""
    own: Way
    """The best way along the expected places, walls opened where it needs that."""
    opened: tuple[Change, ...]
    closed: tuple[str, ...]
    """Doorways to close."""
    slips: bool
    """Whether moves slip."""
    is_smallest: bool
    """Whether no smaller set of closings would do; else none can be left out of this one, but others were not tried."""
    then: Way | None = None
    """The best way along the expected places after that, where ``own`` passes what is closed."""

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        changes = [change.in_words(depth) for change in self.opened]
        opened = f" with {', '.join(changes)}" if changes else ""
        beside = ""
        if self.best is not None:
            beside = depth.at_signs(f", {self.own.worth_beside(self.best)}; {longer(self.own, self.best, depth)}")
        at = depth.at_numbers(f" at gamma {self.gamma:.12g}")
        yield f"Best from {self.start} to {self.goal}{at}: {self._best_in_words(depth)}."
        yield f"Expected: {self.own.with_worth(depth)}{opened}{beside}."
        if self.slips and depth != Depth.NAMES:
            yield "Moves slip: a plan is told by the places that it passes if none does, and its value counts slips."
        if not self.opened and not self.closed:
            yield f"The expected plan is best already{depth.from_signs(', or as good as any')}."
            return
        changes += [f"{name} closed" for name in self.closed]
        yield f"It would be best with {', '.join(changes)}."
        if self.then is not None:
            yield f"The way there is then another: {self.then.with_worth(depth)}."
        if self.closed and self.is_smallest and depth != Depth.NAMES:
            tried = "all that may be reached" if self.slips else "those of every better way"
            yield f"No smaller set of closed doorways would do: {tried} were tried."
        elif self.closed and not self.is_smallest:
            undecided = depth.from_signs("; whether a smaller set would do is undecided")
            yield f"None of these closings can be left out{undecided}."

    def _best_in_words(self, depth: Depth) -> str:
        return "no way leads there" if self.best is None else self.best.with_worth(depth)

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "reconcile", "from": self.start, "to": self.goal, "gamma": self.gamma,
            "expected": list(self.expected), "best": None if self.best is None else self.best.to_dict(),
            "own": self.own.to_dict(), "then": None if self.then is None else self.then.to_dict(),
            "opened": [change.words for change in self.opened],
            "closed": list(self.closed), "slips": self.slips, "smallest": self.is_smallest,
        }  # fmt: skip


def reconcile(model: HybridMDP, start: int, names: tuple[str, str], expected: Sequence[str]) -> Reconciled:
    """Ask what would have to change for a plan through some regions, in their order and no others, to be best.

    names: what to call start and goal.  Raises UnknownNameError, SettingError for places that no best plan passes so,
    and NoPlanError where no wall can be opened.
    """
    _check(model, start, expected)
    best = _best(model, start) if model.can_reach[start] else None
    opened, changed, at = list[Change](), model, start
    for pair in pairwise(expected):
        if not _doors_between(changed, [pair]):
            changed, at, change = with_opened(changed, pair, at)
            opened.append(change)
    search = _Search(changed, at, tuple(expected))
    own = search.own(frozenset())
    if own is None:
        raise NoPlanError(
            f"no way leads from {names[0]} to {names[1]} through {', '.join(expected)} alone: a doorway between two "
            "of them leads nowhere; expect more places"
        )
    if not opened and best is not None and best.places == own.places:
        own = best  # with all other doorways open, too
    closed, is_smallest = search.closings()
    then = search.own(closed) if closed & set(own.doors) else None
    return Reconciled(
        *names, model.gamma, tuple(expected), best, own, tuple(opened), tuple(sorted(closed)), model.grid.slip > 0,
        is_smallest, then,
    )  # fmt: skip


def _check(model: HybridMDP, start: int, expected: Sequence[str]) -> None:
    assert model.regions is not None
    for name in expected:
        if name not in model.region_names:
            raise UnknownNameError(model.regions.why_not(name, "no region", model.region_names))
    ends = [model.region_names[model.region_of[state]] for state in (start, model.grid.goal)]
    if [expected[0], expected[-1]] != ends:
        raise SettingError(f"a plan from {ends[0]} to {ends[1]} begins and ends there, got {', '.join(expected)}")
    if len(set(expected)) < len(expected):
        raise SettingError(f"only plans that pass no region twice are reconciled, got {', '.join(expected)}")


def _best(model: HybridMDP, start: int) -> Way:
    exact = exact_values(model.world)
    return way_of(model, [exact_walk(model, exact, start)], exact.shifted[start], exact.shift)


def _doors_between(model: HybridMDP, pairs: Iterable[tuple[str, str]]) -> Doors:
    """The doorways between two regions of any of some pairs."""
    assert model.regions is not None
    wanted = {frozenset(pair) for pair in pairs}
    names = model.region_names
    return frozenset(door.name for door in model.regions.doorways if frozenset(names[at] for at in door.pair) in wanted)


@dataclass
class _Search:
    """Sets of closed doorways, each tried once."""

    model: HybridMDP
    start: int
    expected: tuple[str, ...]
    known: dict[Doors, Way | None] = field(default_factory=dict)

    @property
    def slips(self) -> bool:
        """Whether moves slip."""
        return self.model.grid.slip > 0

    @property
    def is_over(self) -> bool:
        """Whether enough was tried."""
        return len(self.known) >= (MOST_SOLVED_SLIPPING if self.slips else MOST_SOLVED)

    def way(self, closed: Doors) -> Way | None:
        """The best way with some doorways closed; None where there is none."""
        if closed not in self.known:
            changed = self.model.with_closed(closed)
            self.known[closed] = _best(changed, self.start) if changed.can_reach[self.start] else None
        return self.known[closed]

    def own(self, closed: Doors) -> Way | None:
        """The same along the expected places alone."""
        assert self.model.regions is not None
        allowed = _doors_between(self.model, pairwise(self.expected))
        others = frozenset(door.name for door in self.model.regions.doorways) - allowed
        way = self.way(others | closed)
        return way if way is not None and way.places == self.expected else None

    def is_best(self, closed: Doors) -> bool:
        """Whether the expected plan is as good as any with some doorways closed."""
        best = self.way(closed)
        if self.slips:
            return best is not None and best.places == self.expected
        own = self.own(closed)
        if own is None or best is None:
            return False
        return best.places == self.expected or own.worth.beside(best.worth) >= 0

    def closings(self) -> tuple[Doors, bool]:
        """A set of doorways whose closing makes the expected plan best, and whether it is known to be smallest."""
        found = self._smallest(beside=False)
        if not self.slips:
            return (self._none_to_spare(), False) if found is None else (found, True)
        found = self._none_to_spare(found)
        if not self._can_try_all_below(len(found)):
            return found, len(found) < 2  # none at all would not do, it was tried first
        smaller = self._smallest(beside=True, below=len(found))
        return (found, not self.is_over) if smaller is None else (smaller, True)

    def _smallest(self, beside: bool, below: int | None = None) -> Doors | None:
        """The first set that would do, by size; None where there is none below some size, or enough was tried.

        beside: whether doorways beside the way are closed, too.
        """
        size = 0
        while not self.is_over and size != below:
            is_last = True
            for closed in self._of_size(frozenset(), size, beside):
                is_last = False
                if self.is_best(closed):
                    return closed
                if self.is_over:
                    return None
            if is_last:
                return None
            size += 1
        return None

    def _of_size(self, closed: Doors, size: int, beside: bool) -> Iterator[Doors]:
        """Sets of some more doorways, each of them on the best way that is left by those before it, or beside it."""
        if size == 0:
            yield closed
            return
        way = self.way(closed)
        if way is None or self.is_best(closed):
            return
        own = self.own(frozenset())
        of_own = () if own is None else own.doors
        on_the_way = sorted(set(way.doors), key=lambda door: (door in of_own, door))  # rather others than its own
        for door in dict.fromkeys((*on_the_way, *(self._reached(closed) if beside else ()))):
            if beside or self._is_left(closed | {door}):
                yield from self._of_size(closed | {door}, size - 1, beside)

    def _is_left(self, closed: Doors) -> bool:
        """Whether the expected places still follow each other."""
        if not self.slips:
            return self.own(closed) is not None
        return all(_doors_between(self.model, [pair]) - closed for pair in pairwise(self.expected))

    def _can_try_all_below(self, size: int) -> bool:
        """Whether sets of fewer doorways are few enough to try them all."""
        doors = len(self._reached(frozenset()))
        return sum(comb(doors, fewer) for fewer in range(size)) <= MOST_SOLVED_SLIPPING

    def _reached(self, closed: Doors) -> list[str]:
        """The open doorways to which moves may lead."""
        assert self.model.regions is not None
        changed = self.model.with_closed(closed)
        reached = breadth_first(changed.grid.successor, np.array([self.start]))[1] >= 0
        found = []
        for door in self.model.regions.doorways:
            cells = [cell for ends in crossings_of(self.model.regions, door) for cell in ends]
            if door.name not in closed and any(reached[changed.grid.state_of[cell]] for cell in cells):
                found.append(door.name)
        return sorted(found)

    def _none_to_spare(self, closed: Doors | None = None) -> Doors:
        """A set that would do, by default all doorways but those between expected places, less what can be left out."""
        assert self.model.regions is not None
        if closed is None:
            closed = frozenset(door.name for door in self.model.regions.doorways)
            closed -= _doors_between(self.model, pairwise(self.expected))
        spared = True
        while spared:  # one that is left out may make another needless, where moves slip
            spared = False
            for door in sorted(closed):
                if self.is_best(closed - {door}):
                    closed, spared = closed - {door}, True
        return closed
