"""Which of two ways is better at which gamma, while moves slip: proved for a range, from values at some in it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

from qualrl.answers.depth import Depth
from qualrl.answers.uncertain import check_span
from qualrl.errors import SettingError
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.qualitative.arrivals import Solved, left_open, sign_between
from qualrl.qualitative.plan_value import Verdict, told_apart
from qualrl.qualitative.signs import one_after_the_other
from qualrl.solving.exact import ExactValues, exact_values, shift_of

FIRST_SOLVED, MOST_SOLVED = 6, 48
NARROW = 0.002
"""What is undecided is left so once gamma's distance from 1 changes by a smaller share across it."""
NARROWEST = 1e-9
"""On the same scale, a range that is narrower is lost in rounding."""
FEWEST = 1e-280
"""A smaller share of the shift is not computed to all its digits."""

UNDECIDED = "undecided: moves slip, so no formula of a way tells; a range of gammas to look at can be asked for"
"""Where that was not done."""

Span = tuple[float, float]


@dataclass(frozen=True)
class OverGamma:
    """Two ways compared for all gammas of a range."""

    solved: tuple[Solved, ...]
    """By gamma; both ends of the range among them."""
    verdicts: tuple[Verdict, ...]
    """In order, without gaps; of sign 0 where it is undecided."""

    def in_words(self, first: str, second: str, depth: Depth) -> str:
        """The verdicts in one sentence; ``first`` and ``second`` say what to call the two."""
        called = {1: first, -1: second, 0: "undecided"}
        told = [of for of in self.verdicts if of.sign]
        cuts = told_apart([*(of.low for of in self.verdicts), self.verdicts[-1].high])
        every = f"every gamma {depth.at_numbers(f'from {cuts[0]} to {cuts[-1]}', 'asked about')}"
        if not told:
            return f"which of {first} and {second} is worth more is undecided for {every}"
        if len(self.verdicts) == 1:
            return f"for {every} {called[told[0].sign]} is worth more: proved"
        if depth != Depth.NUMBERS:
            return f"worth more is {one_after_the_other([called[of.sign] for of in self.verdicts], 'gamma')}: proved"
        parts = list(zip(self.verdicts, cuts[:-1], cuts[1:], strict=True))
        spans = ", ".join(f"{called[of.sign]} for gamma from {low} to {high}" for of, low, high in parts if of.sign)
        rest = [f"{low} to {high}" for of, low, high in parts if not of.sign]
        undecided = f"; undecided from {', '.join(rest)}" if rest else ""
        return f"worth more is {spans}: proved{undecided}"

    def to_dict(self, first: str, second: str) -> dict[str, Any]:
        """As JSON; ``first`` and ``second`` are the keys of the two."""
        better = {1: first, -1: second, 0: "undecided"}
        return {
            "verdicts": [{"low": of.low, "high": of.high, "better": better[of.sign]} for of in self.verdicts],
            "solved": [{"gamma": of.gamma, first: of.logs[0], second: of.logs[1]} for of in self.solved],
        }


def over_gamma(
    model: HybridMDP, gammas: Span, worth: Callable[[HybridMDP, ExactValues], tuple[float, float]]
) -> OverGamma:
    """Compare two ways for all gammas of a range.

    worth: the shifted values of both ways in a model, which differs from ``model`` in gamma, and in rewards that order
    ways alike, from the exact values of that.
    Raises SettingError for what is no range, where no move slips, and for a gamma so small that floating point cannot
    hold what the ways are worth.
    """
    check_gammas(model, gammas)

    def solve(gamma: float) -> Solved:
        changed, exact = _at(model, gamma)
        shifted = worth(changed, exact)
        if min(shifted) < FEWEST * exact.shift:
            raise SettingError(
                f"gamma {gamma:.6g} is too small: the goal is so far off that floating point cannot tell what the ways "
                "are worth; ask from a larger one"
            )
        if not _are_alike(model):
            return Solved(changed.gamma, (math.log(shifted[0]), math.log(shifted[1])), _most(changed.grid))
        return Solved(changed.gamma, (math.log(shifted[0] / exact.shift), math.log(shifted[1] / exact.shift)))

    points = _solved(solve, *gammas)
    signs = [sign_between(points, at) for at in range(len(points) - 1)]
    return OverGamma(tuple(points), _joined(points, signs))


