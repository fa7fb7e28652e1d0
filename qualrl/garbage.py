"""Where Python need not look for garbage.

It looks through all that it holds whenever that has grown by a quarter, though hardly anything is garbage of what a
compiler or a map of thousands of regions makes.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def left_alone(*, kept: bool = False) -> Iterator[None]:
    """Garbage is not looked for as long as the block runs; where blocks of threads overlap, until the first ends.

    kept: what it made counts as old afterwards, so that not all of it is looked through once more when the block is
    left.  Not for what is done again and again: what others made meanwhile counts as old, too, garbage included.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            if kept and gc.get_freeze_count() == 0:
                gc.freeze()
                gc.unfreeze()
            gc.enable()
