"""Walks inside labelled regions."""

from typing import Any

import numpy as np

from qualrl.kernels.jit import compiled


@compiled
def steps_within(label: Any, centres: Any) -> Any:
    """(H, W) int32: steps from centres[k] to each cell of region k without leaving it, -1 elsewhere.

    label (H, W), -1 outside every region; centres (K, 2) rows and columns.
    """
    height, width = label.shape
    steps = np.full((height, width), -1, np.int32)
    queue = np.empty((height * width, 2), np.int32)
    end = 0
    for k in range(centres.shape[0]):
        steps[centres[k, 0], centres[k, 1]] = 0
        queue[end, 0], queue[end, 1] = centres[k, 0], centres[k, 1]
        end += 1
    head = 0
    while head < end:
        row, column = queue[head, 0], queue[head, 1]
        head += 1
        for move in range(4):
            r = row + (move == 1) - (move == 0)
            c = column + (move == 3) - (move == 2)
            if 0 <= r < height and 0 <= c < width and steps[r, c] < 0 and label[r, c] == label[row, column]:
                steps[r, c] = steps[row, column] + 1
                queue[end, 0], queue[end, 1] = r, c
                end += 1
    return steps
