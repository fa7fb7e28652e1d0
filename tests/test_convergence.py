"""Does sum a_k converge?  Decisions against known truths, against condensed sums, and against sympy's own answer."""

import json
import subprocess
import sys
import time
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import SettingError
from qualrl.qualitative import convergence
from qualrl.qualitative.bertrand import Sum, _check_far_out, decide_sum
from qualrl.qualitative.convergence import Verdict, decide_convergence, robbins_monro
from qualrl.qualitative.eventual import UndecidedError, bounds
from qualrl.qualitative.far_out import slopes
from qualrl.qualitative.formula import parse_formula
from qualrl.qualitative.landmark_weights import landmark_weights
from qualrl.qualitative.proving import findings, squared

# formula: whether the sum of a_k, and that of a_k**2, is finite
TRUTH = {
    "1/k": (False, True),
    "k**(-3/5)": (False, True),
    "(1+k)**-0.85": (False, True),
    "k**-1.0001": (True, True),
    "301/(300+k)": (False, True),
    "1/sqrt(k)": (False, False),
    "1/100": (False, False),
    "1/log(k+1)": (False, False),
    "1/sqrt(k*log(k))": (False, False),
    "0.1**(1.2**k)": (True, True),
    "0.99**k": (True, True),
    "exp(-k/500)/10": (True, True),
    "exp(-sqrt(k))": (True, True),
    "exp(-sqrt(log(k)))": (False, False),
    "exp(-log(k)**2)": (True, True),
    "0.1**(log(k)/5)": (False, False),
    "1/(k*log(k))": (False, True),
    "1/(k*log(k)**2)": (True, True),
    "log(k)/k": (False, True),
    "1/(sqrt(k)*log(k))": (False, True),
    "1/(k*log(log(k)))": (False, True),
    "1/(k*log(k)*log(log(k)))": (False, True),
    "1/(k*log(k)*log(log(k))**2)": (True, True),
    "1/(1+floor(k/100))": (False, True),
    "1/(1+ceil(k/7))^0.7": (False, True),
    "0.1*0.5**floor(k/1000)": (True, True),
    "1/(1+k-10*floor(k/10))": (False, False),
    "1/floor(sqrt(k))": (False, False),
    "floor(1+1/k)/k": (False, True),
    "1/k**(1+1/k)": (False, True),
    "max(1/k, 1/100)": (False, False),
    "max(1/k, 1/sqrt(k))/2": (False, False),
    "min(1/10, 10/k)": (False, True),
    "min(0.5, 1/(1+floor(k/10)), 0.999**k)": (True, True),
    "log(k+1)-log(k)": (False, True),
    "sqrt(k+1)-sqrt(k)": (False, False),
    "k/(k+1)-k/(k+2)": (False, True),
    "abs(1-k)**-1": (False, True),
    "exp(k)/exp(k+1)": (False, False),
    "0.3**log(log(k))/k": (True, True),
    "1/(k+exp(exp(k)))": (True, True),
    "exp(exp(-k))-1": (True, True),
}
PARAMETERS_DECIDE = ("(1+k)**-w", "eta**(m**k)", "w**k", "1/(k+k**w)", "k**-w + 1/k", "(a-2*b)**2/k + 1/k**2")
NOT_POSITIVE = ("(0-1)**k/k", "1/(k-2*floor(k/2))", "1/k - 1/100", "k - 2*floor(k/2)", "1/(k-k)", "log(1/k)", "0.5-k")
decided: dict[str, bool | None] = {}


def convergent(text: str, square: bool = False) -> bool | None:
    """The decision, or None; each formula only once in this file."""
    key = text + " squared" * square
    if key not in decided:
        tree = parse_formula(text, most_parameters=2).tree
        try:
            decided[key] = decide_sum(squared(tree) if square else tree).converges
        except UndecidedError:
            decided[key] = None
    return decided[key]


