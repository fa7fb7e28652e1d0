"""What each learner's values tend to under slip, against exact solutions by policy iteration and linear solves.

The limits lie further apart than the bounds: see ``test_the_bounds_tell_the_limits_apart``.
"""

from functools import cache

import numpy as np
import pytest

from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from tests.learning_worlds import World, random_table, rooms, table_model

SMALL = "....\n.#..\n...."
MODELS = {
    "map": lambda: rooms(SMALL, (2, 3), None, slip=0.2),
    "table": lambda: table_model(random_table(11, 10, 3), start=None),
}
DECAYING = "1/(1+k)**0.7"
EPSILON = 0.3


@cache
def solved(where):
    """(model, tried rows (S, A) that count, Q*, Q of the best policy that explores, its V, V of a random walk)."""
    model = MODELS[where]()
    dense = World(model).dense()
    n_states, n_actions = dense.r.shape
    counts = np.repeat((model.can_reach & ~dense.terminal)[:, None], n_actions, axis=1)
    best, soft = dense.optimal(), dense.optimal(epsilon=EPSILON)
    random = dense.solve(np.full(dense.r.shape, 1 / n_actions))
    weights = np.full(dense.r.shape, EPSILON / n_actions)
    weights[np.arange(n_states), best.argmax(axis=1)] += 1 - EPSILON
    return model, counts, best, soft, random, dense.solve(weights)


def errors(where, algorithm, limit, steps=(10_000, 100_000, 1_000_000), seeds=3, **changed):
    """(seeds, len(steps)) largest error against the limit after so many steps."""
    model, counts = solved(where)[:2]
    chosen = LearnSettings(**({"episodes": 10_000_000, "alpha": DECAYING, "epsilon": EPSILON} | changed))
    found = []
    for seed in range(seeds):
        learner, made, row = start_learner(model, algorithm, chosen, seed), 0, []
        for until in steps:
            made += learner.advance(until - made)
            q = learner.learned().q
            row.append(np.abs(q - limit)[counts[:, : q.shape[1]]].max())
        found.append(row)
    return np.array(found)


def span(where):
    return np.ptp(solved(where)[2])


@pytest.mark.parametrize("where", list(MODELS))
@pytest.mark.parametrize(
    ("algorithm", "changed", "bound"),
    [
        ("q-learning", {}, 0.02), ("hql", {"eta_counter": "run"}, 0.02), ("hql", {"eta_counter": "pair"}, 0.02),
        ("q-lambda", {"trace": 0.7}, 0.03), ("dyna-q", {"planning_steps": 5}, 0.02), ("prioritized-sweeping", {}, 0.01),
        ("hql-replay", {}, 0.01),
    ],
)  # fmt: skip
def test_values_tend_to_the_optimum_under_slip(where, algorithm, changed, bound):
    error = errors(where, algorithm, solved(where)[2], **changed)
    middle = np.median(error, axis=0)
    assert middle[-1] < middle[0]
    assert error[:, -1].max() < bound * span(where), (error / span(where)).round(4)


@pytest.mark.parametrize("where", list(MODELS))
@pytest.mark.parametrize(("algorithm", "bound"), [("sarsa", 0.03), ("sarsa-lambda", 0.04)])
def test_on_policy_values_tend_to_those_of_the_best_policy_that_explores(where, algorithm, bound):
    error = errors(where, algorithm, solved(where)[3], trace=0.7)
    middle = np.median(error, axis=0)
    assert middle[-1] < middle[0]
    assert error[:, -1].max() < bound * span(where), (error / span(where)).round(4)


@pytest.mark.parametrize("where", list(MODELS))
@pytest.mark.parametrize("policy", ["random", "optimal"])
def test_temporal_differences_tend_to_the_values_of_the_policy(where, policy):
    limit = solved(where)[4 if policy == "random" else 5][:, None]
    error = errors(where, "td", limit, policy=policy)
    assert np.median(error, axis=0)[-1] < np.median(error, axis=0)[0]
    assert error[:, -1].max() < 0.03 * span(where), (error / span(where)).round(4)


@pytest.mark.parametrize("where", list(MODELS))
def test_the_bounds_tell_the_limits_apart(where):
    _, counts, best, soft, random, following = solved(where)
    value, random, following = best.max(axis=1)[:, None], random[:, None], following[:, None]
    for one, other in ((best, soft), (value, random), (following, random), (value, following)):
        assert np.abs(one - other)[counts[:, : one.shape[1]]].max() > 0.06 * span(where)


def test_weights_that_start_anew_in_every_episode_leave_a_bias_under_slip():
    """What an arc is worth was measured on travels that arrived: handed down again and again, it is not Q*."""
    optimum = solved("map")[2]
    once = errors("map", "hql", optimum, eta_counter="run", eta0=0.5)[:, -1]
    anew = errors("map", "hql", optimum, eta_counter="episode", eta0=0.5)[:, -1]
    assert once.max() < 0.02 * span("map")
    assert anew.min() > 2 * once.max(), (once, anew)
