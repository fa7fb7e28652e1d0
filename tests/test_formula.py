"""Formulas of strangers: what is read, what is refused, and that nothing of it is ever run."""

import builtins
import math
import time
from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import FormulaError, QualrlError
from qualrl.qualitative.expression import Name, Number, Operation, folded
from qualrl.qualitative.formula import MOST_CHARACTERS, constant_formula, parse_formula

ACCEPTED = {
    "1/(1+k)^0.85": lambda k: (1 + k) ** -0.85,
    "-k**2": lambda k: -(k**2),
    "2**3**2": lambda k: 512,
    "2**-k": lambda k: 2.0**-k,
    "1 - 2 - 3*k/4/2": lambda k: 1 - 2 - 3 * k / 4 / 2,
    "--k": lambda k: k,
    "exp(-k/500)/10": lambda k: math.exp(-k / 500) / 10,
    "min(0.1, 10/(1+k), 3)": lambda k: min(0.1, 10 / (1 + k)),
    "max(1e-3,.5 - k)": lambda k: max(0.001, 0.5 - k),
    "ln(k+1) + log(k+1)": lambda k: 2 * math.log(k + 1),
    "ceil(k/3) - ceiling(k/3) + floor(k/7)": lambda k: k // 7,
    "abs(3-k)*sqrt(k)": lambda k: abs(3 - k) * math.sqrt(k),
    "\tk ": lambda k: k,
    "0.1**(1.2**k)": lambda k: 0.1 ** (1.2**k),
    "+".join(["k"] * 100): lambda k: 100 * k,
    "k": lambda k: k,
    "7": lambda k: 7,
}


@pytest.mark.parametrize("text", ACCEPTED)
def test_values_are_those_of_python(text):
    expected = [ACCEPTED[text](k) for k in range(3, 40)]
    np.testing.assert_allclose(parse_formula(text).values(3, 37), expected, rtol=1e-11)


def test_decimals_are_exact():
    assert parse_formula("0.85").tree == Number(Fraction(17, 20))
    assert parse_formula("1e-3 + .85").tree == Number(Fraction(851, 1000))
    assert constant_formula(0.1).tree == Number(Fraction(1, 10))
    assert constant_formula(5e-324).values(0, 1)[0] == 5e-324


