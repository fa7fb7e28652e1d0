"""numba started without what machine code from the cache does not need.

At its first call numba loads SciPy's linear algebra, only to see whether it is there, and compiles the parts that
count references, which machine code from the cache brings along.  Both can wait until something is compiled that
wants them: that leaves out a fourth of the CPU time of a short run, and 50 MB.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from types import ModuleType
from typing import Any

from numba.core.registry import cpu_target
from numba.core.runtime import nrtdynmod
from numba.np import linalg

compile_nrt_functions: Callable[[Any], Any] | None = getattr(nrtdynmod, "compile_nrt_functions", None)


class LateLibrary:
    """Stands for the compiled parts that count references, and compiles them when it is first asked for anything."""

    def __init__(self, context: Any) -> None:
        self._context = context

    @cached_property
    def _compiled(self) -> Any:
        assert compile_nrt_functions is not None
        return compile_nrt_functions(self._context)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._compiled, name)


@contextmanager
def _instead(module: ModuleType, name: str, value: object) -> Iterator[None]:
    """Another value under a name of a module, as long as the block runs."""
    kept = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, kept)


def start() -> None:
    """Load what numba loads at its first call, but for the two; does nothing more when numba was in use before.

    A numba that has other names for them starts as it always does.
    """
    if not (hasattr(nrtdynmod, "compile_nrt_functions") and hasattr(linalg, "ensure_blas")):
        return
    with _instead(nrtdynmod, "compile_nrt_functions", LateLibrary), _instead(linalg, "ensure_blas", lambda: None):
        cpu_target.target_context.refresh()
