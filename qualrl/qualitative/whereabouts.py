"""Whether places can lie where statements say: directions, and what is inside what, taken together.

Along each axis (east, north) a place has four points: where its cells begin, the two in their middle (of an odd number
the same), where they end.  More than half of a place lies beyond a side of another one where both in its middle do,
and only there; what lies inside another place begins and ends no further out.  Such statements, straight directions
that are denied, and the map's places say of points that one is less than another, or no more.  Of the calculus of
points that is a part in which algebraic closure comes down to this: they clash where they lead in a circle with a
"less" in it.  Tiles are looked at, too: of what is inside a region on the map nothing can lie in a tile that the region
has no cell in, and all of it does where all of the region does.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from qualrl.qualitative.conflicts import Numbers
from qualrl.qualitative.statements import Statement
from qualrl.spatial.relations import HALF, Relations

POINTS = BEGIN, LOWER, UPPER, END = tuple(range(4))
AXES = (("west", "east"), ("south", "north"))
"""Directions in which coordinates fall, and grow."""
WITHIN, HOLDING, SAME, OVERLAPS = "inside", "contains", "the same as", "overlaps"

Order = tuple[int, int, bool]
"""Two points, the first no more than the second; and whether it is less.  A place's points are four times its number
and one of POINTS."""


def tells(of: Statement) -> bool:
    """Whether a statement says where a place lies; of what is denied directions alone do."""
    return of.direction is not None or (not of.negated and of.relation in (WITHIN, HOLDING, SAME, OVERLAPS))


def consistency(statements: Sequence[Statement], relations: Relations | None) -> Callable[[Numbers], bool]:
    """Whether places can lie as some of the statements, by number, say; with what the map shows if it is given."""
    names = list(dict.fromkeys(name for one in statements for name in one.names))
    number = {name: at for at, name in enumerate(names)}
    known = [name for name in names if relations is not None and name in relations.names]
    facts = [[*_facts(number, known, relations, axis)] for axis in range(len(AXES))]
    said = [[[*_orders(one, number, axis)] for one in statements] for axis in range(len(AXES))]

    def is_consistent(chosen: Numbers) -> bool:
        for shown, told in zip(facts, said, strict=True):
            if not is_ordered(len(POINTS) * len(names), shown + [order for at in chosen for order in told[at]]):
                return False
        return relations is None or _fit_tiles([statements[at] for at in chosen], known, relations)

    return is_consistent


def is_ordered(points: int, orders: Sequence[Order]) -> bool:
    """Whether points can be numbers of these orders: no circle of them has a "less" in it."""
    if not orders:
        return True
    low, high, is_less = np.array(orders, np.int64).T
    graph = csr_array((np.ones(len(low), np.int32), (low, high)), shape=(points, points))
    _, circle = connected_components(graph, connection="strong")
    return not (is_less.astype(bool) & (circle[low] == circle[high])).any()


def _orders(of: Statement, number: dict[str, int], axis: int) -> list[Order]:
    """What a statement says of the points of its two places along an axis."""
    one, other = (len(POINTS) * number[name] for name in of.names)
    if of.direction is not None and of.negated:  # of a corner it may be either side that it does not lie beyond
        falling, growing = (way == of.direction for way in AXES[axis])
        return [(one + LOWER, other + END, False)] * growing + [(other + BEGIN, one + UPPER, False)] * falling
    if of.direction is not None:
        falling, growing = (way in of.direction.split("-") for way in AXES[axis])
        return [(other + END, one + LOWER, True)] * growing + [(one + UPPER, other + BEGIN, True)] * falling
    within = [(other + BEGIN, one + BEGIN, False), (one + END, other + END, False)]
    holding = [(one + BEGIN, other + BEGIN, False), (other + END, one + END, False)]
    middles = [(a + at, b + at, False) for a, b in ((one, other), (other, one)) for at in (LOWER, UPPER)]
    return {
        WITHIN: within, HOLDING: holding, SAME: within + holding + middles,
        OVERLAPS: [(one + BEGIN, other + END, False), (other + BEGIN, one + END, False)],
    }[of.relation]  # fmt: skip


def _facts(
    number: dict[str, int], known: Sequence[str], relations: Relations | None, axis: int
) -> Iterator[Order]:  # fmt: skip
    """The order of the points of each place, and of all points of the places on the map, along an axis."""
    for at in number.values():
        yield from ((len(POINTS) * at + low, len(POINTS) * at + high, False) for low, high in pairwise(POINTS))
    if relations is None:
        return
    places = sorted(
        (where, len(POINTS) * number[name] + at)
        for name in known for at, where in zip(POINTS, relations.extent(name, axis), strict=True)
    )  # fmt: skip
    for (where, one), (there, other) in pairwise(places):
        yield one, other, where < there
        if where == there:
            yield other, one, False


def _fit_tiles(told: Sequence[Statement], known: Sequence[str], relations: Relations) -> bool:
    """Whether directions hold of the places on the map that hold, or are held by, those that are spoken of."""
    within = [(one.names, one.relation == SAME) for one in told if one.relation in (WITHIN, SAME)]
    within += [(one.names[::-1], one.relation == SAME) for one in told if one.relation in (HOLDING, SAME)]
    holding = [(names[::-1], is_same) for names, is_same in within]
    for one in told:
        if one.direction is None:
            continue
        for holder, is_same in _reached(one.subject, within, known).items():
            for other in _reached(one.object, within if one.negated else holding, known):
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
