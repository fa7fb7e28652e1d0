"""HQL's own settings (upper_alpha, macro_return, macro_discount) and formulas for its rates, against the textbook."""

import numpy as np
import pytest

from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from tests import oracles
from tests.learning_worlds import World, random_table, rooms, table_model

RATES = {
    None: None,
    1.0: 1.0,
    "1/(1+k)": lambda k: 1 / (1 + k),
    "8/(16+k)": lambda k: 8 / (16 + k),
}


def both(model, chosen, seed):
    """(a run of HQL, the same by the textbook twin)."""
    world, level = World(model), model.landmarks
    arcs = [set(level.arc_target[a:b].tolist()) for a, b in zip(level.arc_start[:-1], level.arc_start[1:], strict=True)]
    twin = oracles.learn(
        lambda s, a, draws: world.step(s, a, draws)[:2], world.terminal, world.starts, world.n_states, world.n_actions,
        gamma=model.gamma, alpha=RATES.get(chosen.alpha, chosen.alpha), epsilon=chosen.epsilon,
        episodes=chosen.episodes, seed=seed, max_steps=chosen.max_steps, landmarks=(level.landmark_of.tolist(), arcs),
        eta0=chosen.eta0, power=chosen.eta_power, counter=chosen.eta_counter,
        upper_alpha=RATES[chosen.upper_alpha], macro_return=chosen.macro_return, macro_discount=chosen.macro_discount,
    )  # fmt: skip
    return train(model, "hql", chosen, seed), twin


@pytest.mark.parametrize("macro_return", ["departure", "stay"])
@pytest.mark.parametrize("macro_discount", ["gamma_tau", "gamma"])
@pytest.mark.parametrize(("alpha", "upper_alpha"), [(0.2, None), (0.2, 1.0), (0.2, "1/(1+k)"), ("8/(16+k)", None)])
@pytest.mark.parametrize("where", ["puzzle", "slippery puzzle, any start", "table"])
def test_every_reading_of_algorithm_2_equals_the_textbook_to_the_last_bit(
    macro_return, macro_discount, alpha, upper_alpha, where
):
    model = {
        "puzzle": lambda: rooms(),
        "slippery puzzle, any start": lambda: rooms(slip=0.3, start=None),
        "table": lambda: table_model(random_table(3, 30, 4, terminals=1), start=None),
    }[where]()
    chosen = LearnSettings(
        episodes=150 if where == "table" else 10, alpha=alpha, epsilon=0.1,
        max_steps=500, eta_counter="episode", eta0=0.5, upper_alpha=upper_alpha,
        macro_return=macro_return, macro_discount=macro_discount,
    )  # fmt: skip
    run, (q, steps, returns) = both(model, chosen, 7)
    assert run.arc_visits.sum() > 20
    assert run.steps.tolist() == steps
    assert run.returns.tolist() == returns
    np.testing.assert_array_equal(run.q, q)


def test_the_settings_make_a_difference():
    """Else the test above would show nothing."""
    model, found = rooms(), []
    for changed in ({}, {"upper_alpha": 1.0}, {"macro_return": "stay"}, {"macro_discount": "gamma"}):
        chosen = LearnSettings(episodes=10, alpha=0.2, eta_counter="episode", max_steps=500, **changed)
        found.append(train(model, "hql", chosen, 7).q)
    assert all(not np.array_equal(a, b) for i, a in enumerate(found) for b in found[:i])


def test_wandering_at_a_landmark_is_charged_to_the_arc_only_when_its_whole_stay_counts():
    """The same random walk, read both ways: no arc is worth more with "stay", and most are worth less."""
    worth = {}
    for macro_return in ("departure", "stay"):
        chosen = LearnSettings(
            episodes=300, alpha=0.05, upper_alpha="1/(1+k)", epsilon=1.0, eta0=0.0, macro_return=macro_return
        )
        run = train(rooms(start=None), "hql", chosen, 1)
        worth[macro_return] = run.arc_q[run.arc_visits > 0]
    assert len(worth["stay"]) > 5
    assert (worth["stay"] <= worth["departure"] + 1e-9).all()
    assert np.mean(worth["stay"] < worth["departure"] - 0.01) > 0.5
