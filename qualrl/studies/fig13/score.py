"""Figure 13: the greedy path on a map, and what float64 can still tell apart there.

S states, A moves.
"""

from functools import cached_property

import numpy as np

from qualrl.io.bundled import bundled_folder
from qualrl.io.scenario import load_scenario
from qualrl.learning.learner import Learner
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.exact import exact_values, shifted_rewards
from qualrl.solving.policy import greedy_walk
from qualrl.studies.budget import Look
from qualrl.studies.settings import Budget


class Navigation:
    """A map with a fixed start."""

    def __init__(self, budget: Budget) -> None:
        self._scenario = load_scenario(bundled_folder() / budget.scenario)
        self._within = budget.within
        self._models: dict[float, HybridMDP] = {}

    @cached_property
    def optimum(self) -> float:
        """Steps of the shortest path."""
        model = next(iter(self._models.values())) if self._models else self.model(0.999)
        return float(model.grid.steps_to_goal[model.starts[0]])

    def model(self, gamma: float) -> HybridMDP:
        """See Course."""
        if gamma not in self._models:
            self._models[gamma] = self._scenario.with_settings([f"learn.gamma={gamma}"]).build()
        return self._models[gamma]

    def look(self, model: HybridMDP, learner: Learner) -> Look:
        """Walk greedily from the start.  Values that were kept shifted are compared so."""
        learned = learner.learned()
        values = learned.q if learned.shifted_q is None else learned.shifted_q
        walk, arrived = greedy_walk(model.world, values.__getitem__, int(model.starts[0]))
        steps = float(len(walk) - 1) if arrived else np.inf
        good = steps <= self.optimum * (1 + self._within)
        ratio = steps / self.optimum if arrived else np.nan
        return Look(steps, good, {"arrives": float(arrived), "path_ratio": ratio}, tuple(walk))

    def notes(self) -> list[str]:
        """How far the moves can be told apart by their exact values, for each discount used."""
        notes = []
        for gamma, model in self._models.items():
            lost, near = indistinct(model)
            where = "" if near is None else f", {near} steps from the goal and farther (the start: {self.optimum:.0f})"
            notes.append(
                f"At gamma {gamma:g} float64 gives all moves the same value in {lost} of {len(model)} cells{where}, "
                "where values kept as value - r_min / (1 - gamma) still tell them apart."
            )
        return notes


def indistinct(model: HybridMDP) -> tuple[int, int | None]:
    """Cells whose moves have one value in float64 though not in truth, and how many steps off the nearest one is."""
    world, exact = model.grid, exact_values(model.world)
    away = (world.steps_to_goal >= 0) & (np.arange(len(world)) != world.goal)
    same = []
    for value, shift in ((exact.value, 0.0), (exact.shifted, exact.shift)):
        onward = shifted_rewards(world.move_reward, shift, world.gamma) + world.gamma * value[world.successor]
        q = np.where(world.successor == world.goal, world.goal_reward + shift, onward)
        same.append(q.max(axis=1) == q.min(axis=1))
    lost = np.flatnonzero(same[0] & ~same[1] & away)
    return len(lost), int(world.steps_to_goal[lost].min()) if len(lost) else None
