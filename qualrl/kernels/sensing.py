"""What a robot sees: rays over a grid, as far as a radius and up to the first cell that is not free.

H, W: rows, columns.  N places to look from.  A ray goes from the centre of a cell to the centre of a cell on the rim
of the square with ``reach`` = R cells on each side; it passes the cells nearest to that line, one for each row or
column.  Rays are numbered side * (2 R + 1) + R + d: up, down, left, right, each to the d-th cell from its middle.

Only rays that may show something new are followed: the cell before the first new one on a ray is free, seen already
and beside something that is not, so it is enough to follow the rays that pass such cells, which ``edge`` lists.
"""

from typing import Any

from qualrl.kernels.jit import compiled_bare, compiled_part


@compiled_bare
def look(free: Any, places: Any, reach: Any, radius: Any, seen: Any, edge: Any, count: Any, follow: Any) -> Any:
    """Mark all cells seen from the places: those that rays come by up to the first one that is not free.

    free (H, W) bool; places (N, 2) free cells; radius in cells, centre to centre; reach = ceil(radius); seen (H, W)
    bool, only ever set.  Between two cells that touch at a corner nothing is seen.
    edge (H * W,) int64: the first ``count`` are cells seen to be free, all with something unseen beside them among
    them; follow (4 * (2 R + 1),) bool, all False.  Both are kept between calls.  Returns the new count.
    """
    for n in range(places.shape[0]):
        row, column = places[n, 0], places[n, 1]
        if not seen[row, column]:
            seen[row, column] = True
            edge[count] = row * free.shape[1] + column
            count += 1
        count = _choose(free, row, column, reach, radius, seen, edge, count, follow)
        for side in range(4):
            for d in range(-reach, reach + 1):
                at = side * (2 * reach + 1) + reach + d
                if follow[at]:
                    follow[at] = False
                    down = d if side > 1 else reach * (2 * side - 1)
                    right = d if side < 2 else reach * (2 * side - 5)
                    count = _ray(free, row, column, down, right, reach, radius, seen, edge, count)
    return count


@compiled_part
def _choose(
    free: Any, row: Any, column: Any, reach: Any, radius: Any, seen: Any, edge: Any, count: Any, follow: Any
) -> Any:
    """Choose the rays to follow; cells that are no edge any more leave the list.  Returns the new count."""
    i = 0
    while i < count:
        r, c = edge[i] // free.shape[1], edge[i] % free.shape[1]
        dr, dc = r - row, c - column
        i += 1
        if dr * dr + dc * dc <= radius * radius:
            if _goes_on(free, seen, r, c):
                if abs(dr) >= abs(dc):
                    _follow_through(1 if dr > 0 else 0, abs(dr), dc, reach, follow)
                if abs(dc) >= abs(dr):
                    _follow_through(3 if dc > 0 else 2, abs(dc), dr, reach, follow)
            else:
                count -= 1
                i -= 1
                edge[i] = edge[count]
    return count


@compiled_part
def _goes_on(free: Any, seen: Any, r: Any, c: Any) -> Any:
    """Whether a ray may go on from a free cell into one that was not seen."""
    for y in range(max(r - 1, 0), min(r + 2, free.shape[0])):
        for x in range(max(c - 1, 0), min(c + 2, free.shape[1])):
            if not seen[y, x] and (free[r, x] or free[y, c]):
                return True
    return False


@compiled_part
def _follow_through(side: Any, k: Any, across: Any, reach: Any, follow: Any) -> Any:
    """Choose the rays of a side that at their k-th cell are ``across`` cells off its middle; all sides for k = 0."""
    if k == 0:
        follow[:] = True
        return
    first = -((1 - 2 * across) * reach // (2 * k))  # rounded up
    last = -((-1 - 2 * across) * reach // (2 * k)) - 1
    for d in range(max(first, -reach), min(last, reach) + 1):
        follow[side * (2 * reach + 1) + reach + d] = True


@compiled_part
def _ray(
    free: Any, row: Any, column: Any, down: Any, right: Any, reach: Any, radius: Any, seen: Any, edge: Any, count: Any
) -> Any:
    """Follow the ray to the rim cell (row + down, column + right).  Returns the new count."""
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
            return count
        if r != last_r and c != last_c and not free[r, last_c] and not free[last_r, c]:
            return count
        if not seen[r, c]:
            seen[r, c] = True
            if free[r, c]:
                edge[count] = r * width + c
                count += 1
        if not free[r, c]:
            return count
    return count
