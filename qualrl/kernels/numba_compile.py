"""What of numba's compiling this project leaves out: it takes a tenth off the time until a first loop runs.

Parts of loops do not become machine code, which nobody would call: it is their bitcode that goes into the loops.  And
no garbage is looked for while something is compiled: all that is made is kept until it is done.
"""

import gc
from typing import Any

from numba.core import codegen
from numba.core.compiler import Compiler

CodeLibrary: Any = codegen.JITCodeLibrary
KNOWN = hasattr(Compiler, "compile_extra") and hasattr(CodeLibrary, "_finalize_final_module")
"""Whether numba has the names that this file relies on; one that has others compiles parts as anything else."""


class PartCode(CodeLibrary):  # type: ignore[misc]
    """The code of a part, to be linked into what calls it."""

    def _finalize_final_module(self) -> None:
        """Leave the optimised code as it is; numba makes machine code here."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Nowhere: there is no machine code."""
        return 0

    @property
    def codegen(self) -> "PartCode":
        """What is told of constants: see ``set_env``."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Nothing to do: only machine code that works with Python's objects looks up constants, and parts do not."""


class LoopCompiler(Compiler):
    """numba's compiler, for a loop."""

    def compile_extra(self, function: Any) -> Any:
        """Compile a Python function."""
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(function)  # type: ignore[no-untyped-call]
        finally:
            if collecting:
                gc.enable()


class PartCompiler(Compiler):
    """numba's compiler, for a part."""

    def compile_extra(self, function: Any) -> Any:
        """Compile a Python function."""
        self.state.library = PartCode(self.state.targetctx.codegen(), function.__qualname__)
        return super().compile_extra(function)  # type: ignore[no-untyped-call]


LOOP: dict[str, Any] = {"pipeline_class": LoopCompiler} if KNOWN else {}
"""What ``njit`` is told of a loop."""
PART: dict[str, Any] = {"pipeline_class": PartCompiler} if KNOWN else {}
"""What it is told of a part."""
