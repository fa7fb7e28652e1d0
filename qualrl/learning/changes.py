"""A world that changes while a robot learns in it: doors close and open between two episodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.models.hybrid_mdp import HybridMDP


@dataclass(frozen=True)
class Change:
    """A doorway that closes, or opens again, once so many episodes are over."""

    after: int
    door: str
    opens: bool = False

    def __str__(self) -> str:
        return f"{self.door} {'opens' if self.opens else 'closes'}"


@dataclass(frozen=True, eq=False)
class WorldChange:
    """All that changes between two episodes, and the model on either side.  States and their numbers stay."""

    after: int
    """Episodes before it."""
    changes: tuple[Change, ...]
    before: HybridMDP
    changed: HybridMDP

    @property
    def what(self) -> str:
        """In words: "door 1 closes"."""
        return " and ".join(map(str, self.changes))


def world_changes(model: HybridMDP, changes: Sequence[Change], episodes: int) -> tuple[WorldChange, ...]:
    """The changes, checked and made.  All doors of the model are open at first.

    A change after which the goal cannot be reached is refused, even if a later one opened a way again: until then
    no episode would end.  Changes after the same episode come at once.
    Raises UnknownNameError, SettingError or NoPlanError, each naming the change it is about.
    """
    _check_order(changes, episodes)
    found, closed, before = list[WorldChange](), list[str](), model
    for after, group in groupby(enumerate(changes), key=lambda numbered: numbered[1].after):
        together = list(group)
        for number, change in together:
            _apply(number, change, closed, model)
        changed = model.with_closed(closed)
        event = WorldChange(after, tuple(change for _, change in together), before, changed)
        if not changed.can_reach[model.starts].all():
            where = model.describe(int(model.starts[~changed.can_reach[model.starts]][0]))
            raise NoPlanError(
                f"changes[{together[-1][0]}]: after episode {after} {event.what}, and no way leads from {where} "
                f"to the goal any more; leave a way open"
            )
        found.append(event)
        before = changed
    return tuple(found)


def _check_order(changes: Sequence[Change], episodes: int) -> None:
    last = 1
    for number, change in enumerate(changes):
        if not 1 <= change.after < episodes:
            raise SettingError(
                f"changes[{number}]: after must be from 1 to {episodes - 1}, as there are {episodes} episodes, "
                f"got {change.after}"
            )
        if change.after < last:
            raise SettingError(f"changes[{number}]: changes must be in order, but {change.after} follows {last}")
        last = change.after


def _apply(number: int, change: Change, closed: list[str], model: HybridMDP) -> None:
    """Note in ``closed`` what a change does."""
    if model.regions is None:
        raise SettingError("changes need a model with a map, which has doors")
    doors = [door.name for door in model.regions.doorways]
    if change.door not in doors:
        raise UnknownNameError(f"changes[{number}]: {model.regions.why_not(change.door, 'no doorway', doors)}")
    if (change.door in closed) != change.opens:
        raise SettingError(f"changes[{number}]: {change.door} is {'open' if change.opens else 'closed'} already")
    if change.opens:
        closed.remove(change.door)
    else:
        closed.append(change.door)