@pytest.mark.no_cover  # sympy calls so many functions that tracing it takes half the time
@pytest.mark.parametrize("text", TRUTH)
def test_known_sums_are_decided_and_never_wrongly(text):
    assert (convergent(text), convergent(text, square=True)) == TRUTH[text]


@pytest.mark.parametrize("text", PARAMETERS_DECIDE + NOT_POSITIVE)
def test_what_cannot_be_decided_is_not_guessed(text):
    assert convergent(text) is None


def condensed(text: str) -> bool:
    """Whether a falling sum is finite, as its own terms show; nothing of the prover is used.

    Either the terms shrink like a geometric series, or Cauchy's condensation is applied twice: sum a_k is finite just
    when d_i = 2**i 2**(2**i) a(2**(2**i)) has a finite sum, which is when d_i falls faster than 1/i.
    """
    numbers = mpmath.mp.clone()
    numbers.prec = 3500
    names = {name: getattr(numbers, name) for name in ("exp", "log", "sqrt", "floor", "ceil")}

    def term(k):
        return numbers.mpf(eval(text.replace("^", "**"), {**names, "k": numbers.mpf(k)}))  # of this file

    early = [term(k) for k in range(50, 75)]
    if all(later < 0.9 * sooner for sooner, later in pairwise(early)):
        return True
    logs = [numbers.log(term(2 ** (2**i))) + (i + 2**i) * numbers.log(2) for i in (9, 10)]
    return float((logs[0] - logs[1]) / numbers.log(numbers.mpf(10) / 9)) > 1.2


@pytest.mark.parametrize("text", [text for text in TRUTH if text != "k**-1.0001"])  # too near 1 to be seen
def test_decisions_agree_with_condensed_sums(text):
    assert convergent(text) == condensed(text)
    assert convergent(text, square=True) == condensed(f"({text})**2")


def test_partial_sums_of_eight_decades_agree():
    """A sum that converges hardly grows from 10**4 to 10**8 terms; one that diverges to infinity goes on."""
    for text in ("1/(1+k)", "(1+k)**-0.85", "1/(1+floor(k/100))", "(1+k)**-1.5", "0.1*0.5**floor(k/1000)"):
        formula = parse_formula(text)
        # one value for each of many stretches of k, as wide as they are far out
        ends = sorted({round(10 ** (8 * step / 4000)) for step in range(4001)})
        heights = formula.values_at(np.array(ends, dtype=np.float64))
        pieces = (heights[1:] + heights[:-1]) / 2 * np.diff(ends)
        far = pieces[np.array(ends[1:]) > 10**4].sum()
        assert (far < 0.1 * pieces.sum()) == convergent(text)


SANE = ("k**(-3/5)", "1/(k*log(k))", "0.99**k", "301/(300+k)", "1/sqrt(k)")


@pytest.mark.parametrize("text", SANE)
def test_sympy_itself_agrees_where_it_is_known_to_be_right(text):
    k = sympy.Symbol("k", integer=True, positive=True)
    expression = parse_formula(text).sympy().subs(sympy.Symbol("k", positive=True), k)
    assert bool(sympy.Sum(expression, (k, 2, sympy.oo)).is_convergent()) == convergent(text)


@settings(max_examples=8, deadline=None)
@given(
    st.fractions(Fraction(1, 10), 10, max_denominator=10),
    st.integers(1, 50),
    st.fractions(Fraction(1, 5), 2, max_denominator=10) | st.just(Fraction(1)),
    st.fractions(-2, 3, max_denominator=5),
)
def test_powers_and_logarithms(a, b, p, q):
    text = f"({a})*(k+{b})**-({p})*log(k+2)**-({q})"
    assert convergent(text) == (p > 1 or (p == 1 and q > 1))


def proof_in_process(text: str) -> dict[str, dict]:
    """What the proving process would print."""
    formula = parse_formula(text, most_parameters=2)
    return {finding["part"]: finding for finding in findings(formula.tree, ["sum", "squares"])}


