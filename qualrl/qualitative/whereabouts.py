"""Whether places can lie where statements say: directions, and what is inside what, taken together.

Along each axis (east, north) a place has three points: where its cells begin, their median, where they end.  More than
half of a place lies beyond a side of another one: then its median does; what lies inside another place begins and ends
no further out.  Such statements, and the map's places, are a network of the calculus of points, which algebraic closure
decides.  Beside it tiles are looked at: of what is inside a region on the map nothing can lie in a tile that the region
has no cell in, and all of it does where all of the region does.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import permutations

from qualrl.qualitative.calculus import Constraint, Network, Relation, algebraic_closure, calculus
from qualrl.qualitative.conflicts import Numbers
from qualrl.qualitative.statements import Statement
from qualrl.spatial.relations import HALF, Relations

BEGIN, MEDIAN, END = range(3)
POINTS = (BEGIN, MEDIAN, END)
AXES = (("west", "east"), ("south", "north"))
"""Directions in which coordinates fall, and grow."""
WITHIN, AROUND, SAME, OVERLAPS = "inside", "contains", "the same as", "overlaps"

Pairs = list[tuple[int, int, Relation]]
"""Points of a first and a second place, and how the first point lies to the second."""


def tells(of: Statement) -> bool:
    """Whether a statement says where a place lies; of what is denied directions alone do."""
    return of.direction is not None or (not of.negated and of.relation in (WITHIN, AROUND, SAME, OVERLAPS))


def consistency(statements: Sequence[Statement], relations: Relations | None) -> Callable[[Numbers], bool]:
    """Whether places can lie as some of the statements, by number, say; with what the map shows if it is given."""
    names = list(dict.fromkeys(name for one in statements for name in one.names))
    number = {name: at for at, name in enumerate(names)}
    known = [name for name in names if relations is not None and name in relations.names]
    point = calculus("point")
    networks = [
        algebraic_closure(point, 3 * len(names), _facts(number, known, relations, axis)) for axis in range(len(AXES))
    ]

    def said(one: Statement, axis: int) -> Iterator[Constraint]:
        for first, second, relation in _points(one, axis):
            yield 3 * number[one.subject] + first, 3 * number[one.object] + second, relation

    def fits(told: Sequence[Statement], axis: int, network: Network | None) -> bool:
        constraints = [of for one in told for of in said(one, axis)]
        return algebraic_closure(point, 3 * len(names), constraints, network) is not None

    def is_consistent(chosen: Numbers) -> bool:
        told = [statements[at] for at in sorted(chosen)]
        if not all(fits(told, axis, network) for axis, network in enumerate(networks)):
            return False
        return relations is None or _fit_tiles(told, known, relations)

    return is_consistent


def _points(of: Statement, axis: int) -> Pairs:
    """What a statement says of the points of its two places along an axis."""
    point = calculus("point")
    less, same = point.relation("<"), point.relation("=")
    no_more, no_less, more = less | same, same | point.relation(">"), point.relation(">")
    if of.negated:
        return []
    if of.direction is not None:
        falling, growing = AXES[axis]
        ways = of.direction.split("-")
        return [(MEDIAN, END, more)] * (growing in ways) + [(MEDIAN, BEGIN, less)] * (falling in ways)
    return {
        WITHIN: [(BEGIN, BEGIN, no_less), (END, END, no_more)],
        AROUND: [(BEGIN, BEGIN, no_more), (END, END, no_less)],
        SAME: [(at, at, same) for at in POINTS],
        OVERLAPS: [(BEGIN, END, no_more), (END, BEGIN, no_less)],
    }[of.relation]


def _facts(
    number: dict[str, int], known: Sequence[str], relations: Relations | None, axis: int
) -> Iterator[Constraint]:  # fmt: skip
    """How points lie to each other along an axis: those of each place, and all of the places on the map."""
    point = calculus("point")
    no_more = point.relation("<", "=")
    for at in number.values():
        yield 3 * at + BEGIN, 3 * at + MEDIAN, no_more
        yield 3 * at + MEDIAN, 3 * at + END, no_more
    if relations is None:
        return
    places = [
        (3 * number[name] + at, where)
        for name in known for at, where in zip(POINTS, relations.extent(name, axis), strict=True)
    ]  # fmt: skip
    for (one, where), (other, there) in permutations(places, 2):
        yield one, other, point.relation("<" if where < there else ">" if where > there else "=")


def _fit_tiles(told: Sequence[Statement], known: Sequence[str], relations: Relations) -> bool:
    """Whether directions hold of the places on the map that hold, or are held by, those that are spoken of."""
    within = [(one.names, one.relation == SAME) for one in told if one.relation in (WITHIN, SAME)]
    within += [(one.names[::-1], one.relation == SAME) for one in told if one.relation in (AROUND, SAME)]
    around = [(names[::-1], is_same) for names, is_same in within]
    for one in told:
        if one.direction is None:
            continue
        for holder, is_same in _reached(one.subject, within, known).items():
            for other in _reached(one.object, within if one.negated else around, known):
                share = relations.share_towards(one.direction, holder, other)
                if one.negated and (share > HALF if is_same else share == 1):
                    return False
                if not one.negated and (share <= HALF if is_same else share == 0):
                    return False
    return True


def _reached(start: str, edges: Sequence[tuple[tuple[str, str], bool]], known: Sequence[str]) -> dict[str, bool]:
    """Places on the map that hold a place (or that it holds), and whether they are the very same, by what is said."""
    found, waiting = dict[str, bool](), [(start, True)]
    while waiting:
        place, is_same = waiting.pop()
        if place in found and found[place] >= is_same:
            continue
        found[place] = is_same
        waiting += [(to, is_same and as_same) for (of, to), as_same in edges if of == place]
    return {place: is_same for place, is_same in found.items() if place in known}
