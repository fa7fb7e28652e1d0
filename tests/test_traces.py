"""SARSA, SARSA(lambda), Watkins's Q(lambda) and TD(0) against textbook twins, draw for draw; formulas for alpha."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.kernels import stepping, traces
from qualrl.learning.schedule import schedule_of
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner, train
from tests import oracles, oracles_learning
from tests.learning_worlds import World, from_python, random_table, rooms, table_model, table_models

RATES = {
    0.2: lambda k: 0.2,
    "1/(2+k)": lambda k: 1 / (2 + k),
    "8/(16+k)": lambda k: 8 / (16 + k),
}
MODELS = {
    "puzzle": lambda: rooms(),
    "slippery puzzle, any start": lambda: rooms(slip=0.3, start=None),
    "eight moves": lambda: rooms(slip=0.2, directions=8),
    "table": lambda: table_model(random_table(3, 30, 4)),
    "table without chance": lambda: table_model(random_table(4, 30, 4, most_outcomes=1)),
}


def both(model, algorithm, chosen, seed, n_steps=10**9, limits=None):
    """(learner, its values, the textbook's, steps and returns of the textbook).

    Values start at random numbers, so that ties, which a lazy trace may round away, do not decide anything.
    """
    world = World(model)
    start = np.random.default_rng(seed).normal(0, 0.1, (world.n_states, world.n_actions))
    start[[world.terminal(s) for s in range(world.n_states)]] = 0.0
    learner = start_learner(model, algorithm, chosen, seed)
    learner._q[:] = start.ravel()
    learner.advance(n_steps)
    q, steps, returns = oracles_learning.with_traces(
        world.step, world.terminal, world.starts, world.n_states, world.n_actions, watkins=algorithm == "q-lambda",
        trace=0.0 if algorithm == "sarsa" else chosen.trace, gamma=model.gamma, alpha=RATES[chosen.alpha],
        epsilon=chosen.epsilon, episodes=chosen.episodes, seed=seed, max_steps=chosen.max_steps, q0=start.tolist(),
        most=n_steps,
    )  # fmt: skip
    return learner, learner.learned().q, np.array(q), steps, returns


@pytest.mark.parametrize("algorithm", ["sarsa", "sarsa-lambda", "q-lambda"])
@pytest.mark.parametrize("alpha", list(RATES))
@pytest.mark.parametrize("where", list(MODELS))
@pytest.mark.parametrize("epsilon", [0.1, 1.0])
def test_learners_that_look_ahead_equal_the_textbook(algorithm, alpha, where, epsilon):
    """To the last bit without traces; the sums of a lazy trace round otherwise."""
    model = MODELS[where]()
    chosen = LearnSettings(episodes=8, alpha=alpha, epsilon=epsilon, max_steps=400, trace=0.9)
    learner, q, twin_q, steps, returns = both(model, algorithm, chosen, 5)
    assert learner.progress.steps.tolist() == steps
    assert learner.progress.returns.tolist() == returns
    tolerance = 0 if algorithm == "sarsa" else 1e-9
    np.testing.assert_allclose(q, twin_q, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("algorithm", ["sarsa-lambda", "q-lambda"])
@pytest.mark.parametrize("trace", [0.0, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_traces_of_any_length_equal_the_textbook(algorithm, trace, seed):
    model = table_model(random_table(seed, 40, 4, terminals=1, gamma=0.97), start=None if seed % 2 else 0)
    chosen = LearnSettings(episodes=30, alpha=0.2, epsilon=0.15, max_steps=300, trace=trace)
    learner, q, twin_q, steps, _ = both(model, algorithm, chosen, seed)
    assert learner.progress.steps.tolist() == steps
    np.testing.assert_allclose(q, twin_q, rtol=1e-9, atol=1e-9)


@given(
    table_models(), st.sampled_from(["sarsa-lambda", "q-lambda"]), st.sampled_from([0.3, 0.9, 1.0]),
    st.sampled_from([0.05, 1.0]), st.integers(1, 200),
)  # fmt: skip
@settings(max_examples=30, deadline=None)
def test_what_is_owed_to_a_trace_can_be_asked_for_at_any_moment(model, algorithm, trace, epsilon, n_steps):
    """In the middle of an episode, too, where most rows have not been given their share yet."""
    chosen = LearnSettings(episodes=300, alpha=0.2, epsilon=epsilon, max_steps=60, trace=trace)
    _, q, twin_q, _, _ = both(model, algorithm, chosen, 1, n_steps)
    np.testing.assert_allclose(q, twin_q, rtol=1e-9, atol=1e-9)


def test_asking_does_not_disturb_a_trace():
    chosen = LearnSettings(episodes=20, alpha=0.2, epsilon=0.2, max_steps=100)
    asked, quiet = (start_learner(rooms(), "q-lambda", chosen, 2) for _ in range(2))
    for _ in range(2000):
        asked.advance(1)
        asked.learned()
    quiet.advance(2000)
    np.testing.assert_array_equal(asked.learned().q, quiet.learned().q)


def test_no_trace_is_left_behind_by_an_episode():
    for algorithm in ("sarsa-lambda", "q-lambda"):
        learner = start_learner(rooms(), algorithm, LearnSettings(episodes=3, epsilon=0.2, max_steps=50), 0)
        learner.advance(10_000)
        assert learner.progress.whole[traces.ON_TRACE] == 0
        assert not learner._trace.weight.any()


@pytest.mark.parametrize("policy", ["random", "optimal"])
@pytest.mark.parametrize("alpha", list(RATES))
@pytest.mark.parametrize("where", list(MODELS))
def test_temporal_differences_equal_the_textbook_to_the_last_bit(policy, alpha, where):
    model = MODELS[where]()
    world = World(model)
    followed = {}
    if policy == "optimal":
        q = world.dense().optimal()
        followed = {s: int(q[s].argmax()) for s in range(world.n_states) if model.can_reach[s]}
        gaps = np.diff(np.sort(q, axis=1)[:, -2:], axis=1)[:, 0]
        learned = start_learner(model, "td", LearnSettings(policy="optimal"), 0)._policy
        for s in followed:  # equally good actions: whichever the learner follows
            if gaps[s] < 1e-9:
                assert q[s, learned[s]] >= q[s].max() - 1e-9
                followed[s] = int(learned[s])
    chosen = LearnSettings(episodes=12, alpha=alpha, epsilon=0.2, max_steps=300, policy=policy)
    run = train(model, "td", chosen, seed=9)
    value, steps, returns = oracles_learning.temporal_differences(
        world.step, world.terminal, world.starts, world.n_states, world.n_actions, policy=followed, gamma=model.gamma,
        alpha=RATES[alpha], epsilon=0.2, episodes=12, seed=9, max_steps=300,
    )  # fmt: skip
    assert run.steps.tolist() == steps
    assert run.returns.tolist() == returns
    np.testing.assert_array_equal(run.q[:, 0], value)


@pytest.mark.parametrize("alpha", ["1/(2+k)", "8/(16+k)"])
@pytest.mark.parametrize("where", ["puzzle", "slippery puzzle, any start", "table"])
def test_q_learning_by_a_formula_counts_the_updates_of_each_action(alpha, where):
    model = MODELS[where]()
    world = World(model)
    run = train(model, "q-learning", LearnSettings(episodes=12, alpha=alpha, epsilon=0.1, max_steps=500), seed=3)
    q, steps, _ = oracles.learn(
        lambda s, a, draws: world.step(s, a, draws)[:2], world.terminal, world.starts, world.n_states, world.n_actions,
        gamma=model.gamma, alpha=RATES[alpha], epsilon=0.1, episodes=12, seed=3, max_steps=500,
    )  # fmt: skip
    assert run.steps.tolist() == steps
    np.testing.assert_array_equal(run.q, q)


def test_the_kernel_reads_the_table_of_rates_where_the_schedule_says():
    schedule = schedule_of("1/(1+k)**0.7")
    table = schedule.table()
    rate_at = from_python(stepping.rate_at)
    chance = np.random.default_rng(0)
    ks = [0, 1, stepping.EXACT - 1, stepping.EXACT, stepping.EXACT + 1, 2**32 - 1, 2**40, 2**50]
    for k in ks + np.exp(chance.uniform(0, 30, 2000)).astype(np.int64).tolist():
        assert rate_at(table, k) == table[schedule.index_of(k)]
    assert rate_at(np.array([0.25]), 10**9) == 0.25
