"""The one way this project compiles a loop.

Compiled code is cached on disk beside the source. numba notices an edit in a kernel's own file only,
not in another file that it calls, so what was compiled before the newest edit of any kernel goes first.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile with numba: cached on disk, and the interpreter lock released while it runs."""
    return cast(Function, njit(cache=True, nogil=True)(function))


def compiled_bare(function: Function) -> Function:
    """The same for a loop that allocates no array: it then need not count who refers to which.

    Counting costs an atomic operation for each array that a function takes out of a tuple, up to ten times the loop
    itself where parts are called at every step.
    """
    bare: Any = {"_nrt": False}
    return cast(Function, njit(cache=True, nogil=True, **bare)(function))


def forget_stale(folder: Path) -> None:
    """Delete the indices of compiled code that are older than the newest source file of the folder."""
    with suppress(OSError):  # a folder that is not ours to write to keeps what it has
        edited = max(source.stat().st_mtime for source in folder.glob("*.py"))
        for index in folder.glob("__pycache__/*.nbi"):
            if index.stat().st_mtime < edited:
                index.unlink(missing_ok=True)


forget_stale(Path(__file__).parent)
