"""Expression trees: what a formula is once it is read.

Numbers are exact fractions, so 0.85 is 17/20.  A tree is evaluated with numpy and never needs sympy;
``in_sympy`` is there for whoever reasons about it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

UNARY: dict[str, Callable[[Any], Any]] = {
    "negative": np.negative, "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "floor": np.floor, "ceil": np.ceil,
    "abs": np.abs,
}  # fmt: skip
BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "min": np.minimum,
    "max": np.maximum,
}  # fmt: skip


@dataclass(frozen=True)
class Number:
    """An exact constant."""

    value: Fraction


@dataclass(frozen=True)
class Name:
    """k, or a parameter."""

    name: str


@dataclass(frozen=True)
class Operation:
    """A key of UNARY or BINARY and what it is applied to; min and max of more are nested."""

    name: str
    arguments: tuple["Node", ...]


Node = Number | Name | Operation


def evaluated(tree: Node, values: Mapping[str, NDArray[np.float64] | float]) -> Any:
    """The float64 value of a tree, quietly: infinite or nan where there is none."""
    with np.errstate(all="ignore"):
        return _evaluated(tree, values)


def replaced(tree: Node, values: Mapping[str, Fraction]) -> Node:
    """The tree with numbers in the place of some names."""
    if isinstance(tree, Name) and tree.name in values:
        return Number(values[tree.name])
    if isinstance(tree, Operation):
        return Operation(tree.name, tuple(replaced(argument, values) for argument in tree.arguments))
    return tree


def nodes(tree: Node) -> Iterator[Node]:
    """A tree and all trees in it."""
    yield tree
    if isinstance(tree, Operation):
        for argument in tree.arguments:
            yield from nodes(argument)


def depth(tree: Node) -> int:
    """How many operations stand inside each other, and one more."""
    return 1 + max(map(depth, tree.arguments)) if isinstance(tree, Operation) else 1


def names_in(tree: Node) -> set[str]:
    """The names that occur."""
    return {node.name for node in nodes(tree) if isinstance(node, Name)}


def bits(number: Number) -> int:
    """Of the longer side of the fraction bar."""
    return max(map(int.bit_length, number.value.as_integer_ratio()))


def folded(node: Operation) -> Node:
    """An operation on exact numbers as an exact number, where the result is rational."""
    if not all(isinstance(argument, Number) for argument in node.arguments):
        return node
    numbers = [argument.value for argument in node.arguments if isinstance(argument, Number)]
    if node.name == "**":
        return Number(Fraction(numbers[0] ** int(numbers[1]))) if numbers[1].denominator == 1 else node
    exact: dict[str, Callable[..., Any]] = {
        "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
        "negative": lambda a: -a, "min": min, "max": max, "abs": abs, "floor": lambda a: a // 1,
        "ceil": lambda a: -(-a // 1),
    }  # fmt: skip
    return Number(Fraction(exact[node.name](*numbers))) if node.name in exact else node


def _evaluated(tree: Node, values: Mapping[str, NDArray[np.float64] | float]) -> Any:
    if isinstance(tree, Number):
        return np.float64(_nearest(tree.value))
    if isinstance(tree, Name):
        return values[tree.name]
    arguments = [_evaluated(argument, values) for argument in tree.arguments]
    return UNARY[tree.name](*arguments) if tree.name in UNARY else BINARY[tree.name](*arguments)


def _nearest(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def in_sympy(tree: Node) -> Any:
    """The tree as a sympy expression of positive symbols."""
    import sympy

    if isinstance(tree, Number):
        return sympy.Rational(tree.value.numerator, tree.value.denominator)
    if isinstance(tree, Name):
        return sympy.Symbol(tree.name, positive=True)
    made: dict[str, Callable[..., Any]] = {
        "negative": lambda a: -a, "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b,
        "/": lambda a, b: a / b, "**": sympy.Pow, "exp": sympy.exp, "log": sympy.log, "sqrt": sympy.sqrt,
        "min": sympy.Min, "max": sympy.Max, "floor": sympy.floor, "ceil": sympy.ceiling, "abs": sympy.Abs,
    }  # fmt: skip
    return made[tree.name](*(in_sympy(argument) for argument in tree.arguments))
