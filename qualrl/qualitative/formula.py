"""Formulas in k that strangers write: read by a small grammar of our own, never run as Python.

    expression = term {(+|-) term}              min, max     two arguments or more
    term       = factor {(*|/) factor}          exp log ln sqrt floor ceil ceiling abs     one
    factor     = (+|-) factor | power           number       12, 0.85, .5, 1e-3; read exactly, 0.85 is 17/20
    power      = atom [(**|^) factor]           name         k, and whatever else the caller allows
    atom       = number | name | name(expression, ...) | (expression)

k counts from 0.  Binding is Python's: -k**2 is -(k**2), 2**3**2 is 2**9.  The text is checked letter by letter and
its size, depth and constants are bounded, so no text can run, hang or fill the memory.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import isfinite
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import FormulaError, did_you_mean
from qualrl.qualitative.expression import (
    BINARY,
    UNARY,
    Name,
    Node,
    Number,
    Operation,
    bits,
    depth,
    evaluated,
    folded,
    in_sympy,
    names_in,
)

MOST_CHARACTERS = 200
MOST_DEPTH = 100
"""Of the tree; a sum of 99 terms has as many levels."""
MOST_PARENTHESES = 30
MOST_DIGITS = 30
MOST_EXPONENT = 30
"""Of a number such as 1e-30."""
MOST_POWER = 1000
"""Of a constant exponent, either way."""
MOST_BITS = 4096
"""Of an exact constant, above and below its fraction bar."""

ALIASES = {"ln": "log", "ceiling": "ceil", "^": "**"}
FUNCTIONS = ("exp", "log", "ln", "sqrt", "min", "max", "floor", "ceil", "ceiling", "abs")
CONSTANTS = {"e": "exp(1), or 1e-3 without blanks", "pi": "3.14159", "inf": "a number", "nan": "a number"}

TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z][A-Za-z0-9]*)"
    r"|(?P<sign>\*\*|[-+*/^(),])|(?P<space>[ \t]+)",
    re.ASCII,
)


@dataclass(frozen=True)
class Formula:
    """A formula that was read: its text, and the tree that all else is computed from."""

    text: str
    tree: Node

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names that occur, sorted."""
        return tuple(sorted(names_in(self.tree)))

    def values(self, first: int, count: int) -> NDArray[np.float64]:
        """(count,) float64: the values at k = first, first + 1, ...; FormulaError where there is none."""
        return self.values_at(np.arange(first, first + count, dtype=np.float64))

    def values_at(self, k: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values at each k of an array; FormulaError names the first k without a finite one."""
        others = [name for name in self.names if name != "k"]
        if others:
            raise FormulaError(f"{self.text}: has no values while {', '.join(others)} is not given a number")
        found = np.broadcast_to(np.asarray(evaluated(self.tree, {"k": k}), np.float64), k.shape).copy()
        wrong = np.flatnonzero(~np.isfinite(found))
        if wrong.size:
            hint = "; k counts from 0, so write k + 1 for 1, 2, 3, ..." if k[wrong[0]] == 0 else ""
            raise FormulaError(f"{self.text}: has no finite value at k = {k[wrong[0]]:.0f}{hint}")
        return found

    def sympy(self) -> Any:
        """The same as a sympy expression of positive symbols; FormulaError when it has no value at any k.

        sympy simplifies at once, which a hostile formula can make slow; what must end in time is proved in a process
        of its own, see ``convergence``.
        """
        import sympy

        found = in_sympy(self.tree)
        if found.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            raise FormulaError(f"{self.text}: divides by zero, or takes the logarithm of zero, at every k")
        return found


def parse_formula(text: str, names: Sequence[str] = ("k",), most_parameters: int = 0) -> Formula:
    """Read a formula in ``names`` and at most ``most_parameters`` further lower-case names.

    Raises FormulaError, which says in which column (from 1) what is wrong and what to do.

    >>> parse_formula("0.5 / (1 + k)^0.85").names
    ('k',)
    """
    if len(text) > MOST_CHARACTERS:
        raise FormulaError(f"column {MOST_CHARACTERS + 1}: longer than {MOST_CHARACTERS} characters; shorten it")
    return Formula(text, _Reader(text, names, most_parameters).whole())


def constant_formula(value: float) -> Formula:
    """The formula that is one number at every k: the shortest decimal that reads back as ``value``."""
    return Formula(repr(value), Number(Fraction(repr(value))))


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    column: int  # from 1


def _tokens(text: str) -> Iterator[_Token]:
    at = 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise FormulaError(f"column {at + 1}: {text[at]!a} has no place in a formula; {_instead_of(text[at])}")
        if match.lastgroup != "space":
            yield _Token(str(match.lastgroup), match.group(), at + 1)
        at = match.end()
    yield _Token("end", "", len(text) + 1)


def _instead_of(character: str) -> str:
    if character == "_":
        return "write numbers without underscores, and names of letters and digits"
    if character == "%":
        return "for the remainder of a by b write a - b*floor(a/b)"
    if character in "[]{}":
        return "use round parentheses"
    return "write + - * / **, numbers, names and round parentheses only"


class _Reader:
    """Recursive descent over the tokens; one method for each line of the grammar above."""

    def __init__(self, text: str, names: Sequence[str], most_parameters: int) -> None:
        self.tokens = list(_tokens(text))
        self.names = list(names)
        self.room = most_parameters
        self.at = 0
        self.open = 0

    def whole(self) -> Node:
        tree = self.expression()
        if self.next.kind != "end":
            self.fail(f"{self.next.text!r} does not fit here", self.hint_between())
        return tree

    def expression(self) -> Node:
        left = self.term()
        while self.next.text in ("+", "-"):
            sign = self.take()
            left = self.made(sign, sign.text, left, self.term())
        return left

    def term(self) -> Node:
        left = self.factor()
        while self.next.text in ("*", "/"):
            sign = self.take()
            left = self.made(sign, sign.text, left, self.factor())
        return left

    def factor(self) -> Node:
        signs = []
        while self.next.text in ("+", "-"):
            signs.append(self.take())
        found = self.power()
        for sign in reversed(signs):
            if sign.text == "-":
                found = self.made(sign, "negative", found)
        return found

    def power(self) -> Node:
        base = self.atom()
        if self.next.text not in ("**", "^"):
            return base
        sign = self.take()
        self.enter(sign)
        exponent = self.factor()
        self.open -= 1
        return self.made(sign, "**", base, exponent)

    def atom(self) -> Node:
        token = self.next
        if token.kind == "number":
            return self.number(self.take())
        if token.kind == "name":
            return self.name_or_call(self.take())
        if token.text == "(":
            return self.inside(self.take())[0]
        what = "the formula ends too early" if token.kind == "end" else f"{token.text!r} does not fit here"
        self.fail(what, "a number, a name or '(' belongs here")

    def number(self, token: _Token) -> Node:
        mantissa, _, exponent = token.text.lower().partition("e")
        digits = mantissa.replace(".", "")
        if len(digits) > MOST_DIGITS:
            self.fail(f"a number of {len(digits)} digits", f"at most {MOST_DIGITS} are read", token)
        if len(exponent) > 4 or abs(int(exponent or "0")) > MOST_EXPONENT:
            self.fail(f"the exponent of {token.text}", f"from -{MOST_EXPONENT} to {MOST_EXPONENT} are read", token)
        return Number(Fraction(token.text))

    def name_or_call(self, token: _Token) -> Node:
        if self.next.text == "(":
            return self.call(token, self.take())
        name = token.text
        if name in self.names:
            return Name(name)
        if name in FUNCTIONS:
            self.fail(f"{name} is a function", f"write {name}(...)", token)
        if name in CONSTANTS:
            self.fail(f"{name!r} is no name here", f"write {CONSTANTS[name]}", token)
        if self.room and name.islower():
            self.room -= 1
            self.names.append(name)
            return Name(name)
        tail = did_you_mean(name, [*self.names, *FUNCTIONS])
        if not tail.startswith("did you mean"):
            tail = f"allowed: {', '.join(self.names)}"
        self.fail(f"unknown name {name!r}", tail, token)

    def call(self, name: _Token, bracket: _Token) -> Node:
        if name.text not in FUNCTIONS:
            hint = did_you_mean(name.text, FUNCTIONS)
            if name.text in self.names:
                hint = f"to multiply, write {name.text}*(...)"
            self.fail(f"{name.text!r} is no function", hint, name)
        function = ALIASES.get(name.text, name.text)
        arguments = self.inside(bracket, many=True)
        if function not in BINARY and len(arguments) != 1:
            self.fail(f"{name.text} takes one argument, not {len(arguments)}", "remove the others", name)
        if function in BINARY and len(arguments) < 2:
            self.fail(f"{name.text} of one argument", "give it two or more, with commas between", name)
        found = arguments[0]
        if function in UNARY:
            return self.made(name, function, found)
        for argument in arguments[1:]:
            found = self.made(name, function, found, argument)
        return found

    def inside(self, bracket: _Token, many: bool = False) -> list[Node]:
        self.enter(bracket)
        found = [self.expression()]
        while many and self.next.text == ",":
            self.take()
            found.append(self.expression())
        if self.next.text != ")":
            self.fail(f"the '(' of column {bracket.column} is not closed", f"')' or {self.hint_between()}")
        self.take()
        self.open -= 1
        return found

    def made(self, token: _Token, name: str, *arguments: Node) -> Node:
        """The operation, as one exact number where it is one; FormulaError for a constant without a usable value."""
        node = Operation(name, arguments)
        if depth(node) > MOST_DEPTH:
            self.fail("too many operations inside each other", f"at most {MOST_DEPTH} levels are read", token)
        if name == "**":
            self.check_power(token, *arguments)
        if name == "/" and arguments[1] == Number(Fraction(0)):
            self.fail("division by zero", "change the denominator", token)
        return node if names_in(node) else self.constant(token, node)

    def constant(self, token: _Token, node: Operation) -> Node:
        found = folded(node)
        if isinstance(found, Number) and bits(found) > MOST_BITS:
            self.fail("too long a constant", "use smaller numbers", token)
        if not isfinite(evaluated(found, {})):
            self.fail("this constant has no value, or too large a one", "use other numbers", token)
        return found

    def check_power(self, token: _Token, base: Node, exponent: Node) -> None:
        if names_in(exponent):
            return
        size = abs(float(evaluated(exponent, {})))
        if size > MOST_POWER:
            self.fail("too large an exponent", f"from -{MOST_POWER} to {MOST_POWER} are read", token)
        if isinstance(base, Number) and size * bits(base) > MOST_BITS:
            self.fail("too large a power of a constant", "use smaller numbers", token)
        if base == Number(Fraction(0)) and evaluated(exponent, {}) < 0:
            self.fail("division by zero", "change the base or the exponent", token)

    @property
    def next(self) -> _Token:
        return self.tokens[self.at]

    def take(self) -> _Token:
        self.at += 1
        return self.tokens[self.at - 1]

    def enter(self, token: _Token) -> None:
        self.open += 1
        if self.open > MOST_PARENTHESES:
            self.fail("too many parentheses or powers inside each other", f"at most {MOST_PARENTHESES} are read", token)

    def hint_between(self) -> str:
        return "one of + - * / ** belongs here" if self.next.kind in ("number", "name") or self.next.text == "(" else (
            "the formula should go on or end here")  # fmt: skip

    def fail(self, what: str, hint: str, token: _Token | None = None) -> NoReturn:
        raise FormulaError(f"column {(token or self.next).column}: {what}; {hint}")
