"""Many runs at once, over threads: the compiled loops release the interpreter's lock.

A run depends on its own seed and settings only, so neither the number of threads nor the order changes any result.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from threading import Event
from typing import TypeVar

from qualrl.errors import SettingError
from qualrl.kernels.bands import processors
from qualrl.learning.trainer import Milestone

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
    Ctrl-C is pressed.  threads: by default one for each processor that we may use.  told: called with the number of
    runs that are done.  Raises SettingError for threads below 1, and what a run raises.
    """
    if threads is not None and threads < 1:
        raise SettingError(f"threads must be at least 1, got {threads}")
    stop = Event()

    def watch(_: Milestone) -> None:
        if stop.is_set():
            raise CancelledError

    with ThreadPoolExecutor(threads or processors()) as pool:
        jobs = [pool.submit(one, item, watch) for item in items]
        try:
            for done, job in enumerate(as_completed(jobs), 1):
                job.result()
                if told is not None:
                    told(done)
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [job.result() for job in jobs]
