"""The way over a grid with the least on it that stands in the way.

H, W: rows, columns.  A step weighs 0, 1 (an obstacle) or NEVER (none may be made).  ``weight`` (H, W) uint8 is that of
every step onto a cell.  ``hard`` (H, W) uint8 is 1 for a cell that is worse than others of its weight, else 0.
``closed`` (H, W) uint8 has bit RIGHT or DOWN where a closed door is between a cell and the one to its right or below;
``closing`` is what a step through one weighs at least.
Steps are 4-connected: a diagonal one needs both cells beside it, so it saves no obstacle.
"""

from typing import Any

import numpy as np

from qualrl.kernels.jit import compiled, compiled_part

NEVER = 2
RIGHT, DOWN = 1, 2


@compiled_part
def _step(weight: Any, closed: Any, closing: int, here: int, side: int) -> Any:
    """(flat index of the cell on a side of one, what the step there weighs); NEVER beyond the edge."""
    height, width = weight.shape
    row, column = here // width, here % width
    r, c = row + (side == 1) - (side == 0), column + (side == 3) - (side == 2)
    if r < 0 or c < 0 or r >= height or c >= width:
        return here, NEVER
    is_closed = closed[min(row, r), min(column, c)] & (RIGHT if r == row else DOWN)
    return r * width + c, max(np.int64(weight[r, c]), closing if is_closed else 0)


@compiled
def least_way(weight: Any, hard: Any, closed: Any, closing: int, source: int, target: int) -> Any:
    """(N, 2) int32 rows and columns of a way that weighs least; or (0, 2).

    Of those it is one with the fewest hard cells, and of those one with the fewest steps.
    source, target: flat indices of two cells.
    """
    nothing = np.empty(0, np.int32)
    level = _levels(weight, hard, closed, closing, source, nothing)
    if level[target] < 0:
        return np.empty((0, 2), np.int32)
    worse = _levels(weight, hard, closed, closing, source, level)
    steps = _steps(weight, hard, closed, closing, source, level, worse)
    width = weight.shape[1]
    cells = np.empty((steps[target] + 1, 2), np.int32)
    here = target
    for at in range(steps[target], -1, -1):
        cells[at, 0], cells[at, 1] = here // width, here % width
        for side in range(4):
            # Steps weigh by where they lead, so that of the way back is looked up from the other end.
            other, _ = _step(weight, closed, closing, here, side)
            back, cost = _step(weight, closed, closing, other, side ^ 1)
            is_best = level[other] + cost == level[here] and worse[other] + hard.ravel()[here] == worse[here]
            if back == here and cost < NEVER and steps[other] == at - 1 and is_best:
                here = other
                break
    return cells


@compiled
def _levels(weight: Any, hard: Any, closed: Any, closing: int, source: int, least: Any) -> Any:
    """(H * W,) how much the lightest way to each cell weighs, -1 where none leads: one weight after the other.

    least: empty, or these weights; then, of the ways that weigh so little, how many hard cells the best has.
    """
    level = np.full(weight.size, -1, np.int32)
    now, later = np.empty(weight.size, np.int32), np.empty(weight.size, np.int32)
    level[source], now[0] = 0, source
    depth, end = 0, 1
    while end > 0:
        head, waiting = 0, 0
        while head < end:
            here = now[head]
            head += 1
            for side in range(4):
                other, cost = _step(weight, closed, closing, here, side)
                if cost < NEVER and least.size:
                    cost = np.int64(hard.ravel()[other]) if least[other] == least[here] + cost else NEVER
                if cost < NEVER and (level[other] < 0 or level[other] > depth + cost):
                    level[other] = depth + cost
                    if cost == 0:
                        now[end] = other
                        end += 1
                    else:
                        later[waiting] = other
                        waiting += 1
        depth, end = depth + 1, 0
        for at in range(waiting):
            if level[later[at]] == depth:  # else a lighter way was found after all
                now[end] = later[at]
                end += 1
    return level


@compiled
def _steps(weight: Any, hard: Any, closed: Any, closing: int, source: int, level: Any, worse: Any) -> Any:
    """(H * W,) the fewest steps to each cell on ways that are best by both, -1 where none leads."""
    steps = np.full(weight.size, -1, np.int32)
    queue = np.empty(weight.size, np.int32)
    steps[source], queue[0] = 0, source
    head, end = 0, 1
    while head < end:
        here = queue[head]
        head += 1
        for side in range(4):
            other, cost = _step(weight, closed, closing, here, side)
            is_best = level[other] == level[here] + cost and worse[other] == worse[here] + hard.ravel()[other]
            if cost < NEVER and steps[other] < 0 and is_best:
                steps[other], queue[end] = steps[here] + 1, other
                end += 1
    return steps
