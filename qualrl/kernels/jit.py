"""The one way this project compiles a loop.

Compiled code is cached on disk, beside the source if that can be written to; see ``numba_start.keep_on_disk``.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

from qualrl.kernels import numba_lean, numba_start

Function = TypeVar("Function", bound=Callable[..., object])

LEAN: dict[str, Any] = {"pipeline_class": numba_lean.LoopCompiler} if numba_lean.KNOWN else {}

# Options of numba's own, which njit passes on but does not declare
UNCOUNTED: dict[str, Any] = {"_nrt": False}
NOT_FROM_C: dict[str, Any] = {"no_cfunc_wrapper": True}
NOT_FROM_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}


def compiled(function: Function) -> Function:
    """Compile with numba: cached on disk, and the interpreter lock released while it runs."""
    return _on_disk(function, NOT_FROM_C)


def compiled_bare(function: Function) -> Function:
    """The same for a loop that allocates no array: it then need not count who refers to which.

    Counting costs an atomic operation for each array that a function takes out of a tuple, up to ten times the loop
    itself where parts are called at every step.
    """
    return _on_disk(function, {**UNCOUNTED, **NOT_FROM_C})


def _on_disk(function: Function, options: dict[str, Any]) -> Function:
    loop = njit(nogil=True, **LEAN, **options)(function)
    numba_start.keep_on_disk(loop)
    return cast(Function, loop)


def compiled_part(function: Function) -> Function:
    """The same for a part that only compiled loops call; a call from Python would crash, but ``part.py_func`` runs.

    The way in from Python takes tuples of arrays apart, which is half of what a small part costs to compile.
    """
    return cast(Function, njit(nogil=True, **LEAN, **UNCOUNTED, **NOT_FROM_C, **NOT_FROM_PYTHON)(function))


def compiled_inline(function: Function) -> Function:
    """The same for a part that is called at each step with tuples of many arrays, which a call would copy."""
    inline: dict[str, Any] = {"forceinline": True}
    return cast(Function, njit(nogil=True, **LEAN, **inline, **UNCOUNTED, **NOT_FROM_C, **NOT_FROM_PYTHON)(function))
