"""Why a goal cannot be reached: the parts of the map with start and goal, what lies between, what would open it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from qualrl.answers.answer import Answer, first_of
from qualrl.answers.blocked import Blocked, Crossing, Flags, Kinds, Way, least_obstacle
from qualrl.answers.depth import Depth
from qualrl.answers.openings import Opening, cleared, open_doorways, smaller_robot
from qualrl.errors import SettingError
from qualrl.kernels.grid import breadth_first
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import length_m

MOST_TOLD = 5
"""More regions of a part, or places in the way, are counted and not told."""
MoreOpenings = Callable[[Blocked], tuple[tuple[Opening, ...], str]]
"""Openings that need the map's file, or why there are none."""


@dataclass(frozen=True, eq=False)
class Part:
    """The cells that can be reached from one."""

    regions: tuple[str, ...]
    """The regions in it, the largest first."""
    cells: int
    area_m2: float
    mask: Flags
    """(H, W) its cells."""

    def in_words(self, depth: Depth) -> str:
        """Its regions and size."""
        if depth != Depth.NUMBERS:
            return first_of(self.regions, MOST_TOLD)
        more = len(self.regions) - MOST_TOLD
        told = ", ".join(self.regions[:MOST_TOLD]) + (f" and {more:,} more" if more > 0 else "")
        return f"{told} ({self.cells:,} cell{'' if self.cells == 1 else 's'}, {self.area_m2:.2f} m2)"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"regions": list(self.regions), "cells": self.cells, "area_m2": self.area_m2}


@dataclass(frozen=True, eq=False)
class WhyUnreachable(Answer):
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    way: Way
    """A shortest way where there is one, else the way with the least obstacle."""
    steps: int | None
    """The fewest moves to the goal; None where no way leads there."""
    length_m: float | None
    """Of the way, if there is one."""
    slips: bool
    """Whether moves slip, so that a way may take more moves."""
    parts: tuple[Part, ...]
    """The start's and the goal's, or the one that holds both."""
    crossings: tuple[Crossing, ...]
    """The least obstacle: what is in the way where the fewest cells are, in the order of the way."""
    obstacle: Kinds
    """The cells of all of them."""
    openings: tuple[Opening, ...]
    notes: tuple[str, ...]
    """Why there are no openings of some kinds."""

    @property
    def is_reachable(self) -> bool:
        """Whether there is a way after all."""
        return self.steps is not None

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        if self.steps is not None:
            least = " at least, as moves slip" if self.slips else ""
            shortest = (
                f": the shortest way takes {self.steps:,} step{'' if self.steps == 1 else 's'} "
                f"({self.length_m:.2f} m){least}"
            )
            yield f"{self.goal} can be reached from {self.start}{depth.at_numbers(shortest)}."
            return
        yield f"No way leads from {self.start} to {self.goal}."
        yield f"The start's part of the map: {self.parts[0].in_words(depth)}."
        yield f"The goal's part of the map: {self.parts[1].in_words(depth)}."
        yield from self._obstacle_lines(depth)
        yield "A way would be opened by" if self.openings else "Nothing that was tried would open a way."
        yield from (f"- {opening.in_words(depth)}" for opening in self.openings)
        yield from self.notes if depth == Depth.NUMBERS else ()

    def _obstacle_lines(self, depth: Depth) -> list[str]:
        """What is in the way."""
        doors = sum(place.door is not None for place in self.crossings)
        counts = [self.obstacle.in_words(depth)] * (self.obstacle != Kinds())
        counted = f"{doors} closed doorway{'' if doors == 1 else 's'}"
        counts += [depth.at_numbers(counted, counted.partition(" ")[2])] * (doors > 0)
        least = f"In the way{depth.from_signs(' at least')}: {' and '.join(counts)}"
        if len(self.crossings) == 1:
            (place,) = self.crossings
            return [f"{least}, {'' if place.door is None else f'{place.door}, '}{place.where(depth)}."]
        lines = [f"  {place.in_words(depth)}" for place in self.crossings[:MOST_TOLD]]
        if len(self.crossings) > MOST_TOLD:
            lines.append(depth.at_numbers(f"  {len(self.crossings) - MOST_TOLD:,} places more", "  and other places"))
        places = depth.at_numbers(f"{len(self.crossings):,} places", "several places")
        return [f"{least}, in {places}:", *lines]

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "why-unreachable", "from": self.start, "to": self.goal, "reachable": self.is_reachable,
            "steps": self.steps, "length_m": self.length_m, "slips": self.slips,
            "parts": [part.to_dict() for part in self.parts],
            "obstacle": self.obstacle.to_dict(), "crossings": [place.to_dict() for place in self.crossings],
            "openings": [opening.to_dict() for opening in self.openings], "notes": list(self.notes),
            "way": [list(cell) for cell in self.way],
        }  # fmt: skip


def why_unreachable(model: HybridMDP, start: int, names: tuple[str, str], more: MoreOpenings) -> WhyUnreachable:
    """Ask why no way leads from a state to the goal.  names: what to call the two.  more: see ``MoreOpenings``.

    Raises SettingError for a model without a map.
    """
    if model.regions is None:
        raise SettingError("a model without a map has nothing that could be in the way")
    if model.can_reach[start]:
        walk = _shortest_walk(model, start)
        way = tuple(model.cell_of(state) for state in walk)
        return WhyUnreachable(
            *names, way, len(walk) - 1, length_m(model, walk), model.grid.slip > 0, (_part(model, start),), (), Kinds(),
            (), (),
        )  # fmt: skip
    blocked = Blocked(model, model.cell_of(start))
    way, crossings = least_obstacle(blocked)
    smaller = smaller_robot(blocked)
    notes = ["A smaller robot would not get there either."] * (model.regions.grid.radius_m > 0 and smaller is None)
    others, why_none = more(blocked)
    found = (open_doorways(blocked, way, crossings), smaller, *others, cleared(blocked, way, crossings))
    return WhyUnreachable(
        *names, way, None, None, model.grid.slip > 0, (_part(model, start), _part(model, model.grid.goal)), crossings,
        blocked.kinds([cell for place in crossings for cell in place.cells]),
        tuple(opening for opening in found if opening is not None), (*notes, *([why_none] if why_none else [])),
    )  # fmt: skip


def _part(model: HybridMDP, state: int) -> Part:
    """What can be reached from a state."""
    assert model.regions is not None
    reached, _ = breadth_first(model.grid.successor, np.array([state]))
    counts = np.bincount(model.region_of[reached], minlength=len(model.region_names))
    largest_first = np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)]
    mask = np.zeros(model.grid.free.shape, np.bool_)
    mask[tuple(model.grid.cells[reached].T)] = True
    area_m2 = len(reached) * model.regions.grid.resolution_m**2
    return Part(tuple(model.region_names[at] for at in largest_first.tolist()), len(reached), area_m2, mask)


def _shortest_walk(model: HybridMDP, start: int) -> list[int]:
    """States from the start to the goal; every move is a step nearer."""
    world, walk = model.grid, [start]
    while walk[-1] != world.goal:
        ahead = world.successor[walk[-1]]
        walk.append(int(ahead[np.argmin(world.steps_to_goal[ahead])]))
    return walk
