"""The sections ``changes`` and ``online`` of a scenario: a world that changes, and a map that is not known."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from qualrl.io.scenario_learn import Count, Strict
from qualrl.spatial.place import MOST_CHARACTERS

if TYPE_CHECKING:  # what learns is heavy, and loads when something is learned
    from qualrl.learning.changes import Change

Door = Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS)]


class ChangeSetting(Strict):
    """A doorway that closes or opens while the robot learns."""

    after: Count = Field(description="after so many episodes")
    close: Door | None = Field(default=None, description="the doorway that closes")
    open: Door | None = Field(default=None, description="the doorway that opens again")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.close is None) == (self.open is None):
            raise ValueError("must say either 'close: DOORWAY' or 'open: DOORWAY'")
        return self


class OnlineSettings(Strict):
    """A robot that does not know the map, and sees what is near."""

    radius_m: float = Field(default=4.0, gt=0, description="how far it sees")
    growth: float = Field(
        default=0.1, gt=0, description="regions are found anew when the known area grew by this share"
    )


def changes_of(settings: Sequence[ChangeSetting]) -> "tuple[Change, ...]":
    """The changes as the trainer takes them."""
    from qualrl.learning.changes import Change

    return tuple(Change(at.after, at.close or at.open or "", at.open is not None) for at in settings)
