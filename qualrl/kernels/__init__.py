"""Compiled loops: arrays in, arrays out; no names, units, graphs, files or prints.

numba is started here, once, and without what it would load only to see whether it is there: SciPy, whose version it
looks at, and coverage, which it would tell of compiled lines if it were asked to by NUMBA_JIT_COVERAGE.  Garbage
is not looked for then: all that is made is kept.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from qualrl.garbage import left_alone

LOOKED_FOR = ("scipy",) if "NUMBA_JIT_COVERAGE" in os.environ else ("scipy", "coverage")


@contextmanager
def _out_of_sight(names: tuple[str, ...]) -> Iterator[None]:
    """Modules that are not loaded yet cannot be, as long as the block runs."""
    modules: dict[str, Any] = sys.modules
    hidden = [name for name in names if name not in modules]
    modules.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        for name in hidden:
            del modules[name]


with _out_of_sight(LOOKED_FOR), left_alone(kept=True):
    import numba  # noqa: F401
