"""One way to look at a map, however it is turned by quarters or mirrored: so its regions are turned with it."""

from itertools import product
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bands import in_bands
from qualrl.kernels.scratch import borrowed

Flags = NDArray[np.bool_]
Number = TypeVar("Number", bound=np.generic)


class Posture(NamedTuple):
    """How a map is shown: first with rows as columns, then upside down, then mirrored, each if so."""

    transposed: bool
    upside_down: bool
    mirrored: bool

    def of(self, array: NDArray[Number]) -> NDArray[Number]:
        """An array (rows, columns) of the grid as it is shown."""
        shown = borrowed(array.shape[::-1] if self.transposed else array.shape, array.dtype.type)
        return _turned(array, shown, self.transposed, self.upside_down, self.mirrored)

    def back(self, shown: NDArray[Number], into: NDArray[Number] | None = None) -> NDArray[Number]:
        """An array of the grid from what is shown, written into one of its shape if given."""
        if into is None:
            into = np.empty(shown.shape[::-1] if self.transposed else shown.shape, shown.dtype)
        if self.transposed:
            return _turned(shown, into, True, self.mirrored, self.upside_down)
        return _turned(shown, into, False, self.upside_down, self.mirrored)


def _turned(
    array: NDArray[Number], into: NDArray[Number], transposed: bool, upside_down: bool, mirrored: bool
) -> NDArray[Number]:
    """``into``, with the array written to it: rows as columns, then upside down, then mirrored, each if so.

    OpenCV keeps to a part that fits the processor's cache, numpy does not.
    """
    kind = np.uint8 if array.dtype == np.bool_ else array.dtype  # OpenCV knows no flags
    source, target = array.view(kind), into.view(kind)
    axis = -1 if upside_down and mirrored else int(mirrored)

    def turn(top: int, bottom: int) -> None:
        first, end = (len(into) - bottom, len(into) - top) if upside_down else (top, bottom)
        part, to = source[:, first:end] if transposed else source[first:end], target[top:bottom]
        if transposed:
            cv2.transpose(part, to)
            part = to
        if upside_down or mirrored:
            cv2.flip(part, axis, to)
        elif not transposed:
            to[:] = part

    in_bands(turn, into.shape, is_light=True)
    return into


def posture(free: Flags) -> Posture:
    """How to show free cells (rows, columns): wider than high, the heavier half on the left and above.

    Of postures that do so alike that with the least bytes, so that what is shown is the same for all of a map's turns.
    """
    rows, columns = (_Lean.of(free.sum(axis=axis).tolist()) for axis in (1, 0))

    def balance(shown: Posture) -> tuple[int, ...]:
        down, right = (columns, rows) if shown.transposed else (rows, columns)
        at, to = 1 if shown.upside_down else -1, 1 if shown.mirrored else -1
        return right.length, right.spread, to * right.first, to * right.third, at * down.first, at * down.third

    postures = [Posture(*shown) for shown in product((False, True), repeat=3)]
    most = max(map(balance, postures))
    best = [shown for shown in postures if balance(shown) == most]
    return best[0] if len(best) == 1 else min(best, key=lambda shown: shown.of(free).tobytes())


class _Lean(NamedTuple):
    """Moments of free cells about the middle, exact: alike in size when mirrored."""

    length: int
    """Rows (or columns)."""
    spread: int
    first: int
    third: int

    @classmethod
    def of(cls, cells: list[int]) -> "_Lean":
        """Of the free cells by row (or column)."""
        off = range(1 - len(cells), len(cells), 2)
        spread, first, third = (
            sum(count * at**power for at, count in zip(off, cells, strict=True)) for power in (2, 1, 3)
        )
        return cls(len(cells), spread, first, third)
