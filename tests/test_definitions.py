"""Definitions 1 and 3 as objects: what they say against textbook twins, and no arc across levels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import SettingError, UnknownNameError
from qualrl.models.grid_world import GridWorld
from qualrl.solving.exact import action_values, exact_values
from qualrl.solving.fold import fold
from qualrl.solving.theorem1 import door_blind
from tests import oracles
from tests.small_worlds import tables
from tests.worlds import TWO_ROOMS, free_masks, grid_of


@given(st.data(), free_masks(side=5), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.3]))
@settings(max_examples=40, deadline=None)
def test_an_mdp_shows_its_transitions_and_rewards(data, free, directions, slip):
    goal = tuple(data.draw(st.sampled_from(np.argwhere(free).tolist())))
    table = GridWorld(free, goal, 0.9, slip, directions).table()
    twin = oracles.GridTwin(free, goal, directions, slip)
    for a, name in enumerate(table.action_names):
        matrix = table.transition(name)
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-12)
        for s, cell in enumerate(twin.cells):
            row, reward = np.zeros(len(table)), 0.0
            for p, to, r in twin.outcomes(cell, a):
                row[twin.cells.index(to)] += p
                reward += p * r
            np.testing.assert_allclose(matrix[[s]].toarray().ravel(), row, atol=1e-12)
            assert table.expected_reward[s, a] == pytest.approx(reward, abs=1e-12)


def test_an_unknown_action_is_refused():
    table = GridWorld(np.ones((2, 2), bool), (0, 0), 0.9).table()
    with pytest.raises(UnknownNameError, match="did you mean 'left'"):
        table.transition("lft")
    with pytest.raises(SettingError, match="actions 0 to 3"):
        table.transition(4)


def assert_is_a_hybrid_mdp(model, upper):
    """Definition 3: blocks inside QS and S, nothing across, and one Bellman equation for both levels."""
    hybrid = model.definition(upper)
    n, s = len(upper), len(model)
    assert hybrid.states[:n] == upper.state_names
    assert len(hybrid.states) == n + s
    assert hybrid.actions == hybrid.qualitative_actions + model.world.action_names
    allowed = hybrid.allowed.toarray()
    for m, action in enumerate(hybrid.actions):
        matrix = hybrid.transition(action)
        assert matrix[:n, n:].nnz == matrix[n:, :n].nnz == 0
        sums = np.asarray(matrix.sum(axis=1)).ravel()
        assert np.all(sums <= allowed[:, m] + 1e-9)
        np.testing.assert_allclose(sums[n:], allowed[n:, m], atol=1e-9)
        np.testing.assert_array_equal(hybrid.reward(action), hybrid.rewards.toarray()[:, m])
        assert np.all(hybrid.reward(action)[allowed[:, m] == 0] == 0)
    return hybrid


@given(tables())
@settings(max_examples=40, deadline=None)
def test_random_hybrid_mdps_have_no_arcs_across_levels(model):
    folded = fold(model)
    hybrid = assert_is_a_hybrid_mdp(model, folded.smdp)
    assert_is_a_hybrid_mdp(model, door_blind(folded))
    # H_pi = pi + Q_pi, both optimal: the values of both levels solve one equation
    exact, values = exact_values(model.world), folded.solve()
    pi = np.array([int(action_values(model.world, exact.shifted, exact.shift, s).argmax()) for s in range(len(model))])
    policy = hybrid.policy(pi, values.pair)
    np.testing.assert_array_equal(policy.sum(axis=1), hybrid.allowed.max(axis=1).toarray().ravel())
    assert (policy - policy.multiply(hybrid.allowed)).nnz == 0
    stacked = np.concatenate([np.append(values.value[:-1] - exact.shift, 0.0), exact.value])
    backup = hybrid.rewards.multiply(policy).sum(axis=1)
    for m, action in enumerate(hybrid.actions):
        backup += policy[:, [m]].toarray().ravel() * (hybrid.transition(action, discounted=True) @ stacked)
    np.testing.assert_allclose(backup, stacked, atol=1e-7)


def test_the_hybrid_mdp_of_a_map_names_everything():
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), (4, 14), start=(4, 4))
    hybrid = assert_is_a_hybrid_mdp(model, door_blind(fold(model)))
    assert hybrid.states[:3] == ("room A", "room B", "goal")
    assert "go through door 1 to room B" in hybrid.actions
    assert "room A (row 1, column 1)" in hybrid.states
    assert hybrid.landmark_names == model.landmarks.names
    crossing = hybrid.transition("go through door 1 to room B")
    assert crossing[0, 1] == pytest.approx(1)
    with pytest.raises(UnknownNameError, match="no action is called"):
        hybrid.transition("fly")
    with pytest.raises(UnknownNameError, match="no action is called"):
        hybrid.reward("fly")


def test_policies_that_do_not_fit_are_refused():
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), (4, 14))
    smdp = fold(model).smdp
    hybrid = model.definition(smdp)
    good, pairs = np.zeros(len(model), int), np.append(smdp.action_start[:-2], -1)
    hybrid.policy(good, pairs)
    with pytest.raises(SettingError, match="needs"):
        hybrid.policy(good[1:], pairs)
    with pytest.raises(SettingError, match="does not have"):
        hybrid.policy(good + 9, pairs)
    with pytest.raises(SettingError, match="does not have"):
        hybrid.policy(good, pairs[::-1])
