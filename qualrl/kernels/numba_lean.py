"""numba compiling without what the loops of this project have no use for: nearly half of the time that it takes.

A loop is made of parts that only compiled loops call.  numba makes each of them as if it were to be called from
Python: it optimizes it, makes machine code of it, and does both again where the part is linked into a loop.  Here a
part becomes machine code only as a piece of the loops that it is linked into, and is optimized as a whole only there.
numba also looks for closures, literals to unroll and much else that no loop here has, and goes through all that "+"
could mean, strings and dates included, whenever it meets one.
All this is done to the loops of this project alone, under names of numba that are looked for first.
"""

import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from llvmlite.binding import newpassmanagers
from numba.core import (
    base,
    codegen,
    compiler,
    compiler_machinery,
    environment,
    postproc,
    transforms,
    typed_passes,
    untyped_passes,
)
from numba.core.types import Array, Boolean, Number, NumberClass, functions

from qualrl.garbage import left_alone
from qualrl.kernels import numba_lowering
from qualrl.kernels.interrupts import held_back, let_through
from qualrl.kernels.numba_lowering import LoopLowering, NativeLowering

CodeLibrary: Any = codegen.JITCodeLibrary
CompilerBase: Any = compiler.CompilerBase
CalledFunction: Any = functions.BaseFunction
PassManager: Any = compiler_machinery.PassManager
PostProcessor: Any = postproc.PostProcessor
pass_registry: Any = compiler_machinery._pass_registry
VariableLifetime: Any = postproc.VariableLifetime
canonicalize_cfg: Any = transforms.canonicalize_cfg
TargetContext: Any = base.BaseContext
lookup_environment: Any = environment.lookup_environment
PASSES = tuple(
    (module, name)
    for module, names in (
        (untyped_passes, "TranslateByteCode FixupArgs IRProcessing RewriteSemanticConstants DeadBranchPrune"),
        (untyped_passes, "GenericRewrites RewriteDynamicRaises ReconstructSSA"),
        (typed_passes, "NopythonTypeInference PreLowerStripPhis IRLegalization AnnotateTypes"),
        (typed_passes, "NativeLowering NoPythonBackend"),
    )
    for name in names.split()
)
"""What is done with a loop, in order: of numba's passes those that change anything in one."""
USED = (
    (newpassmanagers, "create_new_function_pass_manager"),
    (getattr(newpassmanagers, "FunctionPassManager", None), "add_sroa_pass"),
    (getattr(newpassmanagers, "FunctionPassManager", None), "add_simplify_cfg_pass"),
    (getattr(newpassmanagers, "FunctionPassManager", None), "add_instruction_combine_pass"),
    (CodeLibrary, "add_ir_module"),
    (CodeLibrary, "_optimize_functions"),
    (CodeLibrary, "_get_module_for_linking"),
    (CodeLibrary, "finalize"),
    (codegen.JITCPUCodegen, "_function_pass_manager"),
    (codegen.JITCPUCodegen, "_pass_builder"),
    (codegen.JITCPUCodegen, "set_env"),
    (CompilerBase, "define_pipelines"),
    (CompilerBase, "_compile_core"),
    (CalledFunction, "get_call_type"),
    (PassManager, "_runPass"),
    (PostProcessor, "run"),
    (TargetContext, "get_abi_sizeof"),
)
KNOWN = numba_lowering.KNOWN and all(hasattr(owner, name) for owner, name in (*PASSES, *USED))
"""Whether numba has the names that this file relies on; one that has others compiles as it always does."""
FROM_PYTHON = "_ZN7cpython"
"""How names begin of the ways into loops from Python, which are left as they are: optimized they are no faster."""
OPERATORS = frozenset((bool, *(found for found in vars(operator).values() if callable(found))))


@contextmanager
def instead(module: ModuleType | type, name: str, value: object) -> Iterator[None]:
    """Another value under a name of a module or class, as long as the block runs."""
    kept = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, kept)


