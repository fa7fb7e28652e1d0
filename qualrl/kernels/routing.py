"""Shortest walks over the cells of a label image, region by region.

H, W: rows, columns.  R regions.  A *gate* is a doorway as seen from one of its two regions: N gates, sorted by region.
Moves are 4-connected.  ``seen`` (H * W,) int32 is kept from walk to walk: a cell was reached by this one if it holds
``base`` or more, and base less than that is how many steps it is away.  So nothing is cleared between walks.
"""

import heapq
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled

Ints = NDArray[np.int32]
Flags = NDArray[np.bool_]


class Gates(NamedTuple):
    """All doorways of a map, twice."""

    first: NDArray[np.int64]
    """(R + 1,) the gates of region r are first[r] .. first[r + 1]."""
    cell: Ints
    """(N,) flat index of the cell in the middle of the doorway, on the region's side."""
    region: Ints
    partner: Ints
    """(N,) the same doorway from the other side."""
    row: NDArray[np.int64]
    """(N,) where the steps from a gate to all gates of its region begin in a list of them all."""
    cells: Ints
    """All cells of the doorways, gate after gate, on the region's side."""
    cell_first: NDArray[np.int64]
    """(N + 1,) those of gate n are cell_first[n] .. cell_first[n + 1]."""


class End(NamedTuple):
    """Where a way begins or ends."""

    row: int
    column: int
    region: int
    middle: Ints
    """(K,) steps between it and the middle of each gate of its region without leaving that; -1 where no way leads."""
    nearest: Ints
    """(K,) the same for the nearest of each gate's cells."""


@compiled
def walk(
    label: Ints, allowed: Flags, sources: Ints, targets: Ints, enough: int, aim: int, most: int, seen: Ints, base: int,
    queue: Ints, wanted: Flags,
) -> int:  # fmt: skip
    """Reach out from cells over the regions allowed (R,) until enough of the targets are reached, or no more is.

    No two of the sources are alike, nor of the targets.  aim, most: cells from which even the straight way to the cell
    ``aim`` would make the whole longer than ``most`` are left out.
    queue, wanted (H * W,): scratch; wanted is all False before and after.
    Returns one more than the most steps made: by so much the next walk's base is larger.
    """
    height, width = label.shape
    for target in targets:
        wanted[target] = True
    missing = enough
    head, end, steps = 0, 0, 0
    for source in sources:
        seen[source], queue[end] = base, source
        end += 1
        missing -= 1 if wanted[source] else 0
    to_row, to_column = aim // width, aim % width
    while head < end and missing > 0:
        here = queue[head]
        head += 1
        steps = seen[here] - base + 1
        row, column = here // width, here % width
        for side in range(4):
            r, c = row + (side == 1) - (side == 0), column + (side == 3) - (side == 2)
            if r < 0 or c < 0 or r >= height or c >= width or label[r, c] < 0 or not allowed[label[r, c]]:
                continue
            other = r * width + c
            if seen[other] < base and steps + abs(r - to_row) + abs(c - to_column) <= most:
                seen[other], queue[end] = base + steps, other
                end += 1
                missing -= 1 if wanted[other] else 0
    for target in targets:
        wanted[target] = False
    return steps + 1


@compiled
def nearest_gates(label: Ints, cells: Ints, owner: Ints, steps: Ints, queue: Ints) -> tuple[Ints, Ints]:
    """Pairs of gates (P, 2) whose cells meet, and the steps (P,) between them there, in one region.

    cells (K,): where its gates are.  A cell belongs to the gate that is nearest.  owner (H * W,): -1 everywhere before
    and after; steps, queue (H * W,): scratch.
    """
    height, width = label.shape
    flat = label.ravel()
    end = 0
    for gate in range(cells.size):
        if owner[cells[gate]] < 0:
            owner[cells[gate]], steps[cells[gate]], queue[end] = gate, 0, cells[gate]
            end += 1
    head = 0
    while head < end:
        here = queue[head]
        head += 1
        row, column = here // width, here % width
        for side in range(4):
            r, c = row + (side == 1) - (side == 0), column + (side == 3) - (side == 2)
            other = r * width + c
            if 0 <= r < height and 0 <= c < width and flat[other] == flat[here] and owner[other] < 0:
                owner[other], steps[other], queue[end] = owner[here], steps[here] + 1, other
                end += 1
    pairs, between = np.empty((0, 2), np.int32), np.empty(0, np.int32)
    for fill in range(2):
        count = 0
        for at in range(end):
            here = queue[at]
            for other, inside in ((here + 1, here % width < width - 1), (here + width, here < (height - 1) * width)):
                if inside and flat[other] == flat[here] and owner[other] != owner[here]:
                    if fill:
                        pairs[count, 0], pairs[count, 1] = owner[here], owner[other]
                        between[count] = steps[here] + steps[other] + 1
                    count += 1
        if not fill:
            pairs, between = np.empty((count, 2), np.int32), np.empty(count, np.int32)
    for at in range(end):
        owner[queue[at]] = -1
    return pairs, between


