"""Loops over the cells of a grid: where moves lead, and how far places are.

H, W: rows, columns.  S free cells, A directions.  ``state_of`` is (H, W), -1 where not free.
"""

from typing import Any

import numpy as np

from qualrl.kernels.bands import in_bands
from qualrl.kernels.jit import compiled_bare


def cells_and_states(free: Any) -> Any:
    """(S, 2) int32 row and column of each free cell of an image (H, W), row by row; and (H, W) int32 the number of each
    cell's state, -1 where not free.
    """
    until = np.cumsum([0, *np.count_nonzero(free, axis=1)])
    cells, state_of = np.empty((until[-1], 2), np.int32), np.empty(free.shape, np.int32)
    in_bands(lambda top, bottom: _write_states(free, top, bottom, until[top], cells, state_of), free.shape)
    return cells, state_of


@compiled_bare
def _write_states(free: Any, top: Any, bottom: Any, state: Any, cells: Any, state_of: Any) -> None:
    """In the rows from top to bottom, from the number of the first free cell's state there on."""
    for row in range(top, bottom):
        for column in range(free.shape[1]):
            if free[row, column]:
                cells[state, 0], cells[state, 1] = row, column
                state_of[row, column] = state
                state += 1
            else:
                state_of[row, column] = -1


def successors(state_of: Any, cells: Any, offsets: Any) -> Any:
    """(S, A) uint32: where each move leads; a move into a wall, or past a corner, leads back.

    offsets (A, 2): row and column of each move.  A diagonal move needs both cells beside it free.
    """
    height, width = state_of.shape
    framed = np.full((height + 2, width + 2), -1, np.int32)
    framed[1:-1, 1:-1] = state_of
    free = state_of >= 0
    result = np.empty((len(cells), len(offsets)), np.uint32)
    state = np.arange(len(cells), dtype=np.int32)

    def beside(down: int, right: int) -> Any:
        """(S,) the state so far off, or -1."""
        return framed[1 + down : 1 + down + height, 1 + right : 1 + right + width][free]

    for a, (down, right) in enumerate(offsets.tolist()):
        target = beside(down, right)
        stays = target < 0
        if down and right:
            stays |= (beside(down, 0) < 0) | (beside(0, right) < 0)
        np.copyto(target, state, where=stays)
        result[:, a] = target
    return result


def breadth_first(successor: Any, sources: Any) -> Any:
    """(order, steps): states by distance from the sources, and the number of moves to each, -1 if none leads there.

    On a grid every move can be taken back, so distances from a source are distances to it.
    """
    steps = np.full(successor.shape[0], -1, np.int32)
    order = np.empty(successor.shape[0], np.int64)
    end = _write_order(successor, sources, order, steps)
    return order[:end], steps


@compiled_bare
def _write_order(successor: Any, sources: Any, order: Any, steps: Any) -> Any:
    """How many states are reached; ``steps`` is -1 everywhere before."""
    end = 0
    for i in range(sources.size):
        s = sources[i]
        if steps[s] < 0:
            steps[s] = 0
            order[end] = s
            end += 1
    head = 0
    while head < end:
        s = order[head]
        head += 1
        for a in range(successor.shape[1]):
            t = successor[s, a]
            if steps[t] < 0:
                steps[t] = steps[s] + 1
                order[end] = t
                end += 1
    return end
