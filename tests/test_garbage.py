"""When garbage is looked for, and how threads of linear algebra wait."""

import gc
import subprocess
import sys
import weakref

import pytest

import qualrl
from qualrl.garbage import left_alone
from tests import tracing
from tests.worlds import PUZZLE, grid_of


class Garbage:
    """Refers to itself."""

    def __init__(self):
        self.me = self


def cycle():
    return weakref.ref(Garbage())


@pytest.fixture
def often():
    """As often as Python does by itself."""
    before = gc.get_threshold()
    gc.set_threshold(700, 10, 10)
    yield
    gc.set_threshold(*before)


@pytest.mark.parametrize("kept", [False, True])
def test_garbage_is_left_alone_within_the_block_only(kept, often):
    with left_alone(kept=kept):
        assert not gc.isenabled()
        inside = cycle()
        _ = [[] for _ in range(10_000)]
        assert inside() is not None
    assert gc.isenabled()
    gc.collect()
    assert inside() is None


def test_it_is_looked_for_again_after_an_error_and_stays_off_where_it_was_off():
    with pytest.raises(ValueError, match="inside"), left_alone():
        raise ValueError("inside")
    assert gc.isenabled()
    gc.disable()
    try:
        with left_alone(), left_alone(kept=True):
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_what_is_frozen_stays_so():
    gc.freeze()
    try:
        with left_alone(kept=True):
            pass
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()


def test_garbage_of_a_script_that_cuts_many_maps_does_not_pile_up(often):
    """It once counted as old after each map, and was never looked through."""
    grid = grid_of(PUZZLE)
    qualrl.build(qualrl.segment(grid), [6, 6])  # compiled from here on
    gc.collect()
    left = []
    for _ in range(120):
        qualrl.build(qualrl.segment(grid), [6, 6])
        left.append(cycle())
    assert sum(one() is not None for one in left) < 60


def test_threads_of_linear_algebra_do_not_wait_busily_unless_they_are_told_to():
    asked = "import os, qualrl; print(os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    for given, used in (({}, "20"), ({"OPENBLAS_THREAD_TIMEOUT": "26"}, "26")):
        environment = {k: v for k, v in tracing.environment_without().items() if k != "OPENBLAS_THREAD_TIMEOUT"}
        done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, env=environment | given)
        assert done.stdout.split() == [used]
