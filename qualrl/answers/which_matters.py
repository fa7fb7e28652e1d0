"""Which doorways and regions a plan hangs on: what is lost without each, and the fewest doorways that cut it off."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.answers.account import LEFT, moves_made
from qualrl.answers.answer import Answer
from qualrl.answers.depth import Depth
from qualrl.answers.ways import Worth, worth_of
from qualrl.errors import SettingError
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.plan import in_steps
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import ExactValues, all_action_values, exact_values
from qualrl.spatial.region_map import Doorway, RegionMap

MOST_STEPS = 5000
"""Steps that are looked at to find what the best way hardly ever does."""


@dataclass(frozen=True)
class Loss:
    """What is lost when a doorway is closed, or all doorways of a region."""

    name: str
    kind: str
    """"doorway" or "region"."""
    loss: float | None
    """Of the value at the start; None where nothing leads to the goal any more."""
    longer_steps: int | None
    """By how many moves the shortest way is longer then."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        if self.loss is None or self.longer_steps is None:
            return f"{self.name}: every way to the goal passes it"
        if depth == Depth.NAMES:
            return f"{self.name}: without it another way is left"
        longer = f"{depth.at_numbers(f'{in_steps(self.longer_steps)} ')}longer" if self.longer_steps else "not longer"
        if depth == Depth.NUMBERS:
            return f"{self.name}: {self.loss:.3g} is lost without it; the shortest way is {longer} then"
        felt = ("something is gained", "nothing is lost", "something is lost")[1 + int(np.sign(self.loss))]
        return f"{self.name}: without it another way is left, {felt}, and the shortest way is {longer} then"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"name": self.name, "kind": self.kind, "loss": self.loss, "longer_steps": self.longer_steps}


@dataclass(frozen=True)
class WhichMatters(Answer):
    """The answer."""

    start: str
    goal: str
    gamma: float
    value: float
    """At the start, everything open."""
    losses: tuple[Loss, ...]
    """Of all doorways and regions without which something is lost, the greatest loss first.  (Where moves slip, closing
    one may gain a little; that is not listed.)
    """
    off: float
    """Losses up to this are not told from none: 0 where no move slips."""
    cut: tuple[str, ...]
    """Fewest doorways whose closing parts the start from the goal; none where both are in one region."""

    def lines(self, depth: Depth) -> Iterator[str]:
        """See Answer."""
        first = depth.at_signs(", what matters most first") if len(self.losses) > 1 else ""
        worth = depth.at_numbers(f", worth {self.value:.6g} at gamma {self.gamma:.12g}", first)
        yield f"From {self.start} to {self.goal}{worth}:"
        if not self.losses:
            to_within = depth.at_numbers(f" by more than {self.off:.1g}") if self.off else ""
            yield f"no single doorway or region matters{to_within}"
        yield from (loss.in_words(depth) for loss in self.losses)
        if not self.cut:
            yield "Start and goal are in the same region, so no doorway parts them."
        elif depth == Depth.NUMBERS:
            doors = "doorway" if len(self.cut) == 1 else "doorways"
            yield f"To cut the goal off, {len(self.cut)} {doors} must be closed at least: {', '.join(self.cut)}."
        else:
            yield f"The goal is cut off with {', '.join(self.cut)} closed{depth.from_signs(', and with no fewer')}."

    def facts(self) -> dict[str, Any]:
        """See Answer."""
        return {
            "question": "which-matters", "from": self.start, "to": self.goal, "gamma": self.gamma, "value": self.value,
            "off": self.off, "losses": [loss.to_dict() for loss in self.losses], "cut": list(self.cut),
        }  # fmt: skip


