"""Statements about places, checked against a map and against each other.

On a map, a place lies in a direction from another if more than half of its cells do, beyond that side of the other
place's box.  What is said of directions, and of what is inside what, follows the calculus of points (``whereabouts``);
what is said of touching and doorways RCC8, and what is said of distances the calculus of lengths of walks: a walk by a
third place is never shorter than the direct one.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

from qualrl.errors import QualrlError, SettingError, UnknownNameError, did_you_mean
from qualrl.qualitative.calculus import Calculus, Relation, algebraic_closure, calculus
from qualrl.qualitative.conflicts import Numbers, conflicts
from qualrl.qualitative.statements import CONNECTED, Statement
from qualrl.qualitative.whereabouts import SAME, consistency, tells
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.relations import HALF, Relations
from qualrl.spatial.topology import RCC8_WORDS

RCC8 = {
    CONNECTED: ("EC",), "apart from": ("DC",), "touches": ("EC",), "overlaps": ("PO",),
    "inside": ("TPP", "NTPP", "EQ"), "contains": ("TPPi", "NTPPi", "EQ"), "the same as": ("EQ",),
}  # fmt: skip
DIRECTIONS = "directions"
DISTANCES = {"near": "near", "at medium distance from": "medium", "far from": "far"}


@dataclass(frozen=True)
class Judged:
    """A statement beside the map."""

    statement: Statement
    where: str
    """Where it was written; may be empty."""
    holds: bool | None
    """None where a name is not on the map."""
    because: str
    numbers: dict[str, Any]
    """What ``because`` says, as numbers and names."""

    def in_words(self) -> str:
        """Verdict, statement, reason."""
        verdict = {True: "true", False: "false", None: "unknown"}[self.holds]
        where = f"{self.where}: " if self.where and not self.holds else ""
        return f"{verdict}: {where}{self.statement.text}: {self.because}"


@dataclass(frozen=True)
class Clash:
    """Statements that cannot hold together."""

    members: tuple[int, ...]
    """By their place in the list."""
    about: str
    with_map: bool
    """Whether what the map shows of the places on it is needed too."""
    is_smallest: bool
    """Whether no fewer statements clash so, proved; else any of them left out ends this clash."""


@dataclass(frozen=True)
class Checked:
    """All verdicts."""

    cuts: DistanceCuts
    judged: tuple[Judged, ...]
    clashes: tuple[Clash, ...]

    @property
    def holds(self) -> bool:
        """Whether no statement is false on the map and none clash."""
        return not self.clashes and all(one.holds is not False for one in self.judged)

    def explain(self) -> str:
        """In words: a line a statement, then the clashes."""
        counts = {holds: sum(one.holds is holds for one in self.judged) for holds in (True, False, None)}
        lines = [
            f"{_counted(len(self.judged), 'claim')}: {counts[True]} true, {counts[False]} false, "
            f"{counts[None]} of places that are not on the map; {_counted(len(self.clashes), 'clash', 'es')}."
        ]
        lines += [one.in_words() for one in self.judged]
        for clash in self.clashes:
            least = "no fewer do" if clash.is_smallest else "none of them can be left out"
            map_too = " on this map" if clash.with_map else ""
            said = "; ".join(self.judged[member].statement.text for member in clash.members)
            lines.append(f"clash of {clash.about}: these cannot hold together{map_too} ({least}): {said}")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """The JSON twin."""
        return {
            "question": "check", "holds": self.holds, "near_m": self.cuts.near_m, "far_m": self.cuts.far_m,
            "claims": [
                {
                    "claim": one.statement.text, "where": one.where, "subject": one.statement.subject,
                    "relation": one.statement.relation, "object": one.statement.object,
                    "negated": one.statement.negated, "doorway": one.statement.doorway,
                    "holds": one.holds, "because": one.because, **one.numbers,
                }
                for one in self.judged
            ],
            "clashes": [vars(clash) | {"members": list(clash.members)} for clash in self.clashes],
            "sentences": self.explain().splitlines(),
        }  # fmt: skip


def check(
    relations: Relations, statements: Sequence[Statement], cuts: DistanceCuts, where: Sequence[str] = ()
) -> Checked:
    """Check statements against a map and against each other.

    where: by statement, where it was written, for messages.  Names that are on no map are places of a sketch: what is
    said of them is checked against the rest only.  Raises UnknownNameError or SettingError for statements about what
    has no such relation: landmarks, and doorways of zones.
    """
    where = where or [""] * len(statements)
    judged = tuple(_judged(relations, *pair, cuts) for pair in zip(statements, where, strict=True))
    alone = _clashes(statements, range(len(statements)), cuts, None)
    spent = {member for clash in alone for member in clash.members}
    left = [at for at, one in enumerate(judged) if one.holds is not False and at not in spent]
    return Checked(cuts, judged, (*alone, *_clashes(statements, left, cuts, relations)))


def distance_calculus(cuts: DistanceCuts) -> Calculus:
    """Near, medium and far, as far as lengths of shortest walks allow them between three places."""
    names = ("near", "medium", "far")
    most = dict(zip(names, (cuts.near_m, cuts.far_m, math.inf), strict=True))
    beyond = dict(zip(names, (-1.0, cuts.near_m, cuts.far_m), strict=True))

    def fit(*three: str) -> bool:
        """Whether three lengths of these classes can be such that none is more than the other two together."""
        return all(beyond[a] < most[b] + most[c] for a, b, c in (three, three[1:] + three[:1], three[2:] + three[:2]))

    table = tuple(tuple(sum(1 << bit for bit, c in enumerate(names) if fit(a, b, c)) for b in names) for a in names)
    return Calculus("distance", names, 0, (0, 1, 2), table)


@dataclass(frozen=True)
class _Aspect:
    """What statements say in one calculus, and what a map does."""

    about: str
    calculus: Calculus
    said: Callable[[Statement], Relation | None]
    shown: Callable[[Relations, str, str], Relation]


def _aspects(cuts: DistanceCuts) -> tuple[_Aspect, ...]:
    rcc8, distance = calculus("rcc8"), distance_calculus(cuts)

    def touching(of: Statement) -> Relation | None:
        if of.direction is not None or of.relation == CONNECTED:
            if of.negated:  # may lie or be anyhow else
                return None
            inside = rcc8.relation(*RCC8["inside"])  # where more than half of a place never is that lies beyond another
            return rcc8.any_relation & ~inside if of.direction else rcc8.relation(*RCC8[CONNECTED])
        return _unless(of, rcc8, RCC8.get(of.relation))

    def distances(of: Statement) -> Relation | None:
        return _unless(of, distance, (DISTANCES[of.relation],) if of.relation in DISTANCES else None)

    return (
        _Aspect("touching", rcc8, touching, lambda relations, a, b: rcc8.relation(relations.topology(a, b))),
        _Aspect(
            "distances", distance, distances,
            lambda relations, a, b: distance.relation(cuts.name(relations.distance_m(a, b))),
        ),
    )  # fmt: skip


def _unless(of: Statement, within: Calculus, names: tuple[str, ...] | None) -> Relation | None:
    """The relation of a statement that says that one of these holds, or that none does."""
    if names is None:
        return None
    said = within.relation(*names)
    return within.any_relation & ~said if of.negated else said


def _clashes(
    statements: Sequence[Statement], numbers: Sequence[int], cuts: DistanceCuts, relations: Relations | None
) -> list[Clash]:
    """Clashes among some statements, with what the map shows of their places if relations are given."""
    found: dict[Numbers, Clash] = {}

    def note(about: str, of: Sequence[int], is_consistent: Callable[[Numbers], bool]) -> None:
        for conflict in conflicts(len(of), is_consistent):
            members = tuple(of[member] for member in sorted(conflict.members))
            mixed = " and touching" * any(statements[member].direction is None for member in members)
            told = about + mixed if about == DIRECTIONS else about
            clash = Clash(members, told, relations is not None, conflict.is_smallest)
            found.setdefault(frozenset(members), clash)

    of = [at for at in numbers if tells(statements[at])]
    note(DIRECTIONS, of, consistency([statements[at] for at in of], relations))
    for aspect in _aspects(cuts):
        of = [at for at in numbers if aspect.said(statements[at]) is not None]
        note(aspect.about, of, _consistency(aspect, [statements[at] for at in of], relations))
    if relations is None:
        note("words", numbers, lambda chosen: not _contradicts([statements[numbers[at]] for at in chosen]))
    least = [clash for members, clash in found.items() if not any(other < members for other in found)]
    return sorted(least, key=lambda clash: (len(clash.members), clash.members))


def _consistency(
    aspect: _Aspect, statements: Sequence[Statement], relations: Relations | None
) -> Callable[[Numbers], bool]:
    """Whether some of the statements, by number, leave a relation possible between each two of their places."""
    names = list(dict.fromkeys(name for one in statements for name in one.names))
    number = {name: at for at, name in enumerate(names)}
    said = [(number[one.subject], number[one.object], aspect.said(one) or 0) for one in statements]
    known = [name for name in names if relations is not None and name in relations.names]
    facts = [(number[a], number[b], aspect.shown(relations, a, b)) for a, b in permutations(known, 2) if relations]
    network = algebraic_closure(aspect.calculus, len(names), facts)

    def is_consistent(chosen: Numbers) -> bool:
        told = [said[at] for at in chosen]
        return algebraic_closure(aspect.calculus, len(names), told, network) is not None

    return is_consistent


def _contradicts(statements: Sequence[Statement]) -> bool:
    """Whether one says outright what another denies: of directions and doorways no calculus knows the opposite."""
    of = _one_name_for_the_same(statements)
    asserted = {claim for one in statements if not one.negated for claim in _asserted(one)}
    told = {(relation, of[one], of[other], door) for relation, one, other, door in asserted}
    denied = {(one.relation, *(of[name] for name in one.names), one.doorway) for one in statements if one.negated}
    return bool(told & denied)


def _one_name_for_the_same(statements: Sequence[Statement]) -> dict[str, str]:
    """By name, one of all names that the same place goes by, as far as that is said."""
    of = {name: name for one in statements for name in one.names}
    for one in statements:
        if one.relation == SAME and not one.negated:
            kept, gone = (of[name] for name in one.names)
            of = {name: kept if known == gone else known for name, known in of.items()}
    return of


def _asserted(of: Statement) -> list[tuple[str, str, str, str | None]]:
    """What a statement says, and what follows from its words alone."""
    if of.direction is not None:
        ways = {of.direction, *of.direction.split("-")}
        return [(f"{way} of", *of.names, None) for way in sorted(ways)]
    if of.relation != CONNECTED:
        return []
    return [(CONNECTED, *names, door) for names in (of.names, of.names[::-1]) for door in {of.doorway, None}]


def _judged(relations: Relations, statement: Statement, where: str, cuts: DistanceCuts) -> Judged:
    try:
        missing = [_not_there(relations, name) for name in statement.names if name not in relations.names]
        if missing:
            return Judged(statement, where, None, " and ".join(dict.fromkeys(missing)), {})
        holds, because, numbers = _measured(relations, statement, cuts)
    except QualrlError as problem:
        raise type(problem)(f"{where}: {problem}" if where else str(problem)) from None
    return Judged(statement, where, holds is not statement.negated, because, numbers)


def _not_there(relations: Relations, name: str) -> str:
    regions = relations.regions
    if name in regions.all_names:
        raise UnknownNameError(f"{name!r} is a landmark; claims are about regions and zones")
    if name in regions.lost:
        return f"a robot with radius_m {regions.grid.radius_m:g} is too large for {name!r}"
    hint = did_you_mean(name, relations.names)
    return f"{name!r} is not on the map" + (f" ({hint})" if hint.startswith("did") else "")


def _measured(relations: Relations, of: Statement, cuts: DistanceCuts) -> tuple[bool, str, dict[str, Any]]:
    """Whether it holds (without its "not"), in words why, and the numbers of these words."""
    a, b = of.names
    if of.direction is not None:
        share = relations.share_towards(of.direction, a, b)
        why = f"{share:.1%} of {a} lies {of.relation} {b}, {'' if share > HALF else 'not '}more than half"
        return share > HALF, why, {"share": share}
    if of.relation == CONNECTED:
        return _joined(relations, of)
    if of.relation in DISTANCES:
        walk_m = relations.distance_m(a, b)
        name = cuts.name(walk_m)
        far = f"{walk_m:.2f} m from centre to centre is" if walk_m < math.inf else "no way leads there, so it is"
        finite = {"walk_m": walk_m if walk_m < math.inf else None, "distance": name}
        return name == DISTANCES[of.relation], f"{far} {name}", finite
    rcc8 = relations.topology(a, b)
    return rcc8 in RCC8[of.relation], f"{a} {_linked(RCC8_WORDS[rcc8])} {b} ({rcc8})", {"rcc8": rcc8}


def _counted(count: int, one: str, many: str = "s") -> str:
    return f"{count} {one}{'' if count == 1 else many}"


def _linked(words: str) -> str:
    return words if words in ("touches", "overlaps", "contains") else f"is {words}"


def _joined(relations: Relations, of: Statement) -> tuple[bool, str, dict[str, Any]]:
    for name in of.names:
        if not relations.is_region(name):
            raise SettingError(f"{name!r} is a zone, which has no doorways; write touches, overlaps or inside")
    doors = relations.doorways(*of.names)
    why = f"joined by {' and '.join(doors)}" if doors else "no doorway joins them"
    return of.doorway in doors if of.doorway else bool(doors), why, {"doorways": list(doors)}
