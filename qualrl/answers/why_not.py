"""Why a plan does not go by a given place: the best way that does, what it costs more, and where it would win."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from qualrl.answers.answer import Answer
from qualrl.answers.depth import Depth
from qualrl.answers.over_gamma import UNDECIDED, OverGamma, Span, over_gamma
from qualrl.answers.stops import way_by, worth_by
from qualrl.answers.ways import Way, course, longer, way_of
from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.plan_value import Contrast, contrast
from qualrl.solving.exact import exact_values


@dataclass(frozen=True)
class WhyNot(Answer):
    """The answer; everything that its sentences say stands in its fields."""

    start: str
    goal: str
    stops: tuple[str, ...]
    gamma: float
    best: Way
    by: Way
    contrast: Contrast | None
    """Of the best way and the one by the stops, for every gamma; None where moves slip, and values are no formula."""
    over_gamma: OverGamma | None = None
    """The same for a range of gammas, where moves slip; None unless asked for."""

    @property
    def is_by_itself(self) -> bool:
        """Whether the best way is as good as one by the stops, or is one."""
        return self.costs <= 0

    @property
    def costs(self) -> float:
        """By how much the best way is worth more."""
        return self.best.worth.beside(self.by.worth)

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        stops = ", then ".join(self.stops)
        yield f"Best from {self.start} to {self.goal}: {self.best.with_worth(depth)}."
        yield f"Best by {stops}: {self.by.with_worth(depth)}."
        if depth == Depth.NAMES:
            return
        at = depth.at_numbers(f" at gamma {self.gamma:g}")
        if self.is_by_itself:
            yield f"So going by {stops} costs nothing{at}."
        else:
            cost = depth.at_numbers(f"{self.costs:.3g}", "something")
            yield f"Going by {stops} costs {cost}{at}: {longer(self.by, self.best, depth)}."
        if self.contrast is not None:
            words = self.contrast.in_words("the best way", f"the way by {stops}", depth == Depth.NUMBERS)
            yield f"Of these two ways, {words}."
        elif self.over_gamma is not None:
            words = self.over_gamma.in_words("the best of all", f"the best by {stops}", depth)
            yield f"Of the best ways at each gamma, {words}."
        else:
            yield f"For which other gamma it would pay is {UNDECIDED}."

    def facts(self) -> dict[str, Any]:
        """See Answer; with the formulas and the certificate."""
        return {
            "question": "why-not", "from": self.start, "to": self.goal, "via": list(self.stops), "gamma": self.gamma,
            "best": self.best.to_dict(), "by": self.by.to_dict(), "costs": self.costs,
            "contrast": None if self.contrast is None else self.contrast.to_dict("best", "by"),
            "over_gamma": None if self.over_gamma is None else self.over_gamma.to_dict("best", "by"),
        }  # fmt: skip


def why_not(
    model: HybridMDP, start: int, names: tuple[str, str], stops: Sequence[str], gammas: Span | None = None
) -> WhyNot:
    """Ask why the plan from a state does not go by some stops (regions, doorways, landmarks), in their order.

    names: what to call start and goal.  gammas: a range to compare the two for, where moves slip.
    Raises NoPlanError where no way leads there, UnknownNameError for a stop that is not on the map, and SettingError
    without a stop, or for a range that cannot be told about.
    """
    if not stops:
        raise SettingError("say by which place: a region, a doorway or a landmark")
    model.check_reachable(start)
    exact = exact_values(model.world)
    best = exact_walk(model, exact, start)
    by = way_by(model, exact, start, stops)
    compared = None
    if model.grid.slip == 0:
        compared = contrast(course(model, best), course(model, by.walk))
    ranged = None
    if gammas is not None:
        ranged = over_gamma(model, gammas, lambda at, of: (float(of.shifted[start]), worth_by(at, of, start, stops)))
    return WhyNot(
        names[0], names[1], tuple(stops), model.gamma, way_of(model, [best], exact.shifted[start], exact.shift),
        way_of(model, by.parts, by.shifted, exact.shift), compared, ranged,
    )  # fmt: skip
