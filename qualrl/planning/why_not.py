"""Why a plan does not go by a given place: the best way that does, what it costs more, and where it would win."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.legs import legs_of
from qualrl.planning.planner import exact_walk, length_m
from qualrl.planning.stops import way_by
from qualrl.qualitative.plan_value import Contrast, contrast, course_of
from qualrl.solving.exact import exact_values


@dataclass(frozen=True)
class Way:
    """One of the ways that are compared."""

    places: tuple[str, ...]
    steps: int
    length_m: float
    value: float
    """Expected discounted return at the start, slips included."""

    def in_words(self) -> str:
        """Places and length."""
        return f"{' -> '.join(self.places)} ({self.steps} steps, {self.length_m:.2f} m)"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"places": list(self.places), "steps": self.steps, "length_m": self.length_m, "value": self.value}


@dataclass(frozen=True)
class WhyNot:
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    stops: tuple[str, ...]
    gamma: float
    best: Way
    by: Way
    contrast: Contrast | None
    """Of the best way and the one by the stops, for every gamma; None where moves slip, and values are no formula."""

    @property
    def is_by_itself(self) -> bool:
        """Whether the best way is as good as one by the stops, or is one."""
        return self.best.value - self.by.value <= 1e-9 * abs(self.best.value)

    def explain(self) -> str:
        """In words, a line a fact."""
        stops = ", then ".join(self.stops)
        lines = [
            f"Best from {self.start} to {self.goal}: {self.best.in_words()}, worth {self.best.value:.6g}.",
            f"Best by {stops}: {self.by.in_words()}, worth {self.by.value:.6g}.",
        ]
        if self.is_by_itself:
            lines.append(f"So going by {stops} costs nothing at gamma {self.gamma:g}.")
        else:
            lines.append(
                f"Going by {stops} costs {self.best.value - self.by.value:.3g} at gamma {self.gamma:g}: "
                f"{_more(self.by.steps - self.best.steps, 'steps')} and "
                f"{_more(self.by.length_m - self.best.length_m, 'm', 2)}."
            )
        if self.contrast is None:
            lines.append("For which other gamma it would pay is undecided: moves slip, so no formula of a way tells.")
        else:
            words = self.contrast.in_words("the best way", f"the way by {stops}")
            lines.append(f"Of these two ways, {words}.")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """The JSON twin of ``explain``, with the formulas and the certificate."""
        return {
            "question": "why-not", "from": self.start, "to": self.goal, "via": list(self.stops), "gamma": self.gamma,
            "best": self.best.to_dict(), "by": self.by.to_dict(), "costs": self.best.value - self.by.value,
            "contrast": None if self.contrast is None else _document(self.contrast),
            "sentences": self.explain().splitlines(),
        }  # fmt: skip


def why_not(model: HybridMDP, start: int, names: tuple[str, str], stops: Sequence[str]) -> WhyNot:
    """Ask why the plan from a state does not go by some stops (regions, doorways, landmarks), in their order.

    names: what to call start and goal.  Raises NoPlanError where no way leads there, UnknownNameError for a stop
    that is not on the map, and SettingError without a stop.
    """
    if not stops:
        raise SettingError("say by which place: a region, a doorway or a landmark")
    model.check_reachable(start)
    exact = exact_values(model.world)
    best = exact_walk(model, exact, start)
    by = way_by(model, exact, start, stops)
    compared = None
    if model.grid.slip == 0:
        compared = contrast(*(course_of(_places(model, walk), _rewards(model, walk)) for walk in (best, by.walk)))
    return WhyNot(
        names[0], names[1], tuple(stops), model.gamma, _way(model, [best], float(exact.value[start])),
        _way(model, by.parts, by.value), compared,
    )  # fmt: skip


def _way(model: HybridMDP, parts: Sequence[Sequence[int]], value: float) -> Way:
    """A way in one or more parts; where one begins, its place is told however briefly it is visited."""
    places = [model.region_names[leg.region] for part in parts for leg in legs_of(model, list(part))]
    told = tuple(place for place, _ in groupby(places))
    far_m = sum(length_m(model, part) or 0.0 for part in parts)
    return Way(told, sum(len(part) - 1 for part in parts), far_m, value)


def _places(model: HybridMDP, walk: Sequence[int]) -> list[str]:
    """The region that each step of a walk starts in."""
    return [model.region_names[region] for region in model.region_of[list(walk[:-1])].tolist()]


def _rewards(model: HybridMDP, walk: Sequence[int]) -> list[float]:
    """The reward of each step of a walk without slips."""
    world, states = model.grid, np.array(walk)
    moves = (world.successor[states[:-1]] == states[1:, None]).argmax(axis=1)
    rewards: list[float] = world.move_reward[moves].tolist()
    return [*rewards[:-1], float(world.goal_reward)] if rewards else []


def _more(amount: float, unit: str, digits: int = 0) -> str:
    return f"{abs(amount):.{digits}f} {unit} {'more' if amount >= 0 else 'fewer'}"


def _document(compared: Contrast) -> dict[str, Any]:
    return {
        "verdicts": [
            {"low": of.low, "high": of.high, "better": {1: "best", -1: "by", 0: "equal"}[of.sign]}
            for of in compared.verdicts
        ],
        "decided": compared.is_decided,
        "formulas": {"best": str(compared.first.formula()), "by": str(compared.second.formula())},
        "scale": str(compared.scale),
        "certificate": compared.signs.certificate(),
    }