REFUSED = {
    "": "column 1: the formula ends too early",
    "alhpa": "column 1: unknown name 'alhpa'; allowed: k",
    "K": "column 1: unknown name 'K'; did you mean 'k'?",
    "1 + expp(k)": "column 5: 'expp' is no function; did you mean 'exp'?",
    "exp": "column 1: exp is a function; write exp(...)",
    "k(2)": "column 1: 'k' is no function; to multiply, write k*(...)",
    "2k": "column 2: 'k' does not fit here; one of + - * / ** belongs here",
    "1/(1+k)^0.6^)": "column 13: ')' does not fit here; a number, a name",  # ^ is one column wide
    "(k": "column 3: the '(' of column 1 is not closed",
    "k)": "column 2: ')' does not fit here",
    "min(k)": "column 1: min of one argument",
    "exp(1, 2)": "column 1: exp takes one argument, not 2",
    "e**k": "column 1: 'e' is no name here; write exp(1)",
    "1/0": "column 2: division by zero",
    "5/(2*3-6)": "column 2: division by zero",
    "0**(0-1)": "column 2: division by zero",
    "log(0)": "column 1: this constant has no value",
    "sqrt(-1)": "column 1: this constant has no value",
    "(-8)**(1/3)": "column 5: this constant has no value",
    "9**9**9": "column 2: too large an exponent",
    "(10**12)**64": "column 9: this constant has no value, or too large a one",
    "((10**12)**20)**9": "column 15: too large a power of a constant",
    "k**(10**12)": "column 2: too large an exponent",
    "exp(10)**exp(10)": "column 8: too large an exponent",
    "exp(exp(exp(exp(3))))": "column 5: this constant has no value, or too large a one",
    "1/2**1000/2**1000/2**1000/2**1000/2**1000": "column 34: too long a constant",
    "1e999999999": "column 1: the exponent of 1e999999999; from -30 to 30",
    "1" * 31: "column 1: a number of 31 digits; at most 30",
    "k" * 201: "column 201: longer than 200 characters",
    "(" * 90 + "k" + ")" * 90: "column 31: too many parentheses",
    "2**" * 60 + "k": "too many parentheses or powers inside each other",
    "-" * 150 + "k": "too many operations inside each other",
    "1_000": "column 2: '_' has no place in a formula; write numbers without underscores",
    "3j": "column 2: 'j' does not fit here",
    "0x10": "column 2: 'x10' does not fit here",
    "k%2": "column 2: '%' has no place in a formula; for the remainder",
    "k//2": "column 3: '/' does not fit here",
    "[k]": "column 1: '[' has no place in a formula; use round parentheses",
    "\0": "column 1: '\\x00' has no place",
    "k\n+1": "column 2: '\\n' has no place",
    "ĸ": "column 1: '\\u0138' has no place",
    "\N{MATHEMATICAL BOLD SMALL K}": "has no place",  # normalises to a plain k for Python's own parser
    "\N{ARABIC-INDIC DIGIT ONE}": "has no place",
    "k if k else 1": "column 3: 'if' does not fit here",
    "k.__class__": "column 2: '.' has no place",
    "().__class__.__base__.__subclasses__()": "column 3: '.' has no place",
    "__import__('os').system('touch pwned')": "column 1: '_' has no place",
    "open(1)": "column 1: 'open' is no function",
    "lambda: k": "has no place",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_refused_says_where_why_and_what_to_do(text):
    began = time.process_time()
    with pytest.raises(FormulaError) as problem:
        parse_formula(text)
    assert time.process_time() - began < 2
    assert REFUSED[text] in str(problem.value)
    assert str(problem.value).startswith("column ")
    assert ";" in str(problem.value)
    assert isinstance(problem.value, QualrlError)


def test_parameters_are_allowed_only_where_the_caller_says_so():
    assert parse_formula("a/(b + k)", most_parameters=2).names == ("a", "b", "k")
    assert parse_formula("eta0**(m**n)", ("n", "eta0", "m")).names == ("eta0", "m", "n")
    for text in ("a*b/(c + k)", "A/k", "pi/k"):
        with pytest.raises(FormulaError, match="column"):
            parse_formula(text, most_parameters=2)
    with pytest.raises(FormulaError, match="while a is not given a number"):
        parse_formula("a*k", most_parameters=1).values(0, 1)


def test_values_that_do_not_exist_are_named_by_their_k():
    for text, where in {"1/k": "k = 0; k counts from 0", "1/(k-3)": "k = 3", "log(2-k)": "k = 2", "k**k": "k = 144",
                        "1/(k-k)": "k = 0", "sqrt(5-k)": "k = 6"}.items():  # fmt: skip
        with pytest.raises(FormulaError, match=where):
            parse_formula(text).values(0, 200)
    with pytest.raises(FormulaError, match="at every k"):
        parse_formula("1/(k-k)").sympy()


FORMULA_LETTERS = st.text("k0123456789.+-*/^(),e explogsqrtminmaxflorceilabs_'[]\"=%\0\n", max_size=MOST_CHARACTERS + 2)


def read_quietly(text: str) -> None:
    """Read any text: a formula or a FormulaError of one line, soon."""
    began, message = time.process_time(), None
    try:
        found = parse_formula(text, most_parameters=2)
    except FormulaError as problem:
        message = str(problem)
    seconds = time.process_time() - began
    assert found.text == text if message is None else message.startswith("column ") and "\n" not in message
    assert seconds < 2


def test_nothing_of_a_formula_is_run(monkeypatch):
    def never(*_arguments, **_options):
        raise AssertionError("a formula was handed to Python")

    with monkeypatch.context() as patched:
        for name in ("eval", "exec", "compile", "__import__"):
            patched.setattr(builtins, name, never)
        for text in [*REFUSED, *ACCEPTED]:
            read_quietly(text)


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=60) | FORMULA_LETTERS)
def test_any_text_is_a_formula_or_a_formula_error(text):
    read_quietly(text)


numbers = st.sampled_from(["1", "2", "0.5", "3.25", "1e-2", "10"])


def larger(inner):
    """Formulas of positive parts only: without cancellation float64 and exact arithmetic must agree."""
    pairs = st.tuples(inner, inner)
    return st.one_of(
        pairs.map("({0[0]} + {0[1]})".format),
        pairs.map("({0[0]}*{0[1]})".format),
        pairs.map("({0[0]}/{0[1]})".format),
        pairs.map("min({0[0]}, {0[1]})".format),
        pairs.map("max({0[0]}, {0[1]})".format),
        inner.map("sqrt({})".format),
        inner.map("log(2 + {})".format),
        inner.map("exp(-{}/9)".format),
        inner.map("abs(-{})".format),
        st.tuples(inner, st.sampled_from(["2", "0.5", "-1.5"])).map("({0[0]})**{0[1]}".format),
    )


@settings(max_examples=60, deadline=None)
@given(st.recursive(numbers | st.just("(k+1)"), larger, max_leaves=6))
def test_numpy_and_sympy_agree_on_values(text):
    formula = parse_formula(text)
    expression = formula.sympy()
    try:
        values = formula.values(0, 5)
    except FormulaError:
        return  # beyond float64
    for k, value in enumerate(values):
        exact = sympy.N(expression.subs(sympy.Symbol("k", positive=True), k), 30)
        assert value == pytest.approx(float(exact), rel=1e-9, abs=1e-300)


def test_folding_keeps_what_is_not_rational():
    root = Operation("**", (Number(Fraction(2)), Number(Fraction(1, 2))))
    assert folded(root) == root
    assert folded(Operation("+", (Name("k"), Number(Fraction(1))))).name == "+"
    assert folded(Operation("floor", (Number(Fraction(-5, 2)),))) == Number(Fraction(-3))
    assert folded(Operation("ceil", (Number(Fraction(-5, 2)),))) == Number(Fraction(-2))
