"""A way that questions compare: its places and doorways, its length, its value, and its rewards as a formula."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise, zip_longest
from typing import Any

import numpy as np

from qualrl.answers.answer import ALIKE, WORTH, in_sign
from qualrl.answers.depth import Depth
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.crossings import doors_between
from qualrl.planning.legs import legs_of
from qualrl.planning.on_the_way import SIDES, passages, seen_on_stretches
from qualrl.planning.plan import in_steps
from qualrl.planning.planner import length_m
from qualrl.qualitative.plan_value import Course, course_of
from qualrl.solving.exact import OFF, off_of
from qualrl.spatial.occupancy_grid import Cell
from qualrl.spatial.region_map import RegionMap

SHORTEST_TOLD_M = 0.005
MOST_SEEN = 3
"""So many landmarks of a stretch are named in words; JSON has all."""
LENGTHS = ("shorter", "as long", "longer")
STEPS = ("fewer steps", "as many steps", "more steps")


@dataclass(frozen=True)
class Worth:
    """A value, with the digits that it loses where the goal is far off."""

    shifted: float
    """value + shift: what it is more than to go on for ever, see ``solving.exact``."""
    shift: float
    off: float
    """By how much ``shifted`` may be off."""

    @property
    def value(self) -> float:
        """Expected discounted return."""
        return self.shifted - self.shift

    def beside(self, other: "Worth") -> float:
        """By how much it is more than another, 0 where both may be the same."""
        difference, off = self.shifted - other.shifted, self.off + other.off
        if self.shift != other.shift:
            difference, off = self.value - other.value, max(off, ALIKE * abs(other.value))
        return difference if abs(difference) > off else 0.0

    def alike(self, other: "Worth") -> str:
        """In words, that it is worth as much as another as far as that can be told."""
        off = self.off + other.off
        is_settled = off > 2 * OFF * max(abs(self.shifted), abs(other.shifted))
        return f"as much, to within {off:.1g}" if is_settled else "exactly as much"


def worth_of(world: GridWorld, shifted: float, shift: float) -> Worth:
    """A shifted value that was solved in a world."""
    return Worth(float(shifted), shift, float(off_of(world, float(shifted), shift)))


@dataclass(frozen=True)
class Way:
    """A way from a start to the goal, as it goes when no move slips."""

    places: tuple[str, ...]
    doors: tuple[str, ...]
    """The doorway taken between each two places."""
    passes: tuple[str, ...]
    """The same, with the landmarks in between that one is to come by."""
    turns: tuple[str | None, ...]
    """Where each of ``passes`` lies, and last the goal: the first by the compass, and what comes after a landmark; the
    others against the heading there.  None where there is nothing to walk."""
    lengths_m: tuple[float, ...]
    """How far it is to each of these from the one before."""
    sees: tuple[tuple[str, ...], ...]
    """The other landmarks that are passed meanwhile."""
    steps: int
    length_m: float
    worth: Worth
    """At the start, slips included."""

    @property
    def value(self) -> float:
        """Expected discounted return at the start."""
        return self.worth.value

    def in_words(self, depth: Depth) -> str:
        """Places, length and doorways."""
        *doors, goal = self._ends(depth)
        length = depth.at_numbers(f"{in_steps(self.steps)}, {self.length_m:.2f} m")
        told = " ".join(part for part in (length, f"by {', '.join(doors)}" if doors else "") if part)
        told = ", ".join(part for part in (told, goal if self.turns[-1] else "") if part)
        return " -> ".join(self.places) + (f" ({told})" if told else "")

    def _ends(self, depth: Depth) -> Iterator[str]:
        """Where each stretch leads, which way one turns for it, how far it is and what is passed."""
        one = len(self.passes) == 0
        told = zip((*self.passes, "the goal"), self.turns, self.lengths_m, self.sees, strict=True)
        for name, turn, far_m, seen in told:
            others = ["others"] if len(seen) > MOST_SEEN else []
            past = f" past {' and '.join([*seen[:MOST_SEEN], *others])}" if seen else ""
            far = "" if one else f" in {far_m:.2f} m"
            yield (f"{name} {turn}" if turn else name) + depth.at_numbers(far + past)

    def with_worth(self, depth: Depth) -> str:
        """The same, and what it is worth."""
        return self.in_words(depth) + depth.at_numbers(f", worth {self.value:.6g}")

    def worth_beside(self, other: "Way") -> str:
        """Whether it is worth more than another, in a word."""
        return WORTH[1 + int(np.sign(self.worth.beside(other.worth)))]

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "places": list(self.places), "doors": list(self.doors), "passes": list(self.passes),
            "turns": list(self.turns), "lengths_m": list(self.lengths_m), "sees": [list(names) for names in self.sees],
            "steps": self.steps, "length_m": self.length_m,
            "value": self.value, "shifted": self.worth.shifted, "shift": self.worth.shift,
            "off": self.worth.off,
        }  # fmt: skip


def way_of(
    model: HybridMDP, parts: Sequence[Sequence[int]], shifted: float, shift: float = 0.0,
    stops: Sequence[str | None] = (),
) -> Way:  # fmt: skip
    """A way in one or more parts; where one begins, its place is told however briefly it is visited.

    shifted: what it is worth, plus shift.  stops: the landmarks at which parts end, None for those that end elsewhere.
    """
    regions, places, doors = model.regions, list[str](), list[str]()
    assert regions is not None
    for part in parts:
        legs = legs_of(model, part)
        places += [model.region_names[leg.region] for leg in legs]
        doors += [door.name for door in doors_between(model, regions, part, legs)]
    far_m = sum(length_m(model, part) or 0.0 for part in parts)
    told = tuple(place for place, _ in groupby(places))
    return Way(
        told,
        tuple(doors),
        *_turns(model, regions, parts, stops),
        *_stretches(model, regions, parts, stops),
        sum(len(part) - 1 for part in parts),
        far_m,
        worth_of(model.grid, shifted, shift),
    )


def _turns(
    model: HybridMDP, regions: RegionMap, parts: Sequence[Sequence[int]], stops: Sequence[str | None]
) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """``Way.passes`` and ``Way.turns``."""
    passes, turns, turn = list[str](), list[str | None](), None
    come_from: Cell | None = None
    for part, stop in zip_longest(parts, stops):
        path: list[Cell] = [(row, column) for row, column in model.grid.cells[list(part)].tolist()]
        doors = iter(doors_between(model, regions, part, legs_of(model, part)))
        for passage in passages(regions, path, come_from):
            turn = f"to the {passage.compass}" if passage.compass else passage.side and SIDES[passage.side]
            if passage.left_by is not None:
                passes.append(next(doors).name)
                turns.append(turn)
        if stop is not None and len(path) > 1:
            passes.append(stop)
            turns.append(turn)
        if len(path) > 1:
            come_from = path[-2] if stop is None else None
    return tuple(passes), (*turns, turn)


def _stretches(
    model: HybridMDP, regions: RegionMap, parts: Sequence[Sequence[int]], stops: Sequence[str | None]
) -> tuple[tuple[float, ...], tuple[tuple[str, ...], ...]]:
    """``Way.lengths_m`` and ``Way.sees``."""
    walk, ends, starts, named = [*parts[0][:1]], list[int](), [0], list[str]()
    for part, stop in zip_longest(parts, stops):
        before = len(walk) - 1
        walk += part[1:]
        legs = legs_of(model, part)
        starts += [before + leg.first for leg in legs[1:]]
        ends += [before + leg.first - 1 for leg in legs[1:]]  # on this side of the doorway
        named += [door.name for door in doors_between(model, regions, part, legs)]
        if stop is not None and len(part) > 1:
            ends.append(len(walk) - 1)
            starts.append(len(walk) - 1)
            named.append(stop)
    ends.append(len(walk) - 1)
    told = [{*pair} for pair in pairwise(["", *named, ""])]
    path = [model.cell_of(state) for state in walk]
    seen = seen_on_stretches(regions, path, [*zip(starts, ends, strict=True)], told)
    lengths = (length_m(model, walk[first : last + 1]) or 0.0 for first, last in pairwise([*starts, len(walk) - 1]))
    return tuple(lengths), tuple(seen)


def course(model: HybridMDP, walk: Sequence[int]) -> Course:
    """The rewards of a walk to the goal, each with the region that its step starts in."""
    if len(walk) < 2:
        return Course(())
    world, states = model.grid, np.array(walk)
    moves = (world.successor[states[:-1]] == states[1:, None]).argmax(axis=1)
    rewards: list[float] = world.move_reward[moves].tolist()
    places = [model.region_names[region] for region in model.region_of[states[:-1]].tolist()]
    return course_of(places, [*rewards[:-1], float(world.goal_reward)])


def longer(way: Way, other: Way, depth: Depth) -> str:
    """How much longer a way is than another: "6 steps more and 1.50 m more", or "it is longer"."""
    steps, far_m = way.steps - other.steps, way.length_m - other.length_m
    if depth == Depth.NUMBERS and steps == 0 and abs(far_m) < SHORTEST_TOLD_M:
        return "just as long"
    if depth == Depth.NUMBERS:
        return f"{_more(steps, 'step' if abs(steps) == 1 else 'steps')} and {_more(far_m, 'm', 2)}"
    far = in_sign(far_m, other.length_m, LENGTHS)
    walked = in_sign(steps, other.steps, STEPS)
    return f"it is {far}" if LENGTHS.index(far) == STEPS.index(walked) else f"it is {far}, with {walked}"


def _more(amount: float, unit: str, digits: int = 0) -> str:
    """How much more or less: "6 steps more"."""
    fewer = "fewer" if digits == 0 else "less"
    return f"{abs(amount):.{digits}f} {unit} {'more' if amount >= 0 else fewer}"
