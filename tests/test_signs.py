"""Signs of influences: the algebra against numbers, the exact signs against values recomputed with a change."""

import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.depth import Depth
from qualrl.answers.ways import course
from qualrl.errors import SettingError
from qualrl.qualitative.plan_value import Course, Stretch
from qualrl.qualitative.signs import Sign, sign_of_sum
from qualrl.solving.exact import exact_values
from tests.certificates import check_signs
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_what_if import worth
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
NUMBERS = {Sign.MINUS: (-2, -1), Sign.ZERO: (0,), Sign.PLUS: (1, 2), Sign.UNKNOWN: (-2, -1, 0, 1, 2)}


@pytest.mark.parametrize("first", Sign)
@pytest.mark.parametrize("second", Sign)
def test_signs_of_sums_and_products_are_those_that_numbers_can_have(first, second):
    for sign, operation in (
        (sign_of_sum([first, second]), lambda a, b: a + b),
        (first.times(second), lambda a, b: a * b),
    ):
        possible = {Sign.of(operation(a, b)) for a in NUMBERS[first] for b in NUMBERS[second]}
        assert sign == (possible.pop() if len(possible) == 1 else Sign.UNKNOWN)


def test_the_sum_of_nothing_is_zero():
    assert sign_of_sum([]) == Sign.ZERO


def sign_at(influence, gamma):
    """What an influence says for a gamma; None where it does not say, as on a bracket."""
    if influence.by_signs != Sign.UNKNOWN:
        return influence.by_signs
    cuts = [Fraction(0), *(end for bracket in influence.exact.brackets for end in bracket), Fraction(1)]
    for at, sign in enumerate(influence.exact.signs):
        if cuts[2 * at] < gamma < cuts[2 * at + 1]:
            return Sign.of(sign)
    return None


@settings(deadline=None, max_examples=40)
@given(
    st.tuples(st.sampled_from(CELLS), st.sampled_from(CELLS)).filter(lambda ends: ends[0] != ends[1]),
    st.sampled_from([4, 8]), st.sampled_from([-5.0, 0.5, 100.0]), st.integers(1, 999),
)  # fmt: skip
def test_exact_signs_are_those_of_values_recomputed(ends, directions, goal_reward, thousandths):
    model = qualrl.build(
        REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.97, directions=directions,
        step_reward=-5.0 if goal_reward < 0 else -1.0, goal_reward=goal_reward,
    )  # fmt: skip
    answer = qualrl.questions.signs(model)
    of = {influence.of: influence for influence in answer.influences}
    walk = [int(model.grid.state_of[cell]) for cell in qualrl.plan(model).path]
    way, gamma = course(model, walk), Fraction(thousandths, 1000)
    now = worth(way, gamma)
    rewards = [Fraction(stretch.reward) for stretch in way.stretches for _ in range(stretch.steps)]
    slope = sum((t * reward * gamma ** (t - 1) for t, reward in enumerate(rewards) if t), Fraction(0))
    assert sign_at(of["gamma"], gamma) in (None, Sign.of(slope))
    assert of["the goal's reward"].by_signs == Sign.PLUS
    assert of["a step's reward"].by_signs == (Sign.PLUS if len(walk) > 2 else Sign.ZERO)
    for place in {stretch.place for stretch in way.stretches}:
        at = next(at for at, stretch in enumerate(way.stretches) if stretch.place == place)
        first = way.stretches[at]
        if f"a step more in {place}" in of:
            longer = Course((*way.stretches[:at], Stretch(place, 1, first.reward), *way.stretches[at:]))
            expected = Sign.of(worth(longer, gamma) - now)
            assert sign_at(of[f"a step more in {place}"], gamma) in (None, expected)
    for influence in answer.influences:
        if influence.exact is not None and influence.exact.signs != (0,):
            certificate = json.loads(json.dumps(influence.to_dict()))["exact"]["certificate"]
            terms = {int(power): int(value) for power, value in certificate["terms"]}
            check_signs(certificate, terms)


@settings(deadline=None, max_examples=30)
@given(st.tuples(st.sampled_from(CELLS), st.sampled_from(CELLS)).filter(lambda ends: ends[0] != ends[1]))
def test_a_likelier_door_is_worth_more_wherever_it_says_so(ends):
    model = qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), gamma=0.97)
    answer = qualrl.questions.signs(model)
    doors = {of.of: of for of in answer.influences if of.of.startswith("the chance")}
    assert len(doors) == len(set(answer.way.doors))
    for name in set(answer.way.doors):
        influence = doors[f"the chance that {name} is open"]
        if influence.exact is None:
            assert not model.with_closed([name]).can_reach[model.start]
            continue
        tried = qualrl.questions.what_if(model, close=name).trying
        difference = tried.values["open"] - tried.values["closed"]
        assume(abs(difference) > 1e-9)
        assert sign_at(influence, Fraction(97, 100)) == Sign.of(difference)


def test_rewards_influence_slippery_plans_as_signs_alone_say():
    made = {"start": [2, 2], "gamma": 0.97, "slip": 0.1}
    model = qualrl.build(REGIONS, [2, 24], **made)
    answer = qualrl.questions.signs(model)
    value = exact_values(model.world).value[model.start]
    for more in ({"goal_reward": 101.0}, {"step_reward": -0.9}):
        other = qualrl.build(REGIONS, [2, 24], **made, **more)
        assert exact_values(other.world).value[model.start] > value
    assert [of.by_signs for of in answer.influences[:2]] == [Sign.PLUS, Sign.PLUS]
    assert all("undecided: moves slip" in of.in_words(Depth.NUMBERS) for of in answer.influences[2:])


@pytest.mark.parametrize(("steps", "goal_reward"), [(1, 1.0), (1, -1.0), (2, 0.1), (2, -0.5), (5, 50.0), (5, 0.0)])
def test_gamma_influences_slippery_plans_as_signs_say_even_right_before_the_goal(steps, goal_reward):
    made = {"start": [2, 6 - steps], "slip": 0.3, "goal_reward": goal_reward}
    of = {of.of: of for of in qualrl.questions.signs(qualrl.build(REGIONS, [2, 6], gamma=0.9, **made)).influences}
    changes = []
    for gamma in (0.5, 0.9, 0.99):
        values = [exact_values(qualrl.build(REGIONS, [2, 6], gamma=gamma + by, **made).world) for by in (0.0, 1e-6)]
        state = qualrl.build(REGIONS, [2, 6], gamma=gamma, **made).start
        changes.append(Sign.of(values[1].value[state] - values[0].value[state]))
    assert of["gamma"].by_signs == Sign.UNKNOWN or {of["gamma"].by_signs} == {*changes}
    assert of["gamma"].by_signs == (Sign.UNKNOWN if goal_reward > 0 else Sign.MINUS)


def test_the_command_answers(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    document = json.loads(qualrl_command("signs", "loop.scenario.yaml", "--json", cwd=tmp_path)[0])
    said = qualrl_command("signs", "loop.scenario.yaml", cwd=tmp_path)[0]
    assert said.splitlines() == document["sentences"]
    assert "the goal's reward: + by signs alone" in said
    table = qualrl.HybridMDP.from_table(qualrl.build(REGIONS, [2, 24]).grid.table(), ["a"] * len(CELLS), start=0)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.signs(table)


def test_where_start_and_goal_are_the_same_no_value_changes():
    with pytest.raises(SettingError, match="start and goal are the same"):
        qualrl.questions.signs(qualrl.build(REGIONS, [2, 24]), [2, 24])
