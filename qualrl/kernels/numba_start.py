"""numba started without what machine code from the cache does not need: most of the compiler.

At its first call numba loads all that it can compile, and SciPy's linear algebra, only to see whether it is there,
and compiles the parts that count references.  Machine code from the cache brings along what it needs, so all this
can wait until something is compiled: that leaves out two fifths of the CPU time of a short run, and 60 MB.
"""

import sys
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from llvmlite import binding
from numba.core import caching, codegen, environment
from numba.core.registry import cpu_target
from numba.core.runtime import nrt, nrtdynmod

from qualrl.kernels.numba_lean import instead

FunctionCache: Any = caching.FunctionCache
lookup_environment: Any = environment.lookup_environment
compile_nrt_functions: Callable[[Any], Any] | None = getattr(nrtdynmod, "compile_nrt_functions", None)
CodeLibrary: Any = codegen.JITCodeLibrary
KNOWN = (
    compile_nrt_functions is not None
    and hasattr(environment, "_rebuild_env")
    and hasattr(FunctionCache, "_load_overload")
    and hasattr(FunctionCache, "_save_overload")
    and all(hasattr(CodeLibrary, name) for name in ("_unserialize", "_finalize_final_module"))
    and hasattr(codegen.JitEngine, "_load_defined_symbols")
)
"""Whether numba has the names that this file relies on; one that has others starts as it always does."""


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


class LateBitcode(CodeLibrary):  # type: ignore[misc]
    """Machine code of a loop; what other loops are compiled with, its bitcode, is read when one of them is compiled.

    numba reads it at once, and asks each of its symbols for its name: two thirds of the time that loading takes.
    """

    _shared_module: Any  # from the bitcode, when it was read

    def __init__(self, owner: Any, state: tuple[str, str, tuple[bytes, bytes]]) -> None:
        """``owner`` makes machine code for this computer; ``state`` is what numba keeps of a loop on disk."""
        name, kind, (self._machine_code, self._bitcode) = state
        assert kind == "object"
        super().__init__(owner, name)
        self.enable_object_caching()
        self._set_compiled_object(self._machine_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """Where a function's machine code is in memory; 0 if there is none."""
        return self._codegen._engine.get_function_address(name) if name.encode() in self._machine_code else 0

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return self._shared_module


class LightCache(FunctionCache):  # type: ignore[misc]
    """Machine code of a loop on disk, which is loaded without the compiler; that is started where there is none."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature, or None; numba calls this under its lock."""
        start_counting()
        with (
            instead(environment, "_rebuild_env", light_environment),
            instead(CodeLibrary, "_unserialize", LateBitcode),
            self._guard_against_spurious_io_errors(),
        ):
            found = self._load_overload(sig, target_context)
            if found is not None:
                return found
        start_compiler()
        return None


def keep_on_disk(loop: Any) -> None:
    """Let a loop that ``njit`` made look for its machine code on disk before anything is compiled.

    numba notices an edit in a loop's own file only, not in another file that it calls: here every edit of a kernel is
    noticed, and so is another version of this package.
    """
    if hasattr(loop, "_cache"):  # not where numba is switched off
        loop._cache = (LightCache if KNOWN else FunctionCache)(loop.py_func)
        index: Any = getattr(loop._cache, "_cache_file", None)
        if hasattr(index, "_source_stamp"):  # as in numba 0.61 to 0.68
            index._source_stamp = (index._source_stamp, stamp_of_kernels())


@cache
def stamp_of_kernels() -> tuple[float, int]:
    """When a kernel was last edited, and how long all of them are."""
    found = [source.stat() for source in Path(__file__).parent.glob("*.py")]
    return max((one.st_mtime for one in found), default=0.0), sum(one.st_size for one in found)


def light_environment(module: str, constants: list[Any], name: str) -> Any:
    """What machine code knows of Python: its constants.

    numba would load the module that it was compiled from; only code that was not compiled to the end looks into that.
    """
    known = lookup_environment(name)
    if known is not None:
        return known
    loaded = sys.modules.get(module)
    made = environment.Environment({"__name__": module} if loaded is None else loaded.__dict__)
    made.consts[:] = constants
    made.env_name = name
    environment.Environment._memo[name] = made
    return made


def start_counting() -> None:
    """Give machine code the counting of references; does nothing more when numba was in use before."""
    with instead(nrtdynmod, "compile_nrt_functions", LateLibrary):
        nrt.rtsys.initialize(cpu_target.target_context)


def start_compiler() -> None:
    """Load what numba loads before it compiles, but for SciPy."""
    from numba.np import linalg  # with it comes much of the compiler

    if hasattr(linalg, "ensure_blas"):
        with instead(linalg, "ensure_blas", lambda: None):
            cpu_target.target_context.refresh()
