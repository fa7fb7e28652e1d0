"""Rays of a laser scanner through a plan with windows.

H, W: rows, columns.  Lengths are in cells.
"""

from typing import Any

import numpy as np

from qualrl.kernels.jit import compiled

STRIDE = 0.7
"""A ray is looked at this often; walls are one cell thick at least."""


@compiled
def scan(solid: Any, glass: Any, poses: Any, reach: Any, rays: Any, luck: Any) -> Any:
    """How often rays crossed each cell, and how often they ended in it: two arrays (H, W) int32.

    solid (H, W) bool what ends a ray; glass (H, W) the chance that a solid cell lets one through;
    poses (N, 2) rows and columns; luck (M,) random numbers from 0 to 1, used again and again.
    One ray in five ends early, somewhere between four tenths of its reach and all of it.
    """
    height, width = solid.shape
    seen, hit = np.zeros((height, width), np.int32), np.zeros((height, width), np.int32)
    drawn = 0
    for pose in range(len(poses)):
        for ray in range(rays):
            angle = 2 * np.pi * (ray + luck[drawn % luck.size]) / rays
            short = luck[(drawn + 1) % luck.size] < 0.2
            length = reach * (0.4 + 0.6 * luck[(drawn + 2) % luck.size]) if short else 1.0 * reach
            drawn += 3
            y, x = poses[pose, 0], poses[pose, 1]
            down, right = STRIDE * np.sin(angle), STRIDE * np.cos(angle)
            for _ in range(int(length / STRIDE)):
                y += down
                x += right
                row, column = int(np.floor(y)), int(np.floor(x))
                if row < 0 or column < 0 or row >= height or column >= width:
                    break
                if solid[row, column]:
                    drawn += 1
                    if glass[row, column] <= luck[drawn % luck.size]:
                        hit[row, column] += 1
                        break
                else:
                    seen[row, column] += 1
    return seen, hit
