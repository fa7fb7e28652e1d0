"""What the values of hierarchical learners tend to, by dynamic programming over what each may choose."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from qualrl.learning.hierarchical import worst_return
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.hybrid_mdp import HybridMDP
from tests import oracles
from tests import oracles_task_limits as limits
from tests import oracles_tasks as twins
from tests.hierarchical_worlds import (
    best_of,
    dense,
    detour_model,
    finished,
    halves,
    inner_values,
    model_of,
    stepper,
    tasks_of,
    top_values,
)


@pytest.mark.parametrize("algorithm", ["option-q", "intra-option-q"])
@pytest.mark.parametrize("primitives", [True, False])
def test_options_tend_to_the_best_over_them_and_with_single_moves_to_the_optimum(algorithm, primitives):
    model = detour_model(None)
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    choice_value = limits.best_over_options(marks, *dense(model), 0.9, primitives)
    value = np.zeros(len(model))
    chosen = LearnSettings(episodes=30_000, alpha=1.0, epsilon=0.5, primitives=primitives)
    learner = finished(start_learner(model, algorithm, chosen, 0))
    for s in range(len(model)):
        for choice, found in top_values(learner, marks, s).items():
            assert found == pytest.approx(choice_value[s, choice], abs=1e-9)
            value[s] = max(value[s], choice_value[s, choice])
    flat = np.array(list(oracles.GridTwin(model.grid.free, (5, 5)).values(0.9).values()))
    assert (np.abs(value - flat).max() < 1e-9) == primitives
    assert learner.learned().q.max(axis=1) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("primitives", [True, False])
def test_hamq_tends_to_the_best_policy_of_the_machine(primitives):
    model = detour_model(None)
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    wanted = best_of(limits.best_machine(marks, *dense(model), 0.9, primitives), len(model))
    learner = finished(
        start_learner(model, "hamq", LearnSettings(episodes=30_000, alpha=1.0, epsilon=0.5, primitives=primitives), 0)
    )
    top = [max(top_values(learner, marks, s).values(), default=0.0) for s in range(len(model))]
    assert top == pytest.approx(wanted, abs=1e-9)
    flat = list(oracles.GridTwin(model.grid.free, (5, 5)).values(0.9).values())
    assert (top == pytest.approx(flat, abs=1e-9)) == primitives


@cache
def slippery():
    """(model, landmarks of the twin, chance, reward): one landmark between two halves of an open room.

    Every move slips in its own way and costs something else, so that nothing ties: where two moves are as good for
    a sub-agent, it may be told apart by nothing which of them it makes, though others care.
    """
    room = model_of(np.ones((4, 6), bool), (3, 5), {(0, 2): (0, 1)}, slip=0.2)
    table, draw = room.grid.table(), np.random.default_rng(11)
    weight = table.probability * draw.uniform(0.5, 1.5, table.probability.size)
    weight /= np.repeat(np.add.reduceat(weight, table.row_start[:-1]), np.diff(table.row_start))
    reward = table.reward + draw.uniform(-0.5, 0.5, table.reward.size)
    fields = {name: getattr(room, name) for name in room.__dataclass_fields__}
    model = HybridMDP(**(fields | {"world": replace(table, probability=weight, reward=reward)}))
    _, likely, terminal = stepper(model)
    return model, twins.Landmarks(model, likely, terminal), *dense(model)


LIMITS = {
    "option-q": limits.best_over_options,
    "intra-option-q": limits.best_over_options,
    "hamq": limits.best_machine,
    "switch": limits.best_switch,
}


SLOWING = "1/(1+k)**0.8"


def recursive(primitives, epsilon=0.0):
    model, _, *world = slippery()
    return limits.recursive_optimum(tasks_of(model, primitives), *world, 0.9, epsilon)[0]


def test_the_limits_under_slip_are_far_from_each_other_unless_single_moves_are_offered():
    """So that a learner which comes near the one has not come near another."""
    model, marks, *world = slippery()
    for primitives in (True, False):
        found = [limit(marks, *world, 0.9, primitives) for limit in {*LIMITS.values()}]
        values = np.array([best_of(one, len(model)) for one in [*found, recursive(primitives)]])
        apart = [np.abs(one - other).max() for one, other in combinations(values, 2)]
        assert (max(apart) < 1e-9) if primitives else (min(apart) > 6)
        best = values.max(axis=0)
        flat = np.where(model.world.terminal, 0.0, (world[1] + 0.9 * world[0] @ best).max(axis=1))
        assert (np.abs(best - flat).max() < 1e-9) == primitives


def errors_of(learner, sizes, error):
    """What error() says after so many steps in all."""
    found, made = [], 0
    for size in sizes:
        made += learner.advance(size - made)
        found.append(error())
    return found


@pytest.mark.parametrize("algorithm", list(LIMITS))
@pytest.mark.parametrize("primitives", [True, False])
def test_under_slip_values_tend_to_their_limit_as_the_learning_rate_falls(algorithm, primitives):
    model, marks, *world = slippery()
    wanted = LIMITS[algorithm](marks, *world, 0.9, primitives)
    chosen = LearnSettings(episodes=10**6, alpha=SLOWING, epsilon=0.5, primitives=primitives)
    learner = start_learner(model, algorithm, chosen, 0)

    def error():
        found = {(s, c): v for s in range(len(model)) for c, v in top_values(learner, marks, s).items()}
        assert found.keys() >= wanted.keys()
        return max(abs(found[key] - wanted[key]) for key in wanted)

    early, late = errors_of(learner, [20_000, 6_000_000], error)
    assert late < min(2.0, early / 4)


@pytest.mark.parametrize("algorithm", ["switch", "w-learning"])
def test_under_slip_sub_agents_tend_to_the_optimum_of_their_own_tasks(algorithm):
    """Not to that of other tasks: of another discount, or where ending elsewhere costs nothing."""
    model, marks, *world = slippery()
    worst, bound = (None, 0.05) if algorithm == "switch" else (worst_return(model), 1.5)
    wanted = limits.best_of_agents(marks, *world, 0.9, worst)
    other = limits.best_of_agents(marks, *world, 0.8 if worst is None else 0.9, worst and 0.0)
    assert max(np.abs(wanted[key] - other[key]).max() for key in wanted) > 5 * bound
    learner = start_learner(model, algorithm, LearnSettings(episodes=10**6, alpha=SLOWING, epsilon=0.5), 0)

    def error():
        found = {(o, s): list(inner_values(learner, marks, s, o).values()) for o, s in wanted}
        return max(np.abs(np.array(found[key]) - wanted[key]).max() for key in wanted)

    early, late = errors_of(learner, [20_000, 4_000_000], error)
    assert late < min(bound, early / 4)


def test_a_switch_settles_only_between_what_the_moves_are_worth_that_tie_for_a_sub_agent():
    """Two ways as short to a landmark, of which one goes past a better place to change one's mind."""
    model = model_of(np.ones((5, 7), bool), (3, 6), {(2, 2): (0, 1), (4, 3): (0, 1)})
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    low, high = (limits.best_switch(marks, *dense(model), 0.9, False, of_ties) for of_ties in (min, max))
    assert max(high[key] - low[key] for key in low) > 15
    learner = start_learner(model, "switch", LearnSettings(episodes=10**6, alpha=SLOWING, epsilon=0.5), 0)
    learner.advance(2_000_000)
    for s in range(len(model)):
        for choice, value in top_values(learner, marks, s).items():
            assert low[s, choice] - 0.2 < value < high[s, choice] + 0.2


