"""Where coverage does not look: its trace function is called for every line and call of anyone's Python."""

import functools
import gc
import os
import sys
from collections.abc import Callable
from typing import Any

from numba.core.dispatcher import Dispatcher


def not_while_numba_compiles() -> None:
    """Compile without the trace function, which slows it by half, and without looking for garbage: a tenth more."""
    Dispatcher.compile = _untraced(Dispatcher.compile)


def _untraced(compile_for: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(compile_for)
    def run(*arguments: Any) -> Any:
        trace, collects = sys.gettrace(), gc.isenabled()
        sys.settrace(None)
        gc.disable()
        try:
            return compile_for(*arguments)
        finally:
            if collects:
                gc.enable()
            sys.settrace(trace)

    return run


def environment_without() -> dict[str, str]:
    """Of a process whose lines are not to be counted."""
    return {name: value for name, value in os.environ.items() if name != "COVERAGE_PROCESS_CONFIG"}