class LoopLibrary(CodeLibrary):  # type: ignore[misc]
    """Machine code of a loop."""

    def add_ir_module(self, module: Any) -> None:
        """Take in what numba wrote down."""
        for function in module.functions:
            if function.name.startswith(FROM_PYTHON):
                function.attributes.add("optnone")
                function.attributes.add("noinline")  # LLVM wants both
        super().add_ir_module(module)

    def _optimize_functions(self, ll_module: Any) -> None:
        """What is done before parts are linked in, with what is not only declared."""
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration and not function.name.startswith(FROM_PYTHON):
                passes, builder = self._passes()
                passes.run(function, builder)

    def _passes(self) -> tuple[Any, Any]:
        """Tidying up only: all is optimized once the parts are in."""
        passes = newpassmanagers.create_new_function_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_instruction_combine_pass()
        return passes, self._codegen._pass_builder()

    def finalize(self) -> None:
        """Optimize it, and make machine code of it; its parts have their constants from here on."""
        super().finalize()
        for name in [variable.name for variable in self._final_module.global_variables]:
            known = lookup_environment(name)
            if known is not None:
                self._codegen.set_env(name, known)


class PartLibrary(LoopLibrary):
    """A part of loops: there is no machine code of it but where it is linked in."""

    def finalize(self) -> None:
        """Link its own parts in."""
        for library in dict.fromkeys(self._linking_libraries):
            if hasattr(self, "_reload_init"):  # not before numba 0.63
                self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def _passes(self) -> tuple[Any, Any]:
        """What numba does: without it loops were made that ran at half the speed."""
        found: tuple[Any, Any] = self._codegen._function_pass_manager()
        return found

    def get_pointer_to_function(self, name: str) -> int:
        """Where a function's machine code is in memory: nowhere."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> "PartLibrary":
        """What numba tells a function's constants to: see ``set_env``."""
        return self

    def set_env(self, name: str, constants: Any) -> None:
        """The loop that the part is linked into tells its machine code."""


class LoopPasses(PassManager):  # type: ignore[misc]
    """What is done with a loop, one after the other, and nothing else: no timing, no checks of numba's own work."""

    def _runPass(self, index: int, given: Any, state: Any) -> None:  # noqa: N802
        let_through()
        given.analysis = self._analysis
        changed = [given.run_initialization(state), given.run_pass(state), given.run_finalizer(state)]
        if pass_registry.get(type(given)).mutates_CFG:
            if any(changed):
                PostProcessor(state.func_ir).run()
            else:
                state.func_ir.blocks = canonicalize_cfg(state.func_ir.blocks)


class LoopCompiler(CompilerBase):  # type: ignore[misc]
    """Compiles a loop, or a part of one that is not to be called from Python."""

    def define_pipelines(self) -> list[Any]:
        """What is done with it."""
        state = self.state
        if state.library is None:
            kind = PartLibrary if state.flags.no_cpython_wrapper else LoopLibrary
            state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
        passes = LoopPasses("loop")
        bare = not (state.flags.nrt or state.flags.debuginfo or state.func_id.is_generator)
        for module, name in PASSES:
            found = getattr(module, name)
            passes.add_pass(LoopLowering if bare and found is NativeLowering else found, name)
        passes.finalize()
        return [passes]

    def _compile_core(self) -> Any:
        with (
            instead(CalledFunction, "get_call_type", meaning),
            instead(PostProcessor, "run", lifetimes),
            instead(TargetContext, "get_abi_sizeof", size_of),
            left_alone(kept=True),
            held_back(),
        ):
            return super()._compile_core()


outlive: Callable[..., None] = PostProcessor.run


def lifetimes(processor: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Find where variables are needed: only where it is written down; how long they live is worked out when asked."""
    loop = processor.func_ir
    if emit_dels or loop.is_generator:
        outlive(processor, emit_dels, extend_lifetimes)
        return
    loop.blocks = canonicalize_cfg(loop.blocks)
    loop.variable_lifetime = VariableLifetime(loop.blocks)
    loop.generator_info = None


measure: Callable[..., int] = TargetContext.get_abi_sizeof
_sizes: dict[Any, int] = {}


def size_of(context: Any, kind: Any) -> int:
    """Bytes that a type takes, which numba asks of each variable; measured only once."""
    if kind not in _sizes:
        _sizes[kind] = measure(context, kind)
    return _sizes[kind]


look_up: Callable[..., Any] = CalledFunction.get_call_type
_meanings: dict[tuple[Any, ...], Any] = {}


def meaning(function: Any, context: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """What a call means for arguments of some types: for operators and conversions of numbers, found out only once."""
    known = function.key[0] in OPERATORS or isinstance(function.key[0], NumberClass)
    plain = known and all(isinstance(kind, Number | Boolean | Array) for kind in arguments)
    if not plain or named:
        return look_up(function, context, arguments, named)
    key = function, context, arguments
    if key not in _meanings:
        _meanings[key] = look_up(function, context, arguments, named)
    return _meanings[key]
