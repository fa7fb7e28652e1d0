"""How a loop that counts no references is written down for LLVM: with a quarter less to read.

numba gives each variable a place in memory and reads whole tuples of arrays from there, time and again, for LLVM to
find out that they never change.  Here what is set once, before anything branches, is a value from then on.  numba also
copies an array's description to memory for each element that is read; here the element is read at once.
"""

from collections import Counter
from typing import Any

from numba.core import base, cgutils, compiler_machinery, ir, lowering, typed_passes, types

Context: Any = base.BaseContext
Lower: Any = lowering.Lower
NativeLowering: Any = typed_passes.NativeLowering
Array: Any = types.Array
BaseTuple: Any = types.BaseTuple
tools: Any = cgutils
register_pass: Any = compiler_machinery.register_pass
USED = (
    (Lower, "_find_singly_assigned_variable delvar storevar loadvar getvar _alloca_var lower_getitem lower_setitem"),
    (Context, "unpack_value pack_value cast enable_boundscheck"),
    (NativeLowering, "lowering_class"),
    (cgutils, "unpack_tuple get_item_pointer2"),
)
KNOWN = all(hasattr(owner, name) for owner, names in USED for name in names.split())
"""Whether numba has the names that this file relies on."""


class LoopLower(Lower):  # type: ignore[misc]
    """Writes down a loop, or a part of one, that counts no references, is no generator and is not to be debugged."""

    def _find_singly_assigned_variable(self) -> None:
        """Besides what numba finds: what the first block sets, if nothing else does; it comes before all others."""
        super()._find_singly_assigned_variable()
        first = self.blocks[min(self.blocks)]
        times = Counter(set_to.target.name for block in self.blocks.values() for set_to in block.find_insts(ir.Assign))
        once = (set_to.target.name for set_to in first.find_insts(ir.Assign))
        self._singly_assigned_vars.update(name for name in once if times[name] == 1)

    def delvar(self, name: str) -> None:
        """Nothing is freed; but a number that is done with becomes 0, as with numba.

        By this LLVM finds out that where a flag was set the loop is left, and makes a way of its own of it: SARSA ran a
        sixth slower without.
        """
        if isinstance(self.typeof(name), types.Number | types.Boolean):
            super().delvar(name)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Set a variable; what it was before need not be freed."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
            return
        self._alloca_var(name, self.typeof(name))
        self.builder.store(value, self.getvar(name))

    def lower_getitem(self, wanted: Any, expression: Any, array: Any, index: Any, signature: Any) -> Any:
        """Read an element."""
        place = self._place(array, index, signature)
        if place is None:
            return super().lower_getitem(wanted, expression, array, index, signature)
        kind = self.typeof(array.name).dtype
        return self.context.cast(self.builder, self.context.unpack_value(self.builder, kind, place), kind, wanted)

    def lower_setitem(self, array: Any, index: Any, value: Any, signature: Any) -> Any:
        """Write an element."""
        given, meant = self.typeof(value.name), signature.args[2]
        place = self._place(array, index, signature) if isinstance(meant, types.Number | types.Boolean) else None
        if place is None:
            return super().lower_setitem(array, index, value, signature)
        kind = self.typeof(array.name).dtype
        number = self.context.cast(self.builder, self.loadvar(value.name), given, meant)
        number = self.context.cast(self.builder, number, meant, kind)
        self.context.pack_value(self.builder, kind, number, place)
        return None

    def _place(self, array: Any, index: Any, signature: Any) -> Any:
        """Where an element of an array of numbers stands in memory; None for anything else, which is left to numba."""
        kind, meant = self.typeof(array.name), signature.args[1]
        kinds = meant.types if isinstance(meant, BaseTuple) else (meant,)
        plain = isinstance(kind, Array) and kind.aligned and isinstance(kind.dtype, types.Number | types.Boolean)
        if not plain or len(kinds) != kind.ndim or not all(isinstance(one, types.Integer) for one in kinds):
            return None
        if self.context.enable_boundscheck:
            return None
        parts, described = self.context.data_model_manager[kind], self.loadvar(array.name)
        data, shape, strides = (parts.get(self.builder, described, name) for name in ("data", "shape", "strides"))
        sizes, steps = tools.unpack_tuple(self.builder, shape), tools.unpack_tuple(self.builder, strides)
        given = self.context.cast(self.builder, self.loadvar(index.name), self.typeof(index.name), meant)
        numbers = tools.unpack_tuple(self.builder, given) if isinstance(meant, BaseTuple) else [given]
        at = [self._from_start(*one) for one in zip(numbers, kinds, sizes, strict=True)]
        return tools.get_item_pointer2(self.context, self.builder, data, sizes, steps, kind.layout, at)

    def _from_start(self, number: Any, kind: Any, size: Any) -> Any:
        """An index counted from the start of its axis: a negative one counts from the end."""
        if not kind.signed:
            return self.context.cast(self.builder, number, kind, types.uintp)
        number = self.context.cast(self.builder, number, kind, types.intp)
        from_end = self.builder.icmp_signed("<", number, number.type(0))
        return self.builder.select(from_end, self.builder.add(number, size), number)


@register_pass(mutates_CFG=True, analysis_only=False)
class LoopLowering(NativeLowering):  # type: ignore[misc]
    """The pass that writes it down."""

    _name = "loop_lowering"

    @property
    def lowering_class(self) -> type[LoopLower]:
        """What numba is to write it down with."""
        return LoopLower
