"""Coverage looks at the project's Python, not at numba while it compiles."""

import functools
import sys
from collections.abc import Callable
from typing import Any

from numba.core.dispatcher import Dispatcher


def untraced(compile_for: Callable[..., Any]) -> Callable[..., Any]:
    """The same without the trace function, which would be called millions of times for nothing and slow it by half."""

    @functools.wraps(compile_for)
    def run(*arguments: Any) -> Any:
        trace = sys.gettrace()
        sys.settrace(None)
        try:
            return compile_for(*arguments)
        finally:
            sys.settrace(trace)

    return run


Dispatcher.compile = untraced(Dispatcher.compile)
