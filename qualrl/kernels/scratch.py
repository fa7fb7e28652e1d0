"""Memory for whole maps that is used again.

The operating system clears each page that it hands out, which takes longer than many a loop: what one array gives back
the next one takes.
"""

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


class _Kept:
    """Memory that nobody uses, kept as long as someone may want it."""

    def __init__(self) -> None:
        self.lock = RLock()  # an array may end, and give its memory back, while the same thread takes some
        self.users = 0
        self.free: list[NDArray[np.uint8]] = []


_KEPT = _Kept()
ROOMY = 2
"""Memory is used for an array that takes at least one part in so many of it."""
SPARE = 64
"""New memory is larger by one part in so many: the next array may have a margin of cells around it."""


@contextmanager
def kept_for_reuse() -> Iterator[None]:
    """Memory is kept until the block ends, of threads that overlap the last one."""
    with _KEPT.lock:
        _KEPT.users += 1
    try:
        yield
    finally:
        with _KEPT.lock:
            _KEPT.users -= 1
            if not _KEPT.users:
                _KEPT.free.clear()


def borrowed(shape: int | tuple[int, ...], kind: type[Number]) -> NDArray[Number]:
    """An array that holds whatever its memory held; it gives that back when it and all its views are gone."""
    count = int(np.prod(shape))
    block = _taken(count * np.dtype(kind).itemsize)
    # Views of it have it for their base, and not the block, since that is lent as a buffer and no array.
    array: NDArray[Any] = np.frombuffer(block.data, kind, count)
    weakref.finalize(array, _give_back, block).atexit = False
    return array.reshape(shape)


def _taken(size: int) -> NDArray[np.uint8]:
    """(size or more,) the smallest memory that is kept, or else new."""
    with _KEPT.lock:
        fitting = [at for at, block in enumerate(_KEPT.free) if size <= block.size <= ROOMY * size]
        if fitting:
            return _KEPT.free.pop(min(fitting, key=lambda at: _KEPT.free[at].size))
    return np.empty(size + size // SPARE, np.uint8)


def _give_back(block: NDArray[np.uint8]) -> None:
    with _KEPT.lock:
        if _KEPT.users:
            _KEPT.free.append(block)
