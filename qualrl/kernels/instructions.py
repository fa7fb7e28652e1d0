"""Instructions of the processor for which Python has no word."""

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.cpython.unsafe import numbers
from numba.extending import intrinsic

from qualrl.kernels.jit import compiled_part

AHEAD = 16
"""How many items before its turn a loop asks for the memory of one: in no order of memory it mostly waits for it."""


def _prefetch(_: Any, array: Any, at: Any) -> Any:
    """What numba makes of ``prefetch``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), cgutils.voidptr_t)
        whole = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, whole, whole, whole])
        function = cast(Any, cgutils).get_or_insert_function(builder.module, kind, "llvm.prefetch")
        read, keep, memory = whole(0), whole(3), whole(1)
        builder.call(function, [address, read, keep, memory])
        return context.get_dummy_value()

    return types.void(array, types.int64), generate


prefetch = cast(Callable[[Any, int], None], intrinsic(_prefetch))
"""Ask for the memory of a one-dimensional array's item; nothing is read, and it need not exist."""

trailing_zeros = cast(Callable[[Any], Any], numbers.trailing_zeros)
"""The number of the lowest bit that is set in a word other than 0."""


@compiled_part
def ask_around(flat: Any, cell: int, width: int) -> None:
    """Ask for the memory of a cell and of those that share a side with it."""
    prefetch(flat, cell)
    prefetch(flat, cell - width)
    prefetch(flat, cell + width)
