"""Learning rates: numbers and formulas, checked once, looked up in a table."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import FormulaError, SettingError
from qualrl.learning.schedule import ENTRIES, EXACT, LAST_K, index_of, schedule_of, table_k


def test_a_number_is_a_schedule():
    for value, text in ((0.1, "0.1"), (1, "1.0"), (1e-300, "1e-300"), ("1e-2", "1e-2"), ("1/4", "1/4")):
        schedule = schedule_of(value)
        assert schedule.text == text
        assert schedule.constant == (value if not isinstance(value, str) else float(eval(value)))  # of this file
        assert set(schedule.weights(5)) == set(schedule.table()) == {schedule.constant}
    assert schedule_of(0.1) == schedule_of(0.1) != schedule_of(0.2)


def test_a_formula_is_a_schedule():
    schedule = schedule_of("1/(1 + k)^0.85")
    assert schedule.constant is None
    assert schedule.text == "1/(1 + k)^0.85"
    np.testing.assert_allclose(schedule.weights(4), [1, 2**-0.85, 3**-0.85, 4**-0.85], rtol=1e-14)
    assert schedule == schedule_of("1/(1 + k)^0.85")


WRONG = {
    "1/k": "no finite value at k = 0; k counts from 0",
    "1/log(k)": "no finite value at k = 1",
    "1.5/(1+k)": "is 1.5 at k = 0",
    "k/10000": "is 0 at k = 0",
    "1 - k/20000": "is -5e-05 at k = 20001",
    "0.1*(1 + k/10**9)": "above 0 and at most 1",
    "0.1**(1.2**k)": "is 0 at k = 32",
    "2": "got 2",
    "0": "got 0",
    0.0: "got 0.0",
    1.5: "got 1.5",
    -0.1: "got -0.1",
    float("nan"): "got nan",
    float("inf"): "got inf",
    True: "got True",
}


@pytest.mark.parametrize("value", WRONG)
def test_what_is_out_of_range_is_refused_with_its_k(value):
    with pytest.raises(SettingError) as problem:
        schedule_of(value)
    assert WRONG[value] in str(problem.value)


def test_what_is_no_formula_is_refused_with_its_column():
    with pytest.raises(FormulaError, match="column 1: unknown name 'alhpa'"):
        schedule_of("alhpa")
    with pytest.raises(FormulaError, match="allowed: k"):
        schedule_of("a/(1+k)")


def test_a_rate_may_fade_below_what_a_float_holds_after_many_steps():
    assert schedule_of("0.99**k").table()[-1] == 0.0


def test_the_table_is_exact_at_first_and_near_from_there_on():
    schedule = schedule_of("(1 + k)**-0.85")
    table = schedule.table()
    assert table.shape == table_k().shape == (ENTRIES,)
    np.testing.assert_array_equal(table[:EXACT], schedule.weights(EXACT))
    assert table_k()[-1] <= LAST_K
    with pytest.raises(ValueError, match="read-only"):
        table_k()[0] = 1


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2 * EXACT) | st.integers(0, LAST_K))
def test_every_k_is_found_within_a_step(k):
    index = schedule_of(0.5).index_of(k)
    held = table_k()[index]
    assert held == k if k < EXACT else held <= k < held * (1 + 1.001 / 1024) + 1
    assert 0 <= index < ENTRIES


def test_the_table_goes_on_for_ever():
    assert index_of(LAST_K) == index_of(10**18) == ENTRIES - 1
    assert index_of(EXACT - 1) == EXACT - 1
    assert index_of(EXACT) == EXACT


def test_a_schedule_loads_without_sympy():
    code = "import sys; from qualrl.learning.schedule import schedule_of; schedule_of('1/(1+k)').table()"
    code += "; sys.exit('sympy' in sys.modules or 'mpmath' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
