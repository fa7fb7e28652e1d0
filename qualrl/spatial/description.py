"""What a region is: its shape in numbers, the kind that follows from them, its place in the order, its name.

R regions.  H, W: rows, columns of the grid.  Lengths are in cells unless their name says otherwise.

The rules, first come first served; areas are meant for buildings, but a hall is also large beside the other rooms (if
any), so that maps without units, whose cells count as a metre, have no halls for their size alone:

- pocket: nothing connects it to the rest of the map;
- open area: openings, or unknown space, bound it rather than walls;
- corridor: long for its width, along bends, branches and rings; longer still if fewer than two ways lead out of it,
  for a room with a niche is not one;
- closet: small, with one way out at most;
- hall: large, or a hub (many ways out, and roomy);
- room: all else.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import labels, zone_graph
from qualrl.kernels import regions as kernels
from qualrl.kernels.bands import both
from qualrl.spatial.distance import distance_within
from qualrl.spatial.naming import names_of, ordered
from qualrl.spatial.region_map import Doorway, Region, Shape
from qualrl.spatial.view import WALLED_M

ELONGATED = 3.0
"""A corridor's area is at least this many squares of its width, twice as many if fewer than two ways lead out."""
COMPACT, WINDING = 0.65, 1.75
"""Unless its rectangle is elongated too, it fills at most this share of the rectangle, and its stretch times the share
left empty is at least this."""
CLOSET_M2 = 5.0
"""A closet has less area."""
HALL_M2, HALL_TIMES = 60.0, 2.5
"""A hall has at least this area, and this many times that of the map's typical (median) room, unless it is alone."""
HUB_M2, HUB_TIMES, HUB_WAYS = 25.0, 1.5, 5
"""So much is enough for a hall with that many ways out."""
OPEN = 0.5
"""Openings are this share of an open area's border ..."""
UNSEEN = 0.6
"""... or openings and unknown space this one,"""
RECTANGULAR = 0.8
"""unless it fills this share of a rectangle: scans often leave out walls, but no open area is that straight."""
WALLED = 0.6
"""Unknown space counts where regions with more wall than that around them hold this share of the free space."""

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Floats = NDArray[np.float32]


class Parts(NamedTuple):
    """Regions before they have an order: arrays by their number."""

    label: Labels
    """(H, W) number of each cell's region, from 0 without gaps; -1 where not free."""
    cells: NDArray[np.int64]
    """(R,)"""
    centroid: NDArray[np.float64]
    """(R, 2)"""
    centre: Labels
    """(R,) flat index of a cell well inside."""
    half_width: Floats
    """(R,) radius of the largest free disc over a cell, on average."""
    is_pocket: Flags
    """(R,)"""


def mean_half_width(label: Labels, thickness: Floats) -> Floats:
    """(R,) mean of the thickness (H, W), the radius of the largest free disc over each cell, in each region (H, W)."""
    cells, wide, _ = zone_graph.amounts(label, thickness, int(label.max()) + 1).T
    return np.asarray(wide / cells, np.float32)


def measure(label: Labels, is_pocket: Flags, half_width: Floats) -> Parts:
    """The regions of a label image (H, W), from 0 without gaps, -1 where not free; is_pocket, half_width (R,)."""
    inside = label >= 0
    inside.ravel()[kernels.crossings(label)] = False
    depth = distance_within(np.pad(inside, 1))[1:-1, 1:-1]
    cells, sums, centre = labels.measured(label, len(half_width), depth)
    return Parts(label, cells, sums / cells[:, None], centre, half_width, is_pocket)


def decided(
    parts: Parts, doorways: Sequence[Doorway], occupied: Flags, resolution_m: float
) -> tuple[list[Shape], list[str]]:
    """The shapes of the regions and the kinds that follow from them, by number."""
    shapes = shapes_of(parts, doorways, occupied, resolution_m)
    areas_m2 = (parts.cells * resolution_m**2).tolist()
    return shapes, _kinds(parts.is_pocket, areas_m2, shapes, resolution_m <= WALLED_M)


def listed(
    parts: Parts, shapes: Sequence[Shape], kinds: Sequence[str], resolution_m: float
) -> tuple[tuple[Region, ...], list[int]]:
    """The regions in their order, with names; and the number of each in ``parts``."""
    order = ordered(kinds, parts.centroid, parts.cells, resolution_m)
    kinds = [kinds[at] for at in order]
    return tuple(recorded(parts, list(zip(names_of(kinds), kinds, strict=True)), shapes, resolution_m, order)), order


def recorded(
    parts: Parts, titles: Sequence[tuple[str, str]], shapes: Sequence[Shape], resolution_m: float, order: Sequence[int]
) -> list[Region]:
    """The regions in an order, of their numbers; titles: the name and kind of each; shapes by number."""
    width = parts.label.shape[1]
    return [
        Region(
            name, kind, size, size * resolution_m**2, (row, column), divmod(at, width), shapes[number],
        )
        for number, (name, kind), size, (row, column), at in zip(
            order, titles, parts.cells[order].tolist(), parts.centroid[order].tolist(), parts.centre[order].tolist(),
            strict=True,
        )
    ]  # fmt: skip


