"""Plans: the places to pass, the step to take in each and why, and the metric path.

Values are expected discounted returns, as the scenario's rewards add up; lengths are metres.
"""

from dataclasses import dataclass
from typing import Any

from qualrl.planning.on_the_way import SIDES
from qualrl.spatial.occupancy_grid import Cell

MOST_PASSED = 5
"""So many landmarks of a step are named in words; JSON has all."""


def in_steps(count: int) -> str:
    """A number of steps in words.

    >>> in_steps(1), in_steps(20)
    ('1 step', '20 steps')
    """
    return f"{count} step{'' if count == 1 else 's'}"


@dataclass(frozen=True)
class Step:
    """One qualitative action of a plan, and the numbers that its reason stands on."""

    place: str
    """Where it starts ("from" in JSON)."""
    action: str
    to: str
    value: float
    """Value of this action where the place is entered: of leaving by its doorway, whatever slips do."""
    reason: str
    runner_up: str | None
    """The best action not taken; None when there is no other."""
    runner_up_value: float | None
    margin: float | None
    """value - runner_up_value, computed without their common part."""
    steps: int
    """Moves on the metric path until the next place is entered."""
    length_m: float | None
    side: str | None = None
    """Where the way out (or the goal) lies from where one comes in: "left", "right", "straight" or "back"; None where
    the plan starts, for the goal right there, and without a map."""
    passes: tuple[str, ...] = ()
    """Landmarks passed on the way, in their order."""
    compass: str | None = None
    """Where the plan starts: in which of eight directions on the map the way out or the goal lies; else None."""
    free_value: float | None = None
    """What it is worth to go on as is best, even where slips make another doorway better or a way leads over another
    region's border for a moment; None where that is as much."""

    def in_words(self) -> str:
        """As a line of the plan."""
        side = f"{SIDES[self.side]}, " if self.side else f"to the {self.compass}, " if self.compass else ""
        rest = [f"{len(self.passes) - MOST_PASSED} more"] if len(self.passes) > MOST_PASSED else []
        past = f", past {', '.join([*self.passes[:MOST_PASSED], *rest])}" if self.passes else ""
        far = "" if self.length_m is None else f" ({self.length_m:.2f} m{past})"
        return f"In {self.place}, {side}{self.action}{far}: {self.reason}."

    def to_dict(self) -> dict[str, Any]:
        """As in plan.json."""
        return {
            "from": self.place,
            "action": self.action,
            "to": self.to,
            "value": self.value,
            "free_value": self.free_value,
            "reason": self.reason,
            "runner_up": self.runner_up,
            "runner_up_value": self.runner_up_value,
            "margin": self.margin,
            "length_steps": self.steps,
            "length_m": self.length_m,
            "side": self.side,
            "compass": self.compass,
            "passes": list(self.passes),
        }


@dataclass(frozen=True)
class Plan:
    """A way from a start to a goal."""

    start: str
    goal: str
    places: tuple[str, ...]
    """The regions passed, in order."""
    steps: tuple[Step, ...]
    path: tuple[Cell, ...]
    """(row, column) of every cell, start and goal included; empty for a model without a map."""
    length_steps: int
    length_m: float | None
    """Metres; None for a model without a map."""
    shortest_steps: int | None
    """Least number of moves from start to goal, by breadth-first search; None for a model without a map."""
    value: float
    """Expected discounted return at the start, by the values the plan was made from."""
    source: str
    """"exact", or the learner whose values the plan follows."""
    notes: tuple[str, ...] = ()
    """What a reader should know, one sentence each."""

    def explain(self) -> str:
        """The plan in words, a line a step."""
        length = in_steps(self.length_steps) + ("" if self.length_m is None else f", {self.length_m:.2f} m")
        lines = [f"From {self.start} to {self.goal}: {' -> '.join(self.places)} ({length})."]
        lines += [f"{number}. {step.in_words()}" for number, step in enumerate(self.steps, 1)]
        return "\n".join([*lines, *self.notes])

    def to_dict(self) -> dict[str, Any]:
        """As in plan.json: plain numbers, strings and lists."""
        return {
            "start": self.start,
            "goal": self.goal,
            "source": self.source,
            "places": list(self.places),
            "steps": [step.to_dict() for step in self.steps],
            "path": [list(cell) for cell in self.path],
            "length_steps": self.length_steps,
            "length_m": self.length_m,
            "shortest_steps": self.shortest_steps,
            "value": self.value,
            "notes": list(self.notes),
        }
