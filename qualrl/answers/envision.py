"""What may happen under the best policy, region by region: the attainable qualitative states and their branches.

A qualitative state is a region and the doorway by which it was entered.  Which doorway it is left by may hang on the
cell where one comes in, on which of several moves that are as good is made, and where moves slip on chance: so a branch
has a least and a greatest probability over those cells and moves, and it is shown as long as it is possible.  (Where
moves slip and all those moves aim at one doorway, the first of them are made.)  The next state is left open to no more
than that: bounds of a course of states multiply.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from qualrl.answers.answer import SELDOM, Answer, likelihood
from qualrl.answers.depth import Depth
from qualrl.answers.policy import moves_as_good
from qualrl.errors import NoPlanError, SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import doors_passed
from qualrl.planning.exits import GOAL_HERE, ExitsAsGood, best_moves, exits
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import ExactValues, crossings_to_goal, exact_values
from qualrl.spatial.region_map import RegionMap

GOAL = GOAL_HERE
"""Instead of a doorway: the goal, in the region itself."""
START = -1
"""Instead of the doorway that a region was entered by."""
NEGLIGIBLE = 1e-12
"""Branches that are never likelier are left out, and states attained by none but them; the others are not certain then.
Branches below ``SELDOM`` are put in words by their number; JSON has them."""
LEAST, MOST = float(np.finfo(float).smallest_normal), 1 - float(np.finfo(float).epsneg)
"""Probabilities that are neither 0 nor 1, by the graph of moves, are not rounded to that either."""
ALIKE_CHANCES = 1e-11
"""Probabilities that differ by less may be the same."""
MOST_COURSES = 5
"""So many courses are put in words."""
LONGEST_SEARCH = 100_000
"""States that are gone through to find courses."""
MOST_CELLS = 300_000
"""Of a region whose equations are solved: some gigabytes."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
State = tuple[int, int]
"""A region, and the doorway it was entered by."""


