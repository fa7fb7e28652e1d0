"""Ctrl-C while a loop is compiled: it waits for the end of a pass.

In a callback from LLVM, or while an object is freed, Python would print it and go on, with a loop that is half made.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

ENDING = (signal.SIGINT, signal.SIGTERM)
_handlers: dict[int, Callable[[int, Any], Any]] = {}
_come: list[int] = []


@contextmanager
def held_back() -> Iterator[None]:
    """Signals that end a process come through at ``let_through`` and at the end of the block only.

    Only the main thread is sent them; blocks within blocks, and those of other threads, change nothing.
    """
    if _handlers or threading.current_thread() is not threading.main_thread():
        yield
        return
    for ending in ENDING:
        handler = signal.getsignal(ending)
        if callable(handler):
            _handlers[ending] = handler
            signal.signal(ending, lambda number, frame: _come.append(number))
    try:
        yield
        let_through()
    finally:
        for number, handler in _handlers.items():
            signal.signal(number, handler)
        _handlers.clear()
        _come.clear()


def let_through() -> None:
    """Hand on what has come since; in another thread than the main one nothing ever has."""
    while _come and threading.current_thread() is threading.main_thread():
        number = _come.pop(0)
        _handlers[number](number, None)
