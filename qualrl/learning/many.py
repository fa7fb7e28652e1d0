"""Many runs at once, over threads: the compiled loops release the interpreter's lock.

A run depends on its own seed and settings only, so neither the number of threads nor the order changes any result.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from threading import Event, Lock, Thread
from typing import TypeVar

from qualrl.errors import SettingError
from qualrl.kernels.bands import processors
from qualrl.learning.trainer import Milestone

TELL_S = 0.05
"""So often it is told how many runs are done."""

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
    Ctrl-C is pressed.  threads: by default one for each processor that we may use.  told: called with 1, 2, ... as so
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

    pool = [Thread(target=work) for _ in range(min(threads or processors(), len(items)))]
    try:
        for thread in pool:
            thread.start()
        done = 0
        while done < len(items):
            over.wait(TELL_S)
            if failures:
                raise failures[0]
            before, done = done, len(results)
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
