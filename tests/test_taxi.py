"""Gymnasium's worlds as tables, against Gymnasium's own stepping; the taxi's study, and life without the extra."""

import json
import sys
import tomllib
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from typer.testing import CliRunner

from qualrl.commands.main import app
from qualrl.errors import SettingError, UnknownNameError
from qualrl.io import gymnasium_world
from qualrl.io.gymnasium_world import (
    N_TAXI,
    RIDING,
    TAXI,
    TAXI_ACTIONS,
    TAXI_STANDS,
    decoded,
    from_gymnasium,
    taxi_errands,
    taxi_model,
)
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.solving.exact import exact_values
from qualrl.solving.policy_values import policy_values
from qualrl.studies.settings import Budget, load_study
from qualrl.studies.study import prepared, run_study
from qualrl.studies.taxi.score import TaxiCourse, greedy_actions, mean_return, obeying

BUDGET = Budget(world="taxi", steps=2000, first=500, looks_per_tenfold=4, even_looks=4, within=0.01)


def outcomes(table: TabularMDP, state: int, action: int) -> list[tuple[float, int, float]]:
    row = state * table.n_actions + action
    entries = range(int(table.row_start[row]), int(table.row_start[row + 1]))
    return [(float(table.probability[e]), int(table.target[e]), float(table.reward[e])) for e in entries]


# --- tables ---


@pytest.mark.parametrize("name", [TAXI, "FrozenLake-v1", "CliffWalking-v1"])
def test_a_table_steps_as_its_environment_does(name):
    environment = gymnasium.make(name).unwrapped
    table = from_gymnasium(name, 0.9)
    random = np.random.default_rng(2)
    environment.action_space.seed(1)
    state, ends, steps = int(environment.reset(seed=4)[0]), 0, 0
    while steps < 4000 and ends < 40:
        steps += 1
        action = int(random.integers(table.n_actions))
        following, reward, over, _, _ = environment.step(action)
        possible = [(target, gain) for p, target, gain in outcomes(table, state, action) if p > 0]
        alike = [target for target, gain in possible if gain == reward and bool(table.terminal[target]) == bool(over)]
        assert any(target == following or (over and target >= len(environment.P)) for target in alike)
        ends += over
        state = int(environment.reset()[0]) if over else int(following)
    assert steps > 50


@pytest.mark.parametrize("name", [TAXI, "FrozenLake-v1", "CliffWalking-v1"])
def test_nothing_of_an_environment_is_lost(name):
    """Whatever a row of P says from a state where an episode may be, the table says; which is terminal, too."""
    told, table = gymnasium.make(name).unwrapped.P, from_gymnasium(name, 0.9)
    for state in range(len(told)):
        if table.terminal[state]:
            continue
        for action, rows in told[state].items():
            for (p, target, reward, over), found in zip(rows, outcomes(table, state, action), strict=True):
                assert found[::2] == (p, reward)
                assert table.terminal[found[1]] == over
                assert found[1] == target or (over and found[1] == len(told))


def test_the_taxi_gets_an_end_of_its_own_and_others_do_not():
    """The number at which a ride ends is also that of the taxi driving past someone who has arrived."""
    assert len(from_gymnasium(TAXI, 0.9)) == 501
    assert len(from_gymnasium("FrozenLake-v1", 0.9)) == 16
    assert len(from_gymnasium(gymnasium.make("CliffWalking-v1"), 0.9)) == 48
    assert np.flatnonzero(from_gymnasium(TAXI, 0.9).terminal).tolist() == [500]


def test_slippery_lakes_are_solved_as_value_iteration_by_hand_does():
    told, gamma = gymnasium.make("FrozenLake-v1").unwrapped.P, 0.95
    value = np.zeros(16)
    for _ in range(3000):
        value = np.array([
            max(sum(p * (r + gamma * value[t] * (not over)) for p, t, r, over in told[s][a]) for a in range(4))
            for s in range(16)
        ])  # fmt: skip
    np.testing.assert_allclose(exact_values(from_gymnasium("FrozenLake-v1", gamma)).value[0], value[0], atol=1e-9)


def test_what_has_no_table_is_refused():
    with pytest.raises(SettingError, match="CartPole-v1 has no table P"):
        from_gymnasium("CartPole-v1", 0.9)
    with pytest.raises(SettingError, match="object has no table P"):
        from_gymnasium(object(), 0.9)
    with pytest.raises(UnknownNameError, match="NoSuch"):
        from_gymnasium("NoSuch-v0", 0.9)


# --- the taxi ---


