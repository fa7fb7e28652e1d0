"""Where Python need not look for garbage.

It looks through all that it holds whenever that has grown by a quarter, though hardly anything is garbage of what a
compiler or a map of thousands of regions makes; that took a tenth of the time.  And it does so three times when a
process ends, and then takes all of it apart: a fifth of a second of CPU time with numba loaded, twice that after numba
compiled something.
"""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import GeneratorType

TOOLS = "llvmlite", "numba"
"""What they hold of the machine goes with the process."""


@contextmanager
def left_alone() -> Iterator[None]:
    """Garbage is not looked for as long as the block runs.

    What it made counts as old afterwards, so that not all of it is looked through at once when the block is left.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            if gc.get_freeze_count() == 0:
                gc.freeze()
                gc.unfreeze()
            gc.enable()


def leave_the_rest() -> None:
    """Let what is left go with the process, unless something of it is to be told of its end: it has ``__del__``.

    A file that is still open is such a thing: Python writes then what it was given last.
    """
    with suppress(Exception):  # the classes are anyone's, and a process that ends has nobody to tell
        held = gc.get_objects()
        told = {kind for kind in set(map(type, held)) if _is_told(kind)}
        streams = {id(layer) for layer in _standard_streams()}
        if all(_never_began(thing) or id(thing) in streams for thing in held if type(thing) in told):
            gc.freeze()


def _is_told(kind: type) -> bool:
    return hasattr(kind, "__del__") and kind.__module__.partition(".")[0] not in TOOLS


def _never_began(thing: object) -> bool:
    """A generator has nothing to end before its first line ran, as one that was made to decorate a function."""
    return isinstance(thing, GeneratorType) and not (thing.gi_suspended or thing.gi_running)


def _standard_streams() -> list[object]:
    """They are written out in any case."""
    streams = [stream for stream in (sys.__stdin__, sys.__stdout__, sys.__stderr__) if stream is not None]
    return [layer for stream in streams for layer in (stream, stream.buffer, getattr(stream.buffer, "raw", None))]