@compiled
def way_back(label: Ints, seen: Ints, base: int, start: int) -> Ints:
    """(steps + 1, 2) rows and columns from a cell that a walk has reached to where the walk began."""
    height, width = label.shape
    steps = seen[start] - base
    cells = np.empty((steps + 1, 2), np.int32)
    row, column = start // width, start % width
    for at in range(steps + 1):
        cells[at, 0], cells[at, 1] = row, column
        nearer = base + steps - at - 1
        for side in range(4):
            r, c = row + (side == 1) - (side == 0), column + (side == 3) - (side == 2)
            if 0 <= r < height and 0 <= c < width and at < steps and seen[r * width + c] == nearer:
                row, column = r, c
                break
    return cells


@compiled
def over_gates(
    gates: Gates, steps: Ints, start: int, leave: Ints, goal: int, arrive: Ints, beyond: Ints, most: int
) -> Any:  # fmt: skip
    """The way from a region to another through gates that is shortest and takes less than ``most`` steps.

    steps: between the gates of a region, see ``Gates.row``; leave, arrive: from the start to the gates of its region,
    and from those of the goal's region to the goal; -1 where there is no way.  beyond (N,): at least so many steps
    remain from each gate on, by which the search is led.
    Returns (its steps, or most; the last gate by which it leaves a region, or -1; away (N,) steps from the start to
    each gate within its region, or most for those not met on the search; before (N,) the gate left by before, or -1).
    """
    away = np.full(gates.cell.size, most, np.int64)
    before = np.full(gates.cell.size, -1, np.int32)
    heap = [(np.int64(most), np.int32(0))]
    for out in range(gates.first[start], gates.first[start + 1]):
        there = leave[out - gates.first[start]]
        if there >= 0 and there + beyond[out] < most:
            away[out] = there
            heapq.heappush(heap, (away[out] + beyond[out], np.int32(out)))
    last, best = -1, most
    while heap:
        whole, gate = heapq.heappop(heap)
        if whole >= best:
            break
        if whole > away[gate] + beyond[gate]:
            continue
        inside = gates.partner[gate]
        here = away[gate] + 1
        region = gates.region[inside]
        first = gates.first[region]
        if region == goal and arrive[inside - first] >= 0 and here + arrive[inside - first] < best:
            last, best = int(gate), here + arrive[inside - first]
        row = gates.row[inside] - first
        for other in range(first, gates.first[region + 1]):
            between = steps[row + other]
            there = here + between
            if between >= 0 and there < away[other] and there + beyond[other] < best:
                away[other], before[other] = there, gate
                heapq.heappush(heap, (there + beyond[other], np.int32(other)))
    return best, last, away, before


@compiled
def on_the_way(
    gates: Gates, boxes: Ints, steps: Ints, least: Ints, start: End, goal: End, most: int, longer: int
) -> Any:  # fmt: skip
    """The regions (R,) to look for a way in, and how many steps it takes at most; ``planning.gate_graph`` says why.

    boxes (4, N): first and last row, first and last column of each gate's cells.  steps, least: as in
    ``planning.gate_graph``.  most: steps of a way that is known already.  longer: by how many hundredths the way may be
    longer than the shortest.
    """
    n_gates = gates.cell.size
    beyond = np.empty(n_gates, np.int32)
    for gate in range(n_gates):
        down = max(goal.row - boxes[1, gate], boxes[0, gate] - goal.row, 0)
        beyond[gate] = down + max(goal.column - boxes[3, gate], boxes[2, gate] - goal.column, 0)
    most, last, _, before = over_gates(gates, steps, start.region, start.middle, goal.region, goal.middle, beyond, most)
    wanted = np.zeros(gates.first.size - 1, np.bool_)
    while last >= 0:
        wanted[gates.region[last]] = wanted[gates.region[gates.partner[last]]] = True
        last = before[last]
    limit = -(-100 * most // (100 + longer))
    nowhere = np.empty(0, np.int32)
    away = over_gates(gates, least, start.region, start.nearest, -1, nowhere, beyond, limit)[2]
    for gate in range(n_gates):
        beyond[gate] = away[gates.partner[gate]] + 1
    back = over_gates(gates, least, goal.region, goal.nearest, -1, nowhere, beyond, limit)[2]
    for gate in range(n_gates):
        if back[gate] < limit:
            wanted[gates.region[gate]] = wanted[gates.region[gates.partner[gate]]] = True
    return wanted, most
