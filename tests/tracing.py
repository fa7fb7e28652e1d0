"""Where coverage does not look: its trace function is called at every line and call of anyone's Python."""

import functools
import importlib
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from numba.core.dispatcher import Dispatcher

TWINS = [f"tests.{file.stem}" for file in Path(__file__).parent.glob("oracles*.py")]


def not_while_numba_compiles() -> None:
    """It would slow compiling by half."""
    _not_in(Dispatcher, "compile")


def not_while_a_picture_is_drawn() -> None:
    """All of that is matplotlib."""
    _not_in(Figure, "savefig")


def not_in_textbook_twins() -> None:
    """Loops of plain Python, which call nothing of the project's."""
    for name in TWINS:
        module = importlib.import_module(name)
        functions = inspect.getmembers(module, inspect.isfunction)
        _not_in(module, *(called for called, function in functions if function.__module__ == name))


def environment_without() -> dict[str, str]:
    """Of a process whose lines are not to be counted."""
    return {name: value for name, value in os.environ.items() if name != "COVERAGE_PROCESS_CONFIG"}


def _not_in(owner: Any, *names: str) -> None:
    for name in names:
        setattr(owner, name, _untraced(getattr(owner, name)))


def _untraced(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def run(*arguments: Any, **named: Any) -> Any:
        trace = sys.gettrace()
        if trace is None:
            return function(*arguments, **named)
        sys.settrace(None)
        try:
            return function(*arguments, **named)
        finally:
            sys.settrace(trace)

    return run
