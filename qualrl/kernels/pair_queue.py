"""A priority queue of pairs of places, as a binary heap."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_part


class Queue(NamedTuple):
    """The largest key comes first; of equal ones what was put in first."""

    key: NDArray[np.float64]
    item: NDArray[np.int64]
    """(capacity, 5) order of arrival, the two places, and their stamps."""
    size: NDArray[np.int64]
    """(2,) how many are in it, and how many were ever put in."""


def new_queue(capacity: int) -> Queue:
    """An empty queue with room for so many pairs."""
    return Queue(np.empty(capacity), np.empty((capacity, 5), np.int64), np.zeros(2, np.int64))


def grown(queue: Queue, room: int) -> Queue:
    """The queue, with room for so many more."""
    count = int(queue.size[0])
    larger = new_queue(2 * (count + room))
    larger.key[:count] = queue.key[:count]
    larger.item[:count] = queue.item[:count]
    larger.size[:] = queue.size
    return larger


@compiled_part
def _comes_before(queue: Queue, one: int, other: int) -> bool:
    if queue.key[one] != queue.key[other]:
        return bool(queue.key[one] > queue.key[other])
    return bool(queue.item[one, 0] < queue.item[other, 0])


@compiled_part
def _swap(queue: Queue, one: int, other: int) -> None:
    queue.key[one], queue.key[other] = queue.key[other], queue.key[one]
    for column in range(queue.item.shape[1]):
        queue.item[one, column], queue.item[other, column] = queue.item[other, column], queue.item[one, column]


@compiled_part
def push(queue: Queue, key: float, host: int, guest: int, host_stamp: int, guest_stamp: int) -> None:
    """Put in a pair."""
    at = queue.size[0]
    queue.key[at] = key
    queue.item[at, 0], queue.item[at, 1], queue.item[at, 2] = queue.size[1], host, guest
    queue.item[at, 3], queue.item[at, 4] = host_stamp, guest_stamp
    queue.size[0] += 1
    queue.size[1] += 1
    while at > 0 and _comes_before(queue, at, (at - 1) // 2):
        _swap(queue, at, (at - 1) // 2)
        at = (at - 1) // 2


@compiled_part
def pop(queue: Queue) -> None:
    """Take out the first."""
    queue.size[0] -= 1
    size = queue.size[0]
    _swap(queue, 0, size)
    at = 0
    while True:
        best = at
        for child in range(2 * at + 1, min(2 * at + 3, size)):
            if _comes_before(queue, child, best):
                best = child
        if best == at:
            return
        _swap(queue, at, best)
        at = best
