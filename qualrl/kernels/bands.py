"""Whole-map loops in bands of rows, a thread each: the compiled loops release the interpreter's lock.

Each band writes to rows or results of its own, so neither their number nor their order changes anything.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import TypeVar

LEAST_CELLS = 2**18
"""A band of fewer cells is not worth a thread."""
LIGHT = 4
"""... nor is one of fewer than so many times as many, of a loop that hardly does more with a cell than read it."""

Result = TypeVar("Result")
Other = TypeVar("Other")


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_bands(work: Callable[[int, int], Result], shape: tuple[int, ...], *, is_light: bool = False) -> list[Result]:
    """What ``work(top, bottom)`` makes of each band of rows of an array of that shape (H, W), from above.

    is_light: the work does little with each cell.
    """
    height, width = shape
    least = LEAST_CELLS * (LIGHT if is_light else 1)
    count = max(min(processors(), height * width // least, height), 1)
    cuts = [height * band // count for band in range(count + 1)]
    if count == 1:
        return [work(0, height)]
    # Each thread keeps some of the memory that it gave back, so this one does its share.
    with _helpers(count - 1) as pool:
        others = pool.map(work, cuts[1:-1], cuts[2:])
        return [work(0, cuts[1]), *others]


def both(first: Callable[[], Result], second: Callable[[], Other]) -> tuple[Result, Other]:
    """What two tasks that do not depend on each other make, at once where there are processors for both."""
    if processors() == 1:
        return first(), second()
    with _helpers(1) as pool:
        waiting = pool.submit(second)
        return first(), waiting.result()


@contextmanager
def _helpers(count: int) -> Iterator[Executor]:
    """So many threads more: one that is asked for again and again lasts, for to start it takes as long as short loops.

    Within what it does, and in other threads meanwhile, helpers are new.
    """
    if count == 1 and _LASTING.free.acquire(blocking=False):
        try:
            yield _LASTING.pool
        finally:
            _LASTING.pool.submit(int).result()  # one task after the other: all that it was asked for is done
            _LASTING.free.release()
    else:
        with ThreadPoolExecutor(count) as pool:
            yield pool


class _Lasting:
    """The helper that lasts, and the right to ask it."""

    def __init__(self) -> None:
        self.renew()

    def renew(self) -> None:
        """Ask a new one from now on."""
        self.pool, self.free = ThreadPoolExecutor(1), Lock()


_LASTING = _Lasting()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_LASTING.renew)  # no thread goes along into a child process