@dataclass(frozen=True)
class Branch:
    """One way on from a qualitative state."""

    door: str | None
    """None for the goal."""
    to: State | None
    least: float
    most: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON; the next state is named by ``Envisioned``."""
        return {"door": self.door, "least": self.least, "most": self.most}


@dataclass(frozen=True)
class Course:
    """States from the start to the goal, none twice, and between what bounds the probability lies to take it."""

    states: tuple[State, ...]
    least: float
    most: float


@dataclass(frozen=True)
class Envisioned(Answer):
    """The answer."""

    start: str
    goal: str
    names: tuple[str, ...]
    """Of the regions."""
    doors: tuple[str, ...]
    branches: dict[State, tuple[Branch, ...]]
    """Of each attainable state, the likeliest first; in the order in which they are found from the start."""
    of_all: int
    """Regions and doorways into them: as many states are there, attainable or not."""
    courses: tuple[Course, ...]
    """The likeliest first, by their greatest probability."""
    has_all_courses: bool

    def lines(self, depth: Depth) -> Iterator[str]:
        """A line a state, and one a course."""
        states = depth.at_numbers(f" {len(self.branches)} of {self.of_all} states.")
        yield f"Attainable from {self.start} on the way to {self.goal}:{states}"
        yield from (self._state_in_words(state, depth) for state in self.branches)
        many = f" {'' if self.has_all_courses else 'at least '}{len(self.courses)}, the likeliest first:"
        first = depth.at_numbers(f":{many}", f"{depth.from_signs(', the likeliest first')}:")
        yield f"Courses without coming back to a state{first}"
        for course in self.courses[:MOST_COURSES]:
            places = " -> ".join(self.names[region] for region, _ in course.states)
            yield f"  {places}{depth.from_signs(f': {_bounds(course.least, course.most, depth)}')}"
        if len(self.courses) > MOST_COURSES or not self.has_all_courses:
            yield "  and others"

    def _state_in_words(self, state: State, depth: Depth) -> str:
        told = [branch for branch in self.branches[state] if branch.most >= SELDOM]
        ways = [
            self._on(branch) + depth.from_signs(f" ({_bounds(branch.least, branch.most, depth)})") for branch in told
        ]  # fmt: skip
        seldom = len(self.branches[state]) - len(told)
        otherwise = f"or otherwise{depth.from_signs(' (seldom)')}"
        counted = depth.at_numbers(f"{seldom} more, none above {SELDOM:g}", otherwise)
        ways += [counted] if seldom else []
        return f"{self.called(state)}: {'; '.join(ways) or 'no way on'}"

    def _on(self, branch: Branch) -> str:
        return "to the goal" if branch.to is None else f"by {branch.door} to {self.names[branch.to[0]]}"

    def called(self, state: State) -> str:
        """A state in words."""
        region, door = state
        return self.names[region] if door == START else f"{self.names[region]}, entered by {self.doors[door]}"

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        states = [
            {
                "region": self.names[region], "entered_by": None if door == START else self.doors[door],
                "branches": [
                    of.to_dict() | {"to": None if of.to is None else self.names[of.to[0]]}
                    for of in self.branches[region, door]
                ],
            }
            for region, door in self.branches
        ]  # fmt: skip
        courses = [
            {"places": [self.names[region] for region, _ in of.states], "least": of.least, "most": of.most}
            for of in self.courses
        ]
        return {
            "question": "envision", "from": self.start, "to": self.goal, "states": states, "of_all": self.of_all,
            "courses": courses, "has_all_courses": self.has_all_courses,
        }  # fmt: skip


def _bounds(least: float, most: float, depth: Depth) -> str:
    if depth != Depth.NUMBERS:
        return likelihood(least, most)
    if least >= 1:
        return "surely"
    low, high = (_probability(of) for of in (least, most))
    return low if low == high else f"{low} to {high}"


def _probability(of: float) -> str:
    """With three digits, or more where fewer would make it 1."""
    return next((text for text in (f"{of:.3g}", f"{of:.6g}") if text != "1"), "1" if of >= 1 else "almost 1")


def envision(model: HybridMDP, start: int, names: tuple[str, str]) -> Envisioned:
    """Ask what may happen on the way from a state to the goal under the best policy.

    names: what to call start and goal.  Raises NoPlanError where no way leads to the goal.
    """
    regions = model.regions
    assert regions is not None
    model.check_reachable(start)
    leaving = _Leaving(model, regions, exact_values(model.world))
    first = (int(model.region_of[start]), START)
    branches: dict[State, tuple[Branch, ...]] = {}
    edge = {first: np.array([start])}
    while edge:
        state, cells = next(iter(edge.items()))
        del edge[state]
        branches[state] = leaving.branches(state[0], cells)
        for branch in branches[state]:
            if branch.to is not None and branch.to not in branches:
                edge.setdefault(branch.to, leaving.cells_beyond(*branch.to))
    doors = tuple(door.name for door in regions.doorways)
    courses, has_all = _courses(branches, first)
    of_all = 1 + 2 * len(doors)
    return Envisioned(*names, model.region_names, doors, branches, of_all, courses, has_all)


class _Leaving:
    """By which doorways the best policy leaves regions."""

    def __init__(self, model: HybridMDP, regions: RegionMap, exact: ExactValues) -> None:
        self.model, self.regions = model, regions
        self.known: dict[int, _Region] = {}
        if model.grid.slip > 0:
            self.good = moves_as_good(model, exact)
            moves = np.packbits(self.good, axis=1, bitorder="little")[:, 0]
        else:
            self.exits = exits(model, regions, exact)
            moves = best_moves(model, exact, crossings_to_goal(model.grid, exact, model.region_of))
        self.as_good = ExitsAsGood(model, regions, moves)

    def branches(self, region: int, cells: NDArray[np.int64]) -> tuple[Branch, ...]:
        """The ways on from some cells of a region."""
        found = []
        for door, least, most in zip(*(of.tolist() for of in self._chances(region, cells)), strict=True):
            if most > NEGLIGIBLE:
                found.append(self._branch(region, door, least, most))
        return tuple(sorted(found, key=lambda branch: (-branch.most, branch.door or "")))

    def _branch(self, region: int, door: int, least: float, most: float) -> Branch:
        if door == GOAL:
            return Branch(None, None, least, most)
        pair = self.regions.doorways[door].pair
        beyond = pair[1 - pair.index(region)]
        return Branch(self.regions.doorways[door].name, (beyond, door), least, most)

    def cells_beyond(self, region: int, door: int) -> NDArray[np.int64]:
        """States of a region by which it is entered through a doorway."""
        of = self.regions.doorways[door]
        side = of.pair.index(region)
        world = self.model.grid
        return np.array(sorted({int(world.state_of[ends[side]]) for ends in crossings_of(self.regions, of)}), np.int64)

    def _chances(self, region: int, cells: Ints) -> tuple[Ints, Floats, Floats]:
        """(D,) doorways by which it is possible to leave from some cells, the least and the greatest probability."""
        if self.model.grid.slip == 0 and (self.exits[cells] < GOAL).any():
            raise NoPlanError(f"gamma {self.model.gamma} fades to nothing on the way; choose gamma nearer to 1")
        ways = np.array(sorted(self.as_good.of(cells)), np.int64)
        if self.model.grid.slip == 0:
            return ways, np.full(len(ways), float(len(ways) == 1)), np.ones(len(ways))
        if region not in self.known:
            self.known[region] = self._region(region)
        known = self.known[region]
        least, most = known.bounds if len(ways) > 1 else (known.chances, known.chances)
        rows = np.searchsorted(np.flatnonzero(self.model.region_of == region), cells)
        return known.doors, known.sure(least, rows).min(axis=0), known.sure(most, rows).max(axis=0)

    def _region(self, region: int) -> "_Region":
        model = self.model
        inside = np.flatnonzero(model.region_of == region)
        if len(inside) > MOST_CELLS:
            raise SettingError(
                f"{model.region_names[region]} has {len(inside)} cells, more than the {MOST_CELLS} that chances are "
                "solved for where moves slip"
            )
        return _Region(model, self.regions, inside, self.good[inside])


class _Region:
    """How the n cells of a region are left, whichever of the moves that are as good is made in each.

    A moves, as many places that one may lead to, D doorways or GOAL.
    """

    def __init__(self, model: HybridMDP, regions: RegionMap, inside: Ints, good: NDArray[np.bool_]) -> None:
        world, ends = model.grid, model.grid.successor[inside].astype(np.int64)
        self.good, self.first = good, good.argmax(axis=1)
        self.chance = np.full((world.n_actions, world.n_actions), world.slip / (world.n_actions - 1))
        np.fill_diagonal(self.chance, 1.0 - world.slip)
        self.ended = inside == world.goal
        out = model.region_of[ends] != model.region_of[inside[0]]
        self.stays = ~out & (ends != world.goal)
        self.number = np.searchsorted(inside, np.where(self.stays, ends, inside[0]))
        self.row = np.broadcast_to(np.arange(len(inside))[:, None], ends.shape)
        door = np.full(ends.shape, GOAL, np.int64)
        if out.any():
            door[out] = doors_passed(model, regions, inside[self.row[out]], ends[out])
        self.doors = np.unique(np.append(door[~self.stays], GOAL))
        self.door = np.searchsorted(self.doors, door)

    def _chances(self, moves: Ints) -> Floats:
        """(n, A) where moves (n,) lead to; from the goal nowhere."""
        return np.where(self.ended[:, None], 0.0, self.chance[moves])

    def within(self, moves: Ints) -> csc_array:
        """(n, n) from cell to cell."""
        n, chances = len(self.good), self._chances(moves)
        return csc_array((chances[self.stays], (self.row[self.stays], self.number[self.stays])), shape=(n, n))

    def at_once(self, moves: Ints) -> Floats:
        """(n, D) by the next move."""
        found, chances = np.zeros((len(self.good), len(self.doors))), self._chances(moves)
        np.add.at(found, (self.row[~self.stays], self.door[~self.stays]), chances[~self.stays])
        return found

    @cached_property
    def possible(self) -> NDArray[np.bool_]:
        """(n, D) which doorways it is possible to leave by.

        A robot that may slip can get to any cell that it can walk to, so that the graph tells.
        """
        _, part = connected_components(self.within(self.first))
        ways = np.zeros((part.max() + 1, len(self.doors)), np.bool_)
        np.logical_or.at(ways, part, self.at_once(self.first) > 0)
        found: NDArray[np.bool_] = ways[part]
        return found

    def sure(self, chances: Floats, rows: Ints) -> Floats:
        """Chances (n, D) of some cells (N,), which are 0 or 1 where the graph makes them so, and nowhere else."""
        possible = self.possible[rows]
        found = np.where(possible, np.clip(chances[rows], LEAST, MOST), 0.0)
        found[possible & (possible.sum(axis=1, keepdims=True) == 1)] = 1.0
        found[self.ended[rows]] = self.doors == GOAL
        return found

    def left(self, moves: Ints, door: int | None = None) -> Floats:
        """(n, D) by each doorway in the end, or (n,) by one: a sparse solve of h = P h + what leaves at once."""
        equations = (eye_array(len(self.good), format="csc") - self.within(moves)).tocsc()
        at_once = self.at_once(moves)
        solved: Floats = splu(equations, permc_spec="MMD_AT_PLUS_A").solve(
            at_once if door is None else np.ascontiguousarray(at_once[:, door])
        )
        return solved

    @cached_property
    def chances(self) -> Floats:
        """(n, D) of leaving by each doorway, of moves that are as good the first ones made."""
        return self.left(self.first)

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """The least and the greatest, whichever of them are made."""
        ends = [[self._extreme(door, sign) for door in range(len(self.doors))] for sign in (-1, 1)]
        return np.stack(ends[0], axis=1), np.stack(ends[1], axis=1)

    def _extreme(self, door: int, sign: int) -> Floats:
        """(n,) the greatest chance (sign 1) or the least (-1) of one doorway, by policy iteration."""
        moves, found = self.first, self.chances[:, door]
        while True:
            ends = np.where(self.stays, found[self.number], self.door == door)
            worth = np.where(self.good, sign * (ends @ self.chance.T), -np.inf)
            own = np.take_along_axis(worth, moves[:, None], axis=1)[:, 0]
            better = (worth.max(axis=1) > own + ALIKE_CHANCES) & ~self.ended
            if not better.any():
                return found
            moves = np.where(better, worth.argmax(axis=1), moves)
            found = self.left(moves, door)


def _courses(branches: dict[State, tuple[Branch, ...]], first: State) -> tuple[tuple[Course, ...], bool]:
    """Courses from a state to the goal that pass no state twice, and whether these are all of them."""
    found, looked = list[Course](), 0
    stack: list[tuple[tuple[State, ...], float, float]] = [((first,), 1.0, 1.0)]
    while stack:
        states, least, most = stack.pop()
        looked += 1
        if looked > LONGEST_SEARCH:
            break
        for branch in branches[states[-1]]:
            ahead = least * branch.least, max(most * branch.most, LEAST)
            if branch.to is None:
                found.append(Course(states, *ahead))
            elif branch.to not in states:
                stack.append(((*states, branch.to), *ahead))
    return tuple(sorted(found, key=lambda course: (-course.most, len(course.states), course.states))), not stack
