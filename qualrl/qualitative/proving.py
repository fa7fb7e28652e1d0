"""What runs in a process of its own while a schedule is proved: reads one request, prints one finding a line.

Request and findings are JSON, so nothing that comes back can be anything but text; a finding is printed as soon as
it is made, so that a time limit loses only what was not found yet.
"""

import contextlib
import json
import sys
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from qualrl.qualitative.expression import Node, Number, Operation
from qualrl.qualitative.formula import parse_formula

MOST_MEMORY = 4 * 2**30


def main() -> None:
    """Answer the request on stdin."""
    _limit_memory()
    request = json.load(sys.stdin)
    tree = parse_formula(request["text"], request["names"]).tree
    for finding in findings(tree, request["parts"]):
        sys.stdout.write(json.dumps(finding) + "\n")
        sys.stdout.flush()


def findings(tree: Node, parts: list[str]) -> Iterator[dict[str, Any]]:
    """One finding for each part, sum or squares, and one for their common range when both are asked for."""
    from qualrl.qualitative.ranges import POSITIVE, as_text

    found: dict[str, tuple[Any, str] | None] = {}
    for part in parts:
        found[part], finding = _finding(tree if part == "sum" else squared(tree))
        yield {"part": part, **finding}
    of_sum, of_squares = found.get("sum"), found.get("squares")
    if of_sum is None or of_squares is None:
        return
    (converging, name), (squares, other) = of_sum, of_squares
    if (not name and not other) or (name and other and name != other):
        return
    both = squares - converging
    text = as_text(both, name or other) if both else ""
    yield {"part": "range", "state": "all" if both == POSITIVE else "some" if text else "none", "lines": [text]}


def squared(tree: Node) -> Node:
    """The tree of the squares."""
    return Operation("**", (tree, Number(Fraction(2))))


def _finding(tree: Node) -> tuple[tuple[Any, str] | None, dict[str, Any]]:
    """The set of parameters with a finite sum and their name, and the same for JSON."""
    from qualrl.qualitative.eventual import UndecidedError
    from qualrl.qualitative.ranges import POSITIVE, where_it_converges

    try:
        values, name, lines = where_it_converges(tree)
    except UndecidedError as problem:
        return None, {"state": "unknown", "lines": [f"cannot decide: {problem}"]}
    except (ArithmeticError, AttributeError, LookupError, NotImplementedError, RecursionError, TypeError,
            ValueError) as problem:  # fmt: skip
        # sympy meets what it was not made for in many ways; none of them is a decision
        return None, {"state": "unknown", "lines": [f"cannot decide: sympy gave up ({type(problem).__name__})"]}
    state = "all" if values == POSITIVE else "some" if values else "none"
    return (values, name), {"state": state, "lines": list(lines)}


def _limit_memory() -> None:
    """Where the system can: Windows has no such limit."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