def test_the_taxis_numbers_are_taken_apart_as_gymnasium_does():
    environment = gymnasium.make(TAXI).unwrapped
    assert [decoded(state) for state in range(N_TAXI)] == [tuple(environment.decode(s)) for s in range(N_TAXI)]
    assert list(TAXI_STANDS.values()) == environment.locs
    state = environment.encode(0, 0, RIDING, 1)
    for action, (row, column) in enumerate([(1, 0), (0, 0), (0, 1), (0, 0)]):
        ((_, target, _, _),) = environment.P[state][action]
        assert decoded(target)[:2] == (row, column), TAXI_ACTIONS[action]


def test_the_taxis_landmarks_are_single_states_where_one_errand_becomes_another():
    model = taxi_model(0.99)
    errands = taxi_errands()
    marks = model.landmarks
    for index, name in enumerate(marks.names[:-1]):
        states = np.flatnonzero(marks.landmark_of == index)
        assert len(states) <= 1, name
    at = marks.names.index("fetch at R for G to carry to G")
    (state,) = np.flatnonzero(marks.landmark_of == at)
    assert decoded(int(state)) == (0, 0, RIDING, 1)
    assert errands[state] == "carry to G"


def test_the_taxi_starts_where_gymnasium_starts_it_and_its_optimum_is_the_known_one():
    course = TaxiCourse(BUDGET)
    model = course.model(0.99)
    assert len(model.starts) == 300
    found = gymnasium.make(TAXI).unwrapped.initial_state_distrib
    np.testing.assert_array_equal(np.flatnonzero(found), model.starts)
    assert course.optimum == pytest.approx(6.327, abs=1e-3)
    (note,) = course.notes()
    assert note.endswith("mean return without discount 7.93.")


def test_mean_returns_are_those_of_gymnasium_itself():
    model = taxi_model(0.99)
    learner = start_learner(model, "hql-replay", LearnSettings(episodes=9000, epsilon=0.1), seed=1)
    learner.advance(12_000)
    actions = greedy_actions(learner.learned())
    environment, returns = gymnasium.make(TAXI), []
    for seed in range(25):
        state, _ = environment.reset(seed=seed)
        total, over, start = 0.0, False, state
        while not over:
            state, reward, ended, cut, _ = environment.step(int(actions[state]))
            total, over = total + float(reward), ended or cut
        returns.append((start, total))
    for start, total in returns:
        assert mean_return(model.world, actions, np.array([start])) == total


def test_a_hierarchy_is_judged_by_what_it_does_and_not_state_by_state():
    course = TaxiCourse(BUDGET)
    model = course.model(0.99)
    learner = start_learner(model, "maxq-q", LearnSettings(episodes=90_000, alpha=1.0, epsilon=0.1), seed=0)
    early = course.look(model, learner)
    learner.advance(250_000)
    late = course.look(model, learner)
    assert not early.good
    assert late.good
    assert late.measures["mean_return"] == pytest.approx(7.93, abs=1e-3)
    chain, starts = obeying(learner, model.world, model.starts)
    alone = policy_values(chain, np.zeros(len(chain), np.int8))[starts]
    np.testing.assert_allclose(alone, exact_values(model.world).value[model.starts], atol=0.2)


# --- the study ---


def test_the_study_runs_and_says_the_same_on_any_number_of_threads():
    chosen = load_study("taxi").model_copy(update={"budget": BUDGET})
    documents = [run_study(prepared("taxi", 2, chosen), threads=threads) for threads in (1, 2)]
    for one, two in zip(documents[0].runs.values(), documents[1].runs.values(), strict=True):
        np.testing.assert_array_equal(one.curve, two.curve)
        np.testing.assert_array_equal(one.measures["env_steps"], two.measures["env_steps"])
    assert any("7.93" in note for note in documents[0].notes)


def test_without_gymnasium_one_line_says_what_to_install(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(gymnasium_world, "find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(SettingError, match=r"pip install 'qualrl\[rl\]'"):
        from_gymnasium(TAXI, 0.9)
    done = CliRunner().invoke(app, ["reproduce", "taxi", "-o", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert done.stderr == "qualrl: Gymnasium is not installed; run: pip install 'qualrl[rl]'\n"
    assert list(tmp_path.iterdir()) == []


def test_all_without_gymnasium_leaves_the_taxi_out_and_says_so(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(gymnasium_world, "find_spec", lambda name: None)
    monkeypatch.setattr("qualrl.studies.settings.STUDIES", ("fig9", "taxi"))
    done = CliRunner().invoke(app, ["reproduce", "all", "--seeds", "2", "--episodes", "5", "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert done.stderr == "qualrl: taxi is left out: Gymnasium is not installed; run: pip install 'qualrl[rl]'\n"
    whole = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert whole == ["fig9.json", "fig9.png", "table.md"]
    assert json.loads((tmp_path / "out" / "fig9.json").read_text())["figure"] == "fig9"


def test_the_extra_is_declared():
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (asked,) = project["optional-dependencies"]["rl"]
    assert asked.startswith("gymnasium>=")
    assert asked in project["optional-dependencies"]["test"]
