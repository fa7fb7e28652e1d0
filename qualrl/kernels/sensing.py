"""What a robot sees: rays over a grid, as far as a radius and up to the first cell that is not free.

H, W: rows, columns.  N places to look from.  A ray goes from the centre of a cell to the centre of a cell on the rim
of the square with ``reach`` cells on each side; it passes the cells nearest to that line, one for each row or column.
"""

from typing import Any

from qualrl.kernels.jit import compiled_bare


@compiled_bare
def look(free: Any, places: Any, reach: Any, radius: Any, seen: Any) -> Any:
    """Mark all cells seen from the places: those that rays come by up to the first one that is not free.

    free (H, W) bool; places (N, 2) free cells; radius in cells, centre to centre; reach = ceil(radius);
    seen (H, W) bool, only ever set.  Between two cells that touch at a corner nothing is seen.
    """
    for n in range(places.shape[0]):
        row, column = places[n, 0], places[n, 1]
        seen[row, column] = True
        for rim in range(-reach, reach + 1):
            _ray(free, row, column, -reach, rim, reach, radius, seen)
            _ray(free, row, column, reach, rim, reach, radius, seen)
            _ray(free, row, column, rim, -reach, reach, radius, seen)
            _ray(free, row, column, rim, reach, reach, radius, seen)


@compiled_bare
def _ray(free: Any, row: Any, column: Any, down: Any, right: Any, reach: Any, radius: Any, seen: Any) -> Any:
    """Follow the ray to the rim cell (row + down, column + right)."""
    height, width = free.shape
    most = radius * radius
    r, c = row, column
    part_r, part_c = reach, reach  # of 2 * reach; half a cell at first, so that halves are rounded up
    for _ in range(reach):
        last_r, last_c = r, c
        part_r += 2 * down
        part_c += 2 * right
        if part_r >= 2 * reach:
            part_r -= 2 * reach
            r += 1
        elif part_r < 0:
            part_r += 2 * reach
            r -= 1
        if part_c >= 2 * reach:
            part_c -= 2 * reach
            c += 1
        elif part_c < 0:
            part_c += 2 * reach
            c -= 1
        if (r - row) * (r - row) + (c - column) * (c - column) > most or r < 0 or r >= height or c < 0 or c >= width:
            return
        if r != last_r and c != last_c and not free[r, last_c] and not free[last_r, c]:
            return
        seen[r, c] = True
        if not free[r, c]:
            return
