"""The one way this project compiles a loop.

Compiled code is cached on disk beside the source. The cache notices an edit in the kernel's own
file only, so kernels that call each other live in one file.
"""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile with numba: cached on disk, and the interpreter lock released while it runs."""
    return cast(Function, njit(cache=True, nogil=True)(function))