def root_values(learner, marks):
    """{(s, call): V + C} of the root of maxq-q between landmarks."""
    graph, calls = learner.graph, [*range(4), "root", *marks.options]
    found = {}
    for s, kind in enumerate(graph.kind_of.tolist()):
        for x in range(graph.begin[kind, 0], graph.end[kind, 0]):
            entry = graph.first[s] + x
            if graph.open[entry]:
                call = calls[graph.child[graph.child_start[kind] + x]]
                found[s, call] = learner.value_of(s, x) + learner.own[entry]
    return found


def test_under_slip_maxq_tends_to_what_its_exploring_leaves_of_the_recursive_optimum():
    """With a constant epsilon the completions stay averages over calls that explore, whatever the learning rate."""
    model, marks, *_ = slippery()
    wanted, unexplored = recursive(False, 0.3), recursive(False)
    assert max(abs(wanted[key] - unexplored[key]) for key in wanted) > 6
    learner = start_learner(model, "maxq-q", LearnSettings(episodes=10**6, alpha=SLOWING, epsilon=0.3), 0)

    def error():
        found = root_values(learner, marks)
        assert found.keys() == wanted.keys()
        return max(abs(found[key] - wanted[key]) for key in wanted)

    early, late = errors_of(learner, [20_000, 4_000_000], error)
    assert late < min(2.0, early / 4)


@pytest.mark.parametrize("primitives", [True, False])
def test_under_slip_maxq_tends_to_the_recursive_optimum_as_exploring_fades(primitives):
    """A completion forgets the calls that explored more at the pace of its learning rate: k**-0.6 is fast enough."""
    model, marks, *_ = slippery()
    wanted = np.array(best_of(recursive(primitives), len(model)))
    learner = start_learner(
        model, "maxq-q", LearnSettings(episodes=10**6, alpha="1/(1+k)**0.6", primitives=primitives), 0
    )
    errors = []
    for halved in range(8):
        learner._rates = learner._rates._replace(epsilon=0.5 / 2**halved)
        learner.advance(50_000 * 2**halved)
        errors.append(np.abs(best_of(root_values(learner, marks), len(model)) - wanted).max())
    assert errors[-1] < min(2.0, errors[0] / 4)


def test_every_sub_agent_of_a_switch_learns_the_chance_of_arriving():
    model = halves()
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    learner = finished(start_learner(model, "switch", LearnSettings(episodes=20_000, alpha=1.0, epsilon=0.5), 0))
    for s in range(len(model)):
        for option in marks.open(s):
            best = max(inner_values(learner, marks, s, option).values())
            assert best == pytest.approx(0.9 ** (marks.steps[option][s] - 1), abs=1e-12)


def test_every_sub_agent_of_w_learning_learns_the_optimum_of_its_own_task():
    model = halves()
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    hopes = limits.best_of_agents(marks, *dense(model), 0.9, worst_return(model))
    learner = finished(start_learner(model, "w-learning", LearnSettings(episodes=20_000, alpha=1.0, epsilon=0.5), 0))
    for (option, s), wanted in hopes.items():
        assert list(inner_values(learner, marks, s, option).values()) == pytest.approx(wanted.tolist(), abs=1e-9)
