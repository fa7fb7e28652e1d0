"""Memory that loops over whole maps need for a while.

The operating system clears each page that it hands out, which takes longer than many a loop: what one loop gives back
the next one takes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import numpy as np
from numpy.typing import NDArray


class _Kept:
    """Memory that nobody uses, kept as long as someone may want it."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.users = 0
        self.free: list[NDArray[np.int32]] = []


_KEPT = _Kept()


@contextmanager
def kept_for_reuse() -> Iterator[None]:
    """Scratch memory is kept until the block ends, of threads that overlap the last one."""
    with _KEPT.lock:
        _KEPT.users += 1
    try:
        yield
    finally:
        with _KEPT.lock:
            _KEPT.users -= 1
            if not _KEPT.users:
                _KEPT.free.clear()


@contextmanager
def scratch(size: int) -> Iterator[NDArray[np.int32]]:
    """(size,) whole numbers, whatever they are, until the block ends."""
    with _KEPT.lock:
        block = _KEPT.free.pop() if _KEPT.free else np.empty(0, np.int32)
    if block.size < size:
        block = np.empty(size, np.int32)
    try:
        yield block[:size]
    finally:
        with _KEPT.lock:
            if _KEPT.users:
                _KEPT.free.append(block)
