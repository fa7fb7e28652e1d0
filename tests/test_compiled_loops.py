"""Loops as this project compiles them do what their source says, whatever arrays and numbers they are given."""

import math
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from qualrl.kernels.jit import LEAN, UNCOUNTED
from tests import tracing

DTYPES = (np.bool_, np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64, np.float32, np.float64)
INDICES = (int, np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64)
bare = njit(**LEAN, **UNCOUNTED)


class Pair(NamedTuple):
    read: Any
    written: Any


@bare
def copy_one(source: Any, at: Any, target: Any, to: Any) -> None:
    target[to] = source[at]


@bare
def copy_ends(source: Any, target: Any) -> None:
    target[0] = source[-1]
    target[-1] = 7


@bare
def of_row(source: Any, at: Any) -> Any:
    row = source[at]
    return row[0], row[-1], row.size


@bare
def wander(pair: Any, n: Any, by_two: Any) -> Any:
    read, kept, left = pair.read, n, n
    total, over = 0, False
    while not over and left > 0:
        if by_two:
            left -= 1
        left -= 1
        for i in range(read.size):
            if pair.read[i] == left:
                total += kept
                pair.written[i] += total
            elif total > 40:
                return total, left
        over = total > 30
    return total, -kept if over else left


@bare
def count_up(n: Any) -> Any:
    ahead = n * 3
    for i in range(n):
        yield ahead + i


OUTSIDE = """
import numpy as np
from numba import njit
from qualrl.kernels.jit import LEAN, UNCOUNTED

read = njit(**LEAN, **UNCOUNTED)(lambda numbers, at: numbers[at])
try:
    read(np.arange(3), 5)
except IndexError as problem:
    print(problem)
"""
INTERRUPTED = """
import signal
from numba import njit
from qualrl.kernels import numba_lean
from qualrl.kernels.jit import LEAN, UNCOUNTED

signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.default_int_handler)

@njit(**LEAN, **UNCOUNTED)
def half(n):
    return n // 2

@njit(**LEAN, **UNCOUNTED)
def loop(n):
    return half(n) + 1

take_in = numba_lean.LoopLibrary.add_ir_module

def interrupted(library, module):
    signal.raise_signal(signal.{name})
    take_in(library, module)
    print(library.name)

numba_lean.LoopLibrary.add_ir_module = interrupted
try:
    loop(5)
except KeyboardInterrupt:
    print("stopped")
numba_lean.LoopLibrary.add_ir_module = take_in
print(signal.getsignal(signal.{name}) is signal.default_int_handler, loop(5))
"""


@st.composite
def arrays(draw, dimensions):
    """An array of small numbers, in rows or columns, or a part of a larger one, forwards or backwards."""
    shape = draw(st.tuples(*(st.integers(1, 4) for _ in range(dimensions))))
    whole = tuple(2 * side + 1 for side in shape)
    size = math.prod(whole)
    values = np.array(draw(st.lists(st.integers(0, 9), min_size=size, max_size=size)))
    array = values.reshape(whole).astype(draw(st.sampled_from(DTYPES)))
    step = draw(st.sampled_from((1, 2, -1)))
    part = array[tuple(slice(None, None, step) if step < 0 else slice(0, step * side, step) for side in shape)]
    return draw(st.sampled_from((np.ascontiguousarray, np.asfortranarray, lambda found: found)))(part)


@st.composite
def place(draw, array):
    """Where an element is: one index an axis, from the start or, if it is signed, from the end."""
    found = []
    for side in array.shape:
        kind = draw(st.sampled_from(INDICES))
        signed = kind is int or np.issubdtype(kind, np.signedinteger)
        found.append(kind(draw(st.integers(-side if signed else 0, side - 1))))
    return found[0] if len(found) == 1 else tuple(found)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 3), st.integers(1, 2), st.data())
def test_an_element_is_read_and_written_where_numpy_does(of_source, of_target, data):
    source, target = data.draw(arrays(of_source)), data.draw(arrays(of_target))
    at, to = data.draw(place(source)), data.draw(place(target))
    expected = target.copy()
    expected[to] = source[at]
    copy_one(source, at, target, to)
    np.testing.assert_array_equal(target, expected)


@settings(max_examples=20, deadline=None)
@given(arrays(2), st.data())
def test_a_row_is_no_element(source, data):
    at = data.draw(st.integers(-len(source), len(source) - 1))
    assert of_row(source, at) == of_row.py_func(source, at)


@settings(max_examples=20, deadline=None)
@given(arrays(1), arrays(1))
def test_a_fixed_place_and_a_fixed_number_are_too(source, target):
    expected = target.copy()
    copy_ends.py_func(source, expected)
    copy_ends(source, target)
    np.testing.assert_array_equal(target, expected)


@settings(deadline=None)
@given(st.lists(st.integers(0, 9), min_size=1, max_size=9), st.integers(-2, 12), st.booleans())
def test_what_is_set_once_lasts_and_what_is_set_again_changes(numbers, n, by_two):
    ours, expected = (Pair(np.array(numbers), np.zeros(len(numbers), np.int64)) for _ in range(2))
    assert wander(ours, n, by_two) == wander.py_func(expected, n, by_two)
    np.testing.assert_array_equal(ours.written, expected.written)


def test_a_generator_is_compiled_as_numba_does():
    assert list(count_up(3)) == [9, 10, 11]


@pytest.mark.skipif(not LEAN, reason="this numba compiles in its own way")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_what_ends_a_process_waits_for_the_end_of_a_pass_and_leaves_nothing_half_made(name):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED.replace("{name}", name)], capture_output=True, text=True, check=True,
        env=tracing.environment_without(),
    )  # fmt: skip
    *parts, stopped, after = done.stdout.splitlines()
    assert "half" in parts
    assert "loop" not in parts
    assert (stopped, after) == ("stopped", "True 3")


def test_elements_outside_are_told_when_numba_is_asked_to_look(tmp_path):
    (tmp_path / "outside.py").write_text(OUTSIDE)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "outside.py")], capture_output=True, text=True, check=True,
        env=tracing.environment_without() | {"NUMBA_BOUNDSCHECK": "1"},
    )  # fmt: skip
    assert done.stdout == "index is out of bounds\n"