def check_gammas(model: HybridMDP, gammas: Span) -> None:
    """Raise SettingError for what is no range of gammas, or none that can be told about in a model."""
    check_span("gamma", gammas, 0, 1)
    low, high = gammas
    if not 0 < low < high < 1:
        fault = "must lie within (0, 1)" if low < high else "goes from a smaller one to a larger"
        raise SettingError(f"a range of gammas {fault}, got {low:g}..{high:g}")
    if _nearness(gammas[1]) - _nearness(gammas[0]) < NARROWEST:
        raise SettingError(f"a range from {gammas[0]!r} to {gammas[1]!r} is too narrow for points in it to differ")
    if model.grid.slip == 0:
        raise SettingError("no move slips, so the answer tells of every gamma as it is: ask without a range of gammas")


def _are_alike(model: HybridMDP) -> bool:
    """Whether all steps are paid alike, and no diagonal one is dearer."""
    return len(set(model.grid.move_reward.tolist())) == 1


def _at(model: HybridMDP, gamma: float) -> tuple[HybridMDP, ExactValues]:
    """The model at another gamma: its shifted values are sums of powers of gamma, see ``qualitative.arrivals``.

    Where steps are paid alike, they are paid -1 and nothing at the goal: so the sums are shift * E[gamma ** (T - 1)].
    """
    world = replace(model.grid, gamma=gamma)
    if _are_alike(model):
        world = replace(world, step_reward=-1.0, goal_reward=0.0)
    return replace(model, world=world), exact_values(world)


def _most(world: GridWorld) -> Span:
    """(u, logarithm) that no policy is above, halfway from the logarithm of gamma to 0: each step for nothing."""
    halfway = replace(world, gamma=math.sqrt(world.gamma))
    return math.log(halfway.gamma), math.log(shift_of(halfway) + max(world.goal_reward, 0.0))


def _solved(solve: Callable[..., Solved], low: float, high: float) -> list[Solved]:
    """Points from one gamma to another, more of them where it is not clear which way is better."""
    far, near = _nearness(low), _nearness(high)
    spread = (far + (near - far) * at / (FIRST_SOLVED - 1) for at in range(1, FIRST_SOLVED - 1))
    points = [solve(low), *(solve(_gamma(of)) for of in spread), solve(high)]
    while len(points) < MOST_SOLVED:
        undecided = [
            at for at in range(len(points) - 1)
            if sign_between(points, at) == 0 and (points[at].sign or points[at + 1].sign)
            and _nearness(points[at + 1].gamma) - _nearness(points[at].gamma) >= NARROW
        ]  # fmt: skip
        if not undecided:
            break
        at = min(undecided, key=lambda at: left_open(points, at))
        points.insert(at + 1, solve(_gamma((_nearness(points[at].gamma) + _nearness(points[at + 1].gamma)) / 2)))
    return points


def _nearness(gamma: float) -> float:
    """How near gamma is to 1, on a scale on which each tenth of the distance is as long as the one before."""
    return -math.log(-math.log(gamma))


def _gamma(nearness: float) -> float:
    return math.exp(-math.exp(-nearness))


def _joined(points: Sequence[Solved], signs: Sequence[int]) -> tuple[Verdict, ...]:
    """Neighbours of one kind as one."""
    found = []
    for sign, group in groupby(range(len(signs)), key=signs.__getitem__):
        of = list(group)
        found.append(Verdict(points[of[0]].gamma, points[of[-1] + 1].gamma, sign))
    return tuple(found)
