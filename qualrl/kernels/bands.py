"""Whole-map loops in bands of rows, a thread each: the compiled loops release the interpreter's lock.

Each band writes to rows or results of its own, so neither their number nor their order changes anything.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

LEAST_CELLS = 2**18
"""A band of fewer cells is not worth a thread."""

Result = TypeVar("Result")
Other = TypeVar("Other")


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_bands(work: Callable[[int, int], Result], shape: tuple[int, ...]) -> list[Result]:
    """What ``work(top, bottom)`` makes of each band of rows of an array of that shape (H, W), from above."""
    height, width = shape
    count = max(min(processors(), height * width // LEAST_CELLS, height), 1)
    cuts = [height * band // count for band in range(count + 1)]
    if count == 1:
        return [work(0, height)]
    # Each thread keeps some of the memory that it gave back, so this one does its share.
    with ThreadPoolExecutor(count - 1) as pool:
        others = pool.map(work, cuts[1:-1], cuts[2:])
        return [work(0, cuts[1]), *others]


def both(first: Callable[[], Result], second: Callable[[], Other]) -> tuple[Result, Other]:
    """What two tasks that do not depend on each other make, at once where there are processors for both."""
    if processors() == 1:
        return first(), second()
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(second)
        return first(), waiting.result()
