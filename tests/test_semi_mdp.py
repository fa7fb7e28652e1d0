"""Semi-MDPs against enumeration of policies, the negative-binomial law, and exact fractions."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import SettingError, UnknownNameError
from qualrl.models.semi_mdp import SemiMDP
from qualrl.solving.fold import fold
from qualrl.solving.semi_mdp_values import policy_values, semi_values
from tests.small_worlds import tables, two_corridors

HAND = {
    "state_names": ("room", "corridor", "goal"),
    "action_names": ("out", "wait", "on"),
    "action_start": np.array([0, 2, 3, 3]),
    "arc_start": np.array([0, 2, 3, 4]),
    "target": np.array([1, 2, 0, 2]),
    "probability": np.array([0.5, 0.5, 1.0, 1.0]),
    "discount": np.array([0.5 * 0.9**3, 0.5 * 0.9**2, 0.9, 0.9**4]),
    "reward": np.array([-2.0, -1.0, 50.0]),
    "duration": np.array([2.5, 1.0, 4.0]),
    "terminal": np.array([False, False, True]),
    "gamma": 0.9,
}


def test_a_semi_mdp_by_hand_is_inspectable_and_solved():
    smdp = SemiMDP(**HAND)
    assert smdp.actions("room") == ("out", "wait")
    assert smdp.actions("goal") == ()
    assert smdp.arc("room", "out", "corridor") == pytest.approx((0.5, 0.5 * 0.9**3))
    assert smdp.arc("room", "wait", "goal") == (0, 0)
    found = semi_values(smdp)
    assert found.value == pytest.approx([-2 + 0.5 * 0.9**3 * 50, 50, 0])
    assert found.pair.tolist() == [0, 2, -1]
    assert smdp.transition.toarray().sum(axis=1) == pytest.approx([1, 1, 1])
    with pytest.raises(UnknownNameError, match="did you mean 'corridor'"):
        smdp.actions("coridor")
    with pytest.raises(UnknownNameError, match="room has no action"):
        smdp.pair_index("room", "on")
    with pytest.raises(SettingError, match="not the law of tau"):
        smdp.tau_law("room", "out", "goal")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"gamma": 1.0}, "gamma"),
        ({"action_start": np.array([0, 2, 3])}, "action_start"),
        ({"arc_start": np.array([0, 3, 2, 4])}, "arc_start"),
        ({"terminal": np.array([False, True, True])}, "every state needs an action"),
        ({"action_start": np.array([0, 3, 3, 3])}, "every state needs an action"),
        ({"target": np.array([1, 2, 0, 3])}, "targets"),
        ({"probability": np.array([0.6, 0.5, 1.0, 1.0])}, "more than 1"),
        ({"discount": np.array([0.5, 0.4, 0.9, 0.6])}, "takes a step"),
        ({"reward": np.array([0.0, np.nan, 0.0])}, "finite"),
    ],
)
def test_a_semi_mdp_refuses_what_contradicts_itself(change, what):
    with pytest.raises(SettingError, match=what):
        SemiMDP(**(HAND | change))


@given(tables())
@settings(max_examples=60, deadline=None)
def test_values_are_the_best_of_all_policies(model):
    smdp = fold(model).smdp
    starts = smdp.action_start
    choices = [range(starts[i], starts[i + 1]) for i in range(len(smdp)) if not smdp.terminal[i]]
    if math.prod(len(c) for c in choices) > 3000:
        return
    matrix, best = smdp.discounted.toarray(), np.full(len(smdp), -np.inf)
    for policy in itertools.product(*choices):
        worth = np.zeros(len(smdp))
        chosen = np.array(policy, int)
        worth[:-1] = np.linalg.solve(np.eye(len(smdp) - 1) - matrix[chosen, :-1], smdp.reward[chosen])
        best = np.maximum(best, worth)
    found = semi_values(smdp)
    np.testing.assert_allclose(found.value, best, atol=1e-8)
    # equation (10): the values are the fixed point
    q = smdp.reward + smdp.discounted @ found.value
    for i in np.flatnonzero(~smdp.terminal):
        assert found.value[i] == pytest.approx(q[starts[i] : starts[i + 1]].max(), abs=1e-8)
    np.testing.assert_allclose(policy_values(smdp, found.pair, smdp.reward), found.value, atol=1e-9)


@pytest.mark.parametrize("n", [3, 6])
@pytest.mark.parametrize("stay", [0.0, 0.3, 0.7])
def test_the_law_of_tau_of_a_corridor_is_negative_binomial(n, stay):
    model = two_corridors(0.9, stay)
    smdp = fold(model).smdp
    name = "short corridor" if n == 3 else "long corridor"
    state = next(s for s in smdp.state_names if s.startswith(name))
    law = smdp.tau_law(state, smdp.actions(state)[0], "goal")
    expected = [math.comb(t - 1, n - 1) * (1 - stay) ** n * stay ** (t - n) for t in law.taus.tolist()]
    np.testing.assert_allclose(law.probabilities, expected, rtol=1e-10)
    assert 0 <= law.rest <= 1e-12
    probability, discount = smdp.arc(state, smdp.actions(state)[0], "goal")
    assert probability == pytest.approx(1)
    assert discount == pytest.approx((0.9 * (1 - stay) / (1 - 0.9 * stay)) ** n, rel=1e-12)
    assert law.discount(0.9) == pytest.approx(discount, abs=1e-12)
    pair = smdp.pair_index(state, smdp.actions(state)[0])
    assert law.mean == pytest.approx(smdp.duration[pair], rel=1e-9)
    assert smdp.duration[pair] == pytest.approx(n / (1 - stay))


def test_the_discount_of_the_mean_time_is_not_the_mean_discount():
    smdp = fold(two_corridors(0.9, 0.3)).smdp
    state = next(s for s in smdp.state_names if s.startswith("short corridor"))
    pair = smdp.pair_index(state, smdp.actions(state)[0])
    assert 0.9 ** smdp.duration[pair] == pytest.approx(0.6366, abs=5e-5)
    assert smdp.discount[smdp.arc_start[pair]] == pytest.approx(0.6428, abs=5e-5)


def test_a_law_that_is_cut_off_says_how_much_is_missing():
    smdp = fold(two_corridors(0.9, 0.7)).smdp
    state = next(s for s in smdp.state_names if s.startswith("short corridor"))
    law = smdp.tau_law(state, smdp.actions(state)[0], "goal", most=10)
    missing = 1 - sum(
        Fraction(math.comb(t - 1, 2)) * Fraction(3, 10) ** 3 * Fraction(7, 10) ** (t - 3) for t in range(3, 11)
    )
    assert law.taus.max() == 10
    assert law.rest == pytest.approx(float(missing), rel=1e-12)


@given(tables(), st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_laws_of_random_tables_add_up_to_probability_and_discount(model, seed):
    smdp = fold(model).smdp
    if not len(smdp.target):
        return
    arc = seed % len(smdp.target)
    pair = int(np.searchsorted(smdp.arc_start, arc, side="right") - 1)
    state, action = smdp.state_names[smdp.source[pair]], smdp.action_names[pair]
    law = smdp.tau_law(state, action, smdp.state_names[smdp.target[arc]], most=3000)
    assert law.probabilities.sum() <= smdp.probability[arc] + 1e-9
    assert law.probabilities.sum() + law.rest >= smdp.probability[arc] - 1e-9
    assert law.discount(smdp.gamma) == pytest.approx(smdp.discount[arc], abs=law.rest + 1e-9)
