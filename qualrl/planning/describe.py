"""A map in relations: which regions lie where from each other, how far, and what zones are in what.

All pairs stand in the JSON; for people only those that a doorway joins or a zone touches, unless a place is asked for.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from qualrl.planning.on_the_way import ENDS, REACH_M, SIDES, Passage, QuantitySpace, landmarks_passed, passages
from qualrl.planning.routes import Route, Routes
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.region_map import CENTRE, RegionMap
from qualrl.spatial.relations import AROUND, Relations
from qualrl.spatial.topology import RCC8_WORDS

MOST_LINES = 40
MOST_NEIGHBOURS = 8
NOWHERE_BEYOND = {"middle": "within its bounds", AROUND: "on several sides"}
TURNS = {"straight": "you go straight on", "left": "you turn left", "right": "you turn right", "back": "you turn back"}


@dataclass(frozen=True)
class Walk:
    """A route between two places, as a walker tells it."""

    start: str
    goal: str
    route: Route
    passages: tuple[Passage, ...]
    space: QuantitySpace
    resolution_m: float

    def lines(self) -> Iterator[str]:
        """In words: the whole, each region, the order of the landmarks."""
        yield f"From {self.start} to {self.goal}: {self.route.length_m:.2f} m."
        for number, at in enumerate(self.passages, 1):
            yield f"{number}. In {at.region}, {self._told(at)}."
        ends = (self.start, self.goal)  # told as such, doorways too
        told = [
            mark for mark in self.space.marks
            if mark.kind != CENTRE and (mark.kind in ENDS or mark.name not in ends)
        ]  # fmt: skip
        yield (
            f"On the way, within {REACH_M:g} m: "
            + ", ".join(f"{mark.name} at {self._far(mark.step)}" for mark in told)
            + "."
        )

    def _told(self, at: Passage) -> str:
        to = at.left_by or "the goal"
        go = f"go {at.compass}" if at.compass else "go"
        on = f"{go} through {to}" if at.left_by else f"{go} to {to}"
        where = f"{to} lies {SIDES[at.side]}" if at.side else on
        turn = f"; through it, {TURNS[at.turn]} compared with how you came in" if at.turn else ""
        return f"{where}, {self._far(at.steps)}{turn}"

    def _far(self, steps: int) -> str:
        return f"{steps * self.resolution_m:.2f} m"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "from": self.start, "to": self.goal, "steps": self.route.steps, "length_m": self.route.length_m,
            "passages": [vars(at) | {"length_m": at.steps * self.resolution_m} for at in self.passages],
            "landmarks": [vars(mark) | {"at_m": mark.step * self.resolution_m} for mark in self.space.marks],
        }  # fmt: skip


@dataclass(frozen=True)
class Description:
    """What is told of a map; every number of its sentences stands in its JSON."""

    relations: Relations
    cuts: DistanceCuts
    of: str | None = None
    """Only what lies where from this place."""
    walk: Walk | None = None

    def explain(self) -> str:
        """In words, a line a place, lists cut short."""
        return "\n".join(self.lines())

    def lines(self) -> Iterator[str]:
        """The same, line by line."""
        cuts = self.cuts
        yield f"North is where y of the map's frame grows{self._turned()}."
        yield f"Near: walks from centre to centre of up to {cuts.near_m:g} m; far: of more than {cuts.far_m:g} m."
        if self.walk is not None:
            yield from self.walk.lines()
        elif self.of is not None:
            yield from (f"{name}: {', '.join(self._told(name, self.of))}" for name in self._places() if name != self.of)
        else:
            yield from self._overview()

    def _turned(self) -> str:
        yaw = self.relations.regions.grid.origin[2]
        return f", turned by {math.degrees(yaw):g} degrees in the image" if yaw else ", up in the image"

    def _places(self) -> list[str]:
        """Regions but pockets, unless one is asked for, then zones."""
        regions = self.relations.regions.regions
        named = [region.name for region in regions if region.kind != "pocket" or region.name == self.of]
        return [*named, *(zone.name for zone in self.relations.zones)]

    def _overview(self) -> Iterator[str]:
        places = self._places()
        for name in places[:MOST_LINES]:
            others = [other for other in places if other != name and self._is_told(other, name)]
            others.sort(key=lambda other: self.relations.distance_m(other, name))
            told = [f"{other} ({', '.join(self._told(other, name))})" for other in others[:MOST_NEIGHBOURS]]
            more = [f"and {len(others) - MOST_NEIGHBOURS} more"] if len(others) > MOST_NEIGHBOURS else []
            yield f"{name}: {'; '.join([*told, *more]) or 'joined to nothing'}"
        if len(places) > MOST_LINES:
            yield f"and {len(places) - MOST_LINES} more places (--json lists all)"

    def _is_told(self, of: str, to: str) -> bool:
        """Whether a doorway joins two places, or a zone touches the other."""
        both_regions = self.relations.is_region(of) and self.relations.is_region(to)
        return bool(self.relations.doorways(of, to)) if both_regions else self.relations.topology(of, to) != "DC"

    def _told(self, of: str, seen_from: str) -> list[str]:
        """What is said of a place seen from another: RCC8 of zones, direction, distance, doorways."""
        relations = self.relations
        words = []
        if not (relations.is_region(of) and relations.is_region(seen_from)):
            words.append(RCC8_WORDS[relations.topology(of, seen_from)] + " it")
        tile, walk_m = relations.direction(of, seen_from), relations.distance_m(of, seen_from)
        words.append(NOWHERE_BEYOND.get(tile, tile))
        words.append(self.cuts.name(walk_m) + (f", {walk_m:.1f} m" if walk_m < math.inf else ", no way"))
        return words + [f"by {' and '.join(doors)}" for doors in [relations.doorways(of, seen_from)] if doors]

    def to_dict(self) -> dict[str, Any]:
        """The JSON twin: all pairs of places but pockets, or those with ``of``."""
        grid = self.relations.regions.grid
        places = self._places()
        pairs = [(a, b) for b in places for a in places if a != b and self.of in (None, b)]
        return {
            "question": "describe", "map": grid.source, "yaw_rad": grid.origin[2],
            "near_m": self.cuts.near_m, "far_m": self.cuts.far_m,
            "places": [self._place(name) for name in places],
            "relations": [self._pair(*pair) for pair in pairs],
            "route": None if self.walk is None else self.walk.to_dict(),
            "sentences": self.explain().splitlines(),
        }  # fmt: skip

    def _place(self, name: str) -> dict[str, Any]:
        sort = "region" if self.relations.is_region(name) else "zone"
        return {"name": name, "sort": sort, "centre": list(self.relations.centre(name))}

    def _pair(self, of: str, seen_from: str) -> dict[str, Any]:
        relations = self.relations
        walk_m = relations.distance_m(of, seen_from)
        return {
            "of": of, "seen_from": seen_from, "direction": relations.direction(of, seen_from),
            "shares": relations.shares(of, seen_from), "walk_m": walk_m if walk_m < math.inf else None,
            "distance": self.cuts.name(walk_m), "doorways": list(relations.doorways(of, seen_from)),
            "rcc8": relations.topology(of, seen_from),
        }  # fmt: skip


def describe(
    relations: Relations, cuts: DistanceCuts, of: str | None = None, ends: tuple[str, str] | None = None
) -> Description:
    """Describe a map: all of it, or what lies where from a place, or the route between two places (ends).

    Raises UnknownNameError, PlaceError or NoPlanError.
    """
    if of is not None:
        relations.number(of)
    return Description(relations, cuts, of, None if ends is None else walk_between(relations.regions, *ends))


def walk_between(regions: RegionMap, start: str, goal: str) -> Walk:
    """The shortest route between two places, as a walker tells it."""
    route = Routes(regions).between(start, goal, exact=True)
    path = [(row, column) for row, column in route.path.tolist()]
    space = landmarks_passed(regions, path, (start, goal))
    return Walk(start, goal, route, passages(regions, path), space, regions.grid.resolution_m)