RANGES = {
    "1/(1+k)**w": "1/2 < w <= 1",
    "min(0.1, 1/(1+k)**w)": "1/2 < w <= 1",
    "1/((k+2)*log(k+2)**w)": "0 < w <= 1",
    "(1+k)**-(w/(1+w))": "1 < w",
    "a*(1+k)**-(2*w)": "1/4 < w <= 1/2",
}


@pytest.mark.no_cover
@pytest.mark.parametrize("text", RANGES)
def test_ranges_of_a_parameter(text):
    assert proof_in_process(text)["range"]["lines"] == [RANGES[text]]


def test_parameters_that_do_not_matter_do_not_hinder():
    found = proof_in_process("a/(b+k)")
    assert (found["sum"]["state"], found["squares"]["state"], "range" in found) == ("none", "all", False)
    found = proof_in_process("exp(-w*k)")
    assert (found["sum"]["state"], found["squares"]["state"]) == ("all", "all")


@pytest.mark.parametrize("text", [*PARAMETERS_DECIDE[1:], "1/(1+k)**(v*w)", "(1-w)/(k+1)", "(1+k)**-w*log(k+2)**-v"])
def test_a_reason_is_given_where_nothing_is_decided(text):
    finding = proof_in_process(text)["sum"]
    assert finding["state"] == "unknown"
    assert finding["lines"][0].startswith("cannot decide: ")
    assert "depends on" in finding["lines"][0]


def test_certificates_name_the_exponent_and_the_comparison():
    found = proof_in_process("(1+k)**-0.85")
    assert "the exponent of k is 17/20 < 1" in found["sum"]["lines"][0]
    assert "the exponent of k is 17/10 > 1: a_k * k**(27/20) tends to 0" in found["squares"]["lines"][0]
    assert "log(k)**(3/2)" in proof_in_process("1/(k*log(k)**2)")["sum"]["lines"][-1]


def test_a_wrong_limit_does_not_pass_the_second_look():
    tree = parse_formula("(1+k)**-0.85").tree
    seen = slopes(tree)
    assert seen is not None
    assert seen[0] == pytest.approx(0.85, abs=1e-6)
    for wrong in (
        Sum(True, (), (sympy.Rational(3, 2),)),
        Sum(False, (), (sympy.Rational(1, 2),)),
        Sum(True, (), (sympy.oo,)),
    ):
        with pytest.raises(UndecidedError, match="slope"):
            _check_far_out(tree, wrong)
    with pytest.raises(UndecidedError, match="positive"):
        _check_far_out(parse_formula("1/k - 1/100").tree, Sum(False, (), (sympy.S.Zero,)))


@pytest.mark.parametrize("text", ["floor(k/7)", "ceil(k/7)-1", "k-3*floor(k/3)", "floor(2-1/(k+1))", "ceil(2+1/k)",
                                  "abs(3-floor(k/2))**-0.5", "(floor(k/3)-ceil(k/4))**3", "1/floor(sqrt(k))",
                                  "(1+floor(k/9))**(1/k)", "min(floor(k/3), k/4)-max(ceil(k/5), 2)", "(3-k/2)**2",
                                  "(1-floor(k/3))**2"])  # fmt: skip
def test_bounds_enclose_the_values(text):
    formula = parse_formula(text)
    low, high = bounds(formula.tree)
    k = sympy.Symbol("k", positive=True)
    for at, value in enumerate(formula.values(1000, 30), 1000):
        assert float(low.subs(k, at)) - 1e-9 <= value <= float(high.subs(k, at)) + 1e-9


def test_a_proof_through_a_process_of_its_own():
    proof = robbins_monro(parse_formula("1/(1+k)**w", most_parameters=1))
    assert (proof.holds, proof.range) == (Verdict.UNDECIDED, "1/2 < w <= 1")
    assert proof.lines[0].startswith("sum of alpha_k: the exponent is w")
    assert decide_convergence(parse_formula("0.5**k")).converges is Verdict.PROVED