def which_matters(model: HybridMDP, start: int, names: tuple[str, str]) -> WhichMatters:
    """Ask what the way from a state to the goal hangs on.  names: what to call start and goal.

    Without slips only what the best way passes can matter: elsewhere it stays open as it is.  Where moves slip, every
    doorway is closed in turn.  Raises NoPlanError where no way leads to the goal.
    """
    if model.regions is None:
        raise SettingError("a model without a map has no doorways")
    model.check_reachable(start)
    exact = exact_values(model.world)
    now = worth_of(model.grid, exact.shifted[start], exact.shift)
    doors = model.regions.doorways
    if model.grid.slip == 0:
        doors = _passed(model, model.regions, exact_walk(model, exact, start))
    ends = {int(model.region_of[state]) for state in (start, model.grid.goal)}
    regions = sorted({region for door in doors for region in door.pair} - ends)
    closings = [(door.name, "doorway", [door]) for door in doors]
    for region in regions:
        its_doors = [door for door in model.regions.doorways if region in door.pair]
        closings.append((model.region_names[region], "region", its_doors))
    made = _moves_made(model, exact, start) if model.grid.slip else None
    losses = [_loss(model, model.regions, start, now, made, *closing) for closing in closings]
    felt = [loss for loss in losses if loss.loss is None or loss.longer_steps or loss.loss > 0]
    felt.sort(key=lambda loss: (loss.loss is not None, -(loss.loss or 0.0), loss.kind, loss.name))
    return WhichMatters(
        *names,
        model.gamma,
        now.value,
        tuple(felt),
        2 * now.off if model.grid.slip else 0.0,
        _fewest(model.regions, *(int(model.region_of[at]) for at in (start, model.grid.goal))),
    )


def _passed(model: HybridMDP, regions: RegionMap, walk: Sequence[int]) -> tuple[Doorway, ...]:
    """The doorways that a walk passes; a diagonal move may pass several at once, by either cell beside it."""
    cells = [model.cell_of(state) for state in walk]
    pairs = {frozenset((model.region_of[a], model.region_of[b])) for a, b in pairwise(walk)}
    steps = {frozenset(ends) for ends in pairwise(cells)}
    if model.grid.directions == 4:
        return tuple(
            door for door in regions.doorways if any(frozenset(ends) in steps for ends in crossings_of(regions, door))
        )
    return tuple(door for door in regions.doorways if frozenset(door.pair) in pairs)


def _moves_made(model: HybridMDP, exact: ExactValues, start: int) -> NDArray[np.float64]:
    """(S, A) how often, discounted, each move happens on the best way; infinite where that takes long to find out."""
    world = model.grid
    aims = all_action_values(world, exact.shifted, exact.shift).argmax(axis=1)
    try:
        return moves_made(world, world.successor, aims, world.successor == world.goal, start, MOST_STEPS)
    except SettingError:
        return np.full(world.successor.shape, np.inf)


def _loss(
    model: HybridMDP, regions: RegionMap, start: int, now: Worth, made: NDArray[np.float64] | None, name: str,
    kind: str, doors: Sequence[Doorway],
) -> Loss:  # fmt: skip
    """made: see ``_moves_made``.

    Whoever goes on as before until a move is stopped that now leads nowhere, and is best from there on, loses no more
    than all that can be had times how often, discounted, such a move is made.  Where that cannot be told from nothing
    (something may be gained, which is not told) and the shortest way is as long, the changed world need not be solved.
    """
    walls = [wall for door in doors for wall in crossings_of(regions, door)]
    world: GridWorld = replace(model.grid, closed=(*model.grid.closed, *walls))
    if world.steps_to_goal[start] < 0:
        return Loss(name, kind, None, None)
    longer = int(world.steps_to_goal[start]) - int(model.grid.steps_to_goal[start])
    if made is not None and not longer:
        stopped = float(made[world.successor != model.grid.successor].sum())
        if (stopped + LEFT) * (abs(world.goal_reward) + 2 * now.shift) <= 2 * now.off:
            return Loss(name, kind, 0.0, longer)
    left = exact_values(world)
    return Loss(name, kind, now.beside(worth_of(world, left.shifted[start], left.shift)), longer)


def _fewest(regions: RegionMap, start: int, goal: int) -> tuple[str, ...]:
    """A smallest set of doorways between two regions whose closing parts them; () for one region."""
    if start == goal:
        return ()
    counts = Counter(door.pair for door in regions.doorways)
    graph: nx.Graph[int] = nx.Graph()
    graph.add_weighted_edges_from(((one, other, count) for (one, other), count in counts.items()), weight="capacity")
    _, (near, _) = nx.minimum_cut(graph, start, goal)
    return tuple(door.name for door in regions.doorways if (door.pair[0] in near) != (door.pair[1] in near))