def shapes_of(parts: Parts, doorways: Sequence[Doorway], occupied: Flags, resolution_m: float) -> list[Shape]:
    """The shape of each region."""
    count = len(parts.cells)
    border_sides, sides = both(partial(labels.borders, parts.label, occupied, count), partial(_sides, parts))
    walls, unknown = border_sides.T
    ways = np.zeros((count, 2), np.int64)
    opening = np.zeros(count, np.int64)
    for door in doorways:
        for region in door.pair:
            ways[region, int(door.is_open)] += 1
            opening[region] += len(door.cells) * door.is_open
    border = np.maximum(walls + unknown + opening, 1)
    # A map that shows hardly any walls says nothing by where they lack.
    linked = np.where(parts.is_pocket, 0, parts.cells)
    says_walls = linked[walls >= unknown].sum() >= WALLED * linked.sum()
    half_width = parts.half_width.astype(np.float64)
    stretch, fill = parts.cells / (2 * half_width) ** 2, parts.cells / sides.prod(axis=1)
    open_share = opening / border
    unknown_share = unknown / border if says_walls else np.zeros(count)
    columns = half_width * resolution_m, stretch, *(sides.T * resolution_m), fill, *ways.T, open_share, unknown_share
    # Of thousands of pockets many are alike in all of this, and one record does for them.
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    shape_of = {row: _shape(*row) for row in dict.fromkeys(rows)}
    return [shape_of[row] for row in rows]


def _shape(half_width_m: float, stretch: float, longer_m: float, shorter_m: float, *rest: Any) -> Shape:
    """A shape from its numbers, in their order."""
    return Shape(half_width_m, stretch, (longer_m, shorter_m), *rest)


def _sides(parts: Parts) -> NDArray[np.float64]:
    """(R, 2) longer and shorter side of the smallest rectangle around each region; of any slant, pockets' upright."""
    boxes = labels.boxes(parts.label, len(parts.cells))
    sides = np.sort(np.stack([boxes[:, 1] - boxes[:, 0], boxes[:, 3] - boxes[:, 2]], axis=1).astype(np.float64))
    start, ends = labels.row_ends(parts.label, boxes)
    for region in np.flatnonzero(~parts.is_pocket).tolist():
        columns = ends[start[region] : start[region + 1]]
        rows = np.flatnonzero(columns[:, 1] >= 0)
        # The rows' ends have the same hull as all cells.
        points = np.stack([columns[rows].T.ravel(), np.tile(rows, 2)], axis=1)
        sides[region] = sorted(float(side) + 1 for side in cv2.minAreaRect(points.astype(np.float32))[1])
    return sides[:, ::-1]


def _kinds(is_pocket: Flags, areas_m2: Sequence[float], shapes: Sequence[Shape], in_metres: bool) -> list[str]:
    """The kind of each region: see the rules above; a single room is beside no others."""
    kinds = [
        "pocket" if apart else _kind(area_m2, shape)
        for apart, area_m2, shape in zip(is_pocket, areas_m2, shapes, strict=True)
    ]
    rooms = [at for at, kind in enumerate(kinds) if kind == "room"]
    compared = rooms if len(rooms) > 1 or not in_metres else ()
    typical_m2 = float(np.median([areas_m2[at] for at in compared])) if compared else 0.0
    for at in rooms:
        if _is_hall(areas_m2[at], shapes[at], typical_m2):
            kinds[at] = "hall"
    return kinds


def _kind(area_m2: float, shape: Shape) -> str:
    """The kind as far as the region alone decides it."""
    unseen = shape.open_share + shape.unknown_share
    if shape.open_share >= OPEN or (unseen >= UNSEEN and shape.fill < RECTANGULAR):
        return "open area"
    longer_m, shorter_m = shape.sides_m
    slender = longer_m >= ELONGATED * shorter_m
    # Clutter makes rooms look long: those that fill a rectangle are rooms all the same.
    winding = slender or (shape.fill <= COMPACT and shape.stretch * (1 - shape.fill) >= WINDING)
    if winding and shape.stretch >= ELONGATED * (1 if slender or shape.degree >= 2 else 2):
        return "corridor"
    return "closet" if area_m2 < CLOSET_M2 and shape.degree == 1 else "room"


def _is_hall(area_m2: float, shape: Shape, typical_m2: float) -> bool:
    large = area_m2 >= max(HALL_M2, HALL_TIMES * typical_m2)
    return large or (shape.degree >= HUB_WAYS and area_m2 >= max(HUB_M2, HUB_TIMES * typical_m2))