def test_constants_need_no_process(monkeypatch):
    monkeypatch.setattr(subprocess, "run", None)
    proof = robbins_monro(parse_formula("0.01"))
    assert (proof.sum_diverges, proof.squares_converge, proof.holds) == ("proved", "refuted", "refuted")
    assert robbins_monro(parse_formula("0")).sum_diverges is Verdict.REFUTED
    assert robbins_monro(parse_formula("-1")).holds is Verdict.UNDECIDED


def test_a_proof_that_takes_too_long_is_undecided_in_time():
    began = time.perf_counter()
    proof = robbins_monro(parse_formula("1/(1+k)"), limit_s=0.05)
    assert time.perf_counter() - began < 5
    assert proof.holds is Verdict.UNDECIDED
    assert proof.lines == (
        "sum of alpha_k: cannot decide: took longer than 0.05 s",
        "sum of alpha_k**2: cannot decide: took longer than 0.05 s",
    )


def test_what_was_found_before_the_time_was_up_is_kept(monkeypatch):
    finding = json.dumps({"part": "sum", "state": "none", "lines": ["found"]})
    start = f"import time; print({finding!r}, flush=True); print('half', end='', flush=True); time.sleep(60)"
    monkeypatch.setattr(convergence, "START", start)
    proof = robbins_monro(parse_formula("1/(1+k)"), limit_s=2)
    assert (proof.sum_diverges, proof.squares_converge) == (Verdict.PROVED, Verdict.UNDECIDED)
    monkeypatch.setattr(convergence, "START", "import sys; sys.exit('out of memory')")
    assert "ended early: out of memory" in robbins_monro(parse_formula("1/(1+k)")).lines[0]


def test_a_script_without_a_main_guard_may_prove(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from qualrl.qualitative.convergence import robbins_monro\n"
        "from qualrl.qualitative.formula import parse_formula\n"
        "print(robbins_monro(parse_formula('1/(1+k)**0.6')).holds)\n"
    )
    (tmp_path / "sympy.py").write_text("raise SystemExit('a stray file')")  # beside the script, as for any import
    done = subprocess.run([sys.executable, "-P", script], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout == "proved\n"


def test_weights_of_the_landmark_step():
    found = landmark_weights(0.1, 1.2)
    assert found.total == (pytest.approx(0.231151608), pytest.approx(0.231151608))
    assert found.kept == (pytest.approx(0.787033107), pytest.approx(0.787033107))
    assert found.total[1] - found.total[0] < 1e-15
    assert "at least 78.7 %" in found.lines[-1]


@settings(max_examples=15, deadline=None)
@given(st.floats(0.001, 0.97), st.floats(1.05, 4))
def test_weights_lie_within_their_bounds(eta0, m):
    found = landmark_weights(eta0, m)
    numbers = mpmath.mp.clone()
    numbers.dps = 60
    weights, exponent = [numbers.mpf(repr(eta0))], numbers.mpf(1)
    while weights[-1] > 1e-60:
        exponent *= numbers.mpf(repr(m))
        weights.append(weights[0] ** exponent)
    assert found.total[0] <= numbers.fsum(weights) <= found.total[1]
    assert found.kept[0] <= numbers.fprod(1 - weight for weight in weights) <= found.kept[1]
    assert found.total[1] - found.total[0] <= 1e-13 * found.total[1]


def test_weights_at_the_edges():
    assert landmark_weights(0.0, 1.2).total == (0.0, 0.0)
    slow = landmark_weights(0.999, 1.00001)
    assert slow.total[0] < slow.total[1] < float("inf")
    assert "between" in slow.lines[1]
    for eta0, m in ((1.0, 1.2), (-0.1, 1.2), (0.1, 1.0), (float("nan"), 2.0), (0.1, float("inf"))):
        with pytest.raises(SettingError, match="eta0"):
            landmark_weights(eta0, m)
