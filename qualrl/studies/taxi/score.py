"""The taxi: what a greedy policy is worth over all starts, exactly.

S states, A actions.  N nodes: a state and the tasks that run there.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.io.gymnasium_world import MISSING, has_gymnasium, taxi_model
from qualrl.learning.hierarchical import MaxqLearner
from qualrl.learning.learner import Learned, Learner
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.solving.exact import action_values, exact_values
from qualrl.solving.policy_values import policy_values
from qualrl.studies.budget import Look
from qualrl.studies.settings import Budget

MOST_STEPS = 200
"""Of a walk whose rewards are not discounted: where Gymnasium's own time limit ends an episode."""

Actions = NDArray[np.int8]
States = NDArray[np.int64]


class TaxiCourse:
    """The taxi from all of its starts."""

    def __init__(self, budget: Budget) -> None:
        if not has_gymnasium():
            raise SettingError(MISSING)
        self._within = budget.within
        self._models: dict[float, HybridMDP] = {}

    def model(self, gamma: float) -> HybridMDP:
        """See Course."""
        if gamma not in self._models:
            self._models[gamma] = taxi_model(gamma)
        return self._models[gamma]

    @cached_property
    def optimum(self) -> float:
        """Mean optimal value over all starts."""
        (model,) = self._models.values()
        return float(exact_values(model.world).value[model.starts].mean())

    def look(self, model: HybridMDP, learner: Learner) -> Look:
        """Evaluate the greedy policy: of a task graph the one that keeps to a task until it is over."""
        table = _table(model)
        if isinstance(learner, MaxqLearner):
            table, starts = obeying(learner, table, model.starts)
            actions = np.zeros(len(table), np.int8)
        else:
            starts, actions = model.starts, greedy_actions(learner.learned())
        value = float(policy_values(table, actions)[starts].mean())
        good = value >= self.optimum - self._within * abs(self.optimum)
        return Look(value, good, {"mean_value": value, "mean_return": mean_return(table, actions, starts)})

    def notes(self) -> list[str]:
        """The optimum."""
        (model,) = self._models.values()
        exact = exact_values(model.world)
        states = range(len(model))
        best = [int(action_values(model.world, exact.shifted, exact.shift, state).argmax()) for state in states]
        undiscounted = mean_return(_table(model), np.array(best, np.int8), model.starts)
        return [
            f"optimum over all {len(model.starts)} starts: mean value {self.optimum:.4g} at gamma {model.gamma:g}, "
            f"mean return without discount {undiscounted:.4g}."
        ]


def greedy_actions(learned: Learned) -> Actions:
    """(S,) the best action of each state; the first of several."""
    values = learned.q if learned.shifted_q is None else learned.shifted_q
    return np.asarray(values.argmax(axis=1), np.int8)


def mean_return(table: TabularMDP, actions: Actions, starts: States) -> float:
    """Mean sum of rewards over all starts of a policy, cut off as Gymnasium does; nothing may slip."""
    entry = table.row_start[np.arange(len(table)) * table.n_actions + actions]
    state, total = starts, 0.0
    for _ in range(MOST_STEPS):
        state = state[~table.terminal[state]]
        total += float(table.reward[entry[state]].sum())
        state = table.target[entry[state]].astype(np.int64)
    return total / len(starts)


Node = tuple[int, tuple[int, ...] | None]


def obeying(learner: MaxqLearner, table: TabularMDP, starts: States) -> tuple[TabularMDP, States]:
    """(the chain of nodes that a greedy hierarchy walks, with a single action; the nodes of the starts)."""
    nodes: dict[Node, int] = {(int(state), None): at for at, state in enumerate(starts)}
    waiting, rows, terminal = list(nodes), list[list[tuple[float, int, float]]](), list[bool]()
    for state, running in waiting:  # grows on the way
        ended = bool(table.terminal[state])
        now, move, _ = ((), 0, True) if ended else learner.greedy_step(state, running)
        row = state * table.n_actions + move
        outcomes = list[tuple[float, int, float]]()
        for entry in range(int(table.row_start[row]), int(table.row_start[row + 1])):
            node: Node = (int(table.target[entry]), now)
            if node not in nodes:
                nodes[node] = len(nodes)
                waiting.append(node)
            outcomes.append((float(table.probability[entry]), nodes[node], float(table.reward[entry])))
        rows.append(outcomes)
        terminal.append(ended)
    columns = np.array([outcome for outcomes in rows for outcome in outcomes])
    row_start = np.concatenate([[0], np.cumsum([len(outcomes) for outcomes in rows])])
    chain = TabularMDP(
        row_start, columns[:, 1].astype(np.uint32), columns[:, 0].copy(), columns[:, 2].copy(),
        np.array(terminal), table.gamma, ("go on",),
    )  # fmt: skip
    return chain, np.arange(len(starts))


def _table(model: HybridMDP) -> TabularMDP:
    assert isinstance(model.world, TabularMDP)
    return model.world
