"""Which few of many statements cannot hold together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

MOST_TRIES = 20_000
"""Choices looked at for the smallest conflict; then one is told that has no smaller one inside."""

Numbers = frozenset[int]


@dataclass(frozen=True)
class Conflict:
    """Statements, by number, that cannot hold together, while any of them left out makes the rest consistent."""

    members: Numbers
    is_smallest: bool
    """Whether it is proved that no conflict has fewer."""


def conflicts(count: int, is_consistent: Callable[[Numbers], bool]) -> list[Conflict]:
    """Conflicts among ``count`` statements without common ones: a smallest, then a smallest of the rest, and so on."""
    rest, found = frozenset(range(count)), list[Conflict]()
    while not is_consistent(rest):
        found.append(smallest_conflict(rest, is_consistent))
        rest -= found[-1].members
    return found


def smallest_conflict(among: Numbers, is_consistent: Callable[[Numbers], bool]) -> Conflict:
    """A smallest conflict among statements that cannot all hold; parts of what is consistent must be consistent.

    Whatever is left out of a consistent set that cannot be enlarged has a member in each conflict.  So the smallest
    choice with a member of all such rests seen is either a conflict, and a smallest one, or shows a further rest.
    """
    rests: list[Numbers] = []
    while True:
        choice = _smallest_choice(rests)
        if choice is None:
            return Conflict(_shrunk(among, is_consistent), False)
        if not is_consistent(choice):
            return Conflict(choice, True)
        for one in sorted(among - choice):
            if is_consistent(choice | {one}):
                choice |= {one}
        rests.append(among - choice)


def _shrunk(members: Numbers, is_consistent: Callable[[Numbers], bool]) -> Numbers:
    """A conflict inside one, without any that it does not need."""
    for one in sorted(members):
        if not is_consistent(members - {one}):
            members -= {one}
    return members


def _smallest_choice(rests: Sequence[Numbers]) -> Numbers | None:
    """A smallest set with a member of each of some sets; None when that takes more than MOST_TRIES."""
    tries = MOST_TRIES

    def chosen(size: int, so_far: Numbers) -> Numbers | None:
        nonlocal tries
        tries -= 1
        missed = [rest for rest in rests if not rest & so_far]
        if not missed:
            return so_far
        if size == 0 or tries < 0:
            return None
        fewest: Numbers = min(missed, key=len)
        for one in sorted(fewest):
            found = chosen(size - 1, so_far | {one})
            if found is not None:
                return found
        return None

    for size in range(len(rests) + 1):
        found = chosen(size, frozenset())
        if found is not None:
            return found
        if tries < 0:
            return None
    raise AssertionError("a member of each is always such a set")
