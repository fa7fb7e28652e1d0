"""Many runs at once, over threads: the compiled loops release the interpreter's lock.

A run depends on its own seed and settings only, so neither the number of threads nor the order changes any result.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from threading import Event, Lock, Thread
from typing import TypeVar

from qualrl.errors import SettingError
from qualrl.kernels.bands import processors
from qualrl.learning.trainer import Milestone

TELL_S = 0.05
"""So often it is told how many runs are done."""
FIRST_LOOK_S = 0.002
"""After so long it is seen whether runs are worth more than one thread, and from then on whenever it is told."""
WORTH_S = 0.0005
"""Runs of less CPU time are mostly Python, at which threads take turns: a second one would only be in the way."""

Item = TypeVar("Item")
Result = TypeVar("Result")
Watch = Callable[[Milestone], None]


def over_threads(
    one: Callable[[Item, Watch], Result],
    items: Sequence[Item],
    threads: int | None = None,
    told: Callable[[int], None] | None = None,
) -> list[Result]:
    """What a function makes of each item, in their order.

    one: gives its second argument to ``trainer.train`` as ``watch``, so that a run stops when another has failed or
    Ctrl-C is pressed.  threads: the most, by default one for each processor that we may use; very short runs are made
    by one.  told: called with 1, 2, ... as so
    many runs are done.  Raises SettingError for threads below 1, and what a run raises.
    """
    if threads is not None and threads < 1:
        raise SettingError(f"threads must be at least 1, got {threads}")
    stop, over, turn = Event(), Event(), Lock()
    numbers = iter(range(len(items)))
    results: dict[int, Result] = {}
    failures: list[BaseException] = []

    def watch(_: Milestone) -> None:
        if stop.is_set():
            raise CancelledError

    def work() -> None:
        try:
            while not stop.is_set():
                with turn:
                    number = next(numbers, None)
                if number is None:
                    return
                results[number] = one(items[number], watch)
                if len(results) == len(items):
                    over.set()
        except BaseException as problem:
            failures.append(problem)
            stop.set()
            over.set()

    pool: list[Thread] = []

    def employ(count: int) -> None:
        while len(pool) < min(count, len(items)):
            pool.append(Thread(target=work))
            pool[-1].start()

    try:
        employ(1)
        done, patience = 0, FIRST_LOOK_S
        while done < len(items):
            begun = time.process_time()
            over.wait(patience)
            if failures:
                raise failures[0]
            before, done, patience = done, len(results), TELL_S
            if (done - before) * WORTH_S < time.process_time() - begun:
                employ(threads or processors())
            if told is not None:
                for number in range(before, done):
                    told(number + 1)
    except BaseException:
        stop.set()
        raise
    finally:
        for thread in pool:
            if thread.ident is not None:
                thread.join()
    return [results[number] for number in range(len(items))]
