"""Loops as this project compiles them do what their source says, whatever arrays and numbers they are given."""

import math
from typing import Any, NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from qualrl.kernels.jit import LEAN, UNCOUNTED

DTYPES = (np.bool_, np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64, np.float32, np.float64)
INDICES = (int, np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64)
bare = njit(**LEAN, **UNCOUNTED)  # not kept on disk, where an edit of how loops are compiled would go unnoticed


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
