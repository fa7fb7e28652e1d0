"""Places by what was learned: zones of a map with walls are merged as trained trees tell.

The trees were trained on floor plans that this project generates itself (``qualrl.training``), on no map of
anybody's building.  Lines across the gaps of walls cut the free space into many small zones; pairs of places are then
merged, the likeliest to be one first, and each merged place is looked at anew.

h, w: rows, columns of the view.  Z: zones.
"""

from collections.abc import Callable
from functools import cache, partial
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import flooding, linking, wall_gaps, zone_graph
from qualrl.kernels import merging as kernels
from qualrl.kernels import regions as zone_kernels
from qualrl.kernels.bands import Result, both
from qualrl.kernels.bonds import Bonds, linked
from qualrl.kernels.labels import borders, consecutive, renumber, sizes
from qualrl.kernels.trees import Questions, Trees, questions_of
from qualrl.kernels.zones import flat_zones
from qualrl.spatial.distance import distance_within, thickness_over
from qualrl.spatial.straightening import straightened
from qualrl.spatial.view import View
from qualrl.spatial.wall_lines import WallLines, find_wall_lines, walls_of, without_specks

PINCH, STEP = 0.85, 0.8
"""See ``kernels.zones.flat_zones``."""
LEAST_ZONE_M2 = 0.15
"""Smaller zones go to those beside them."""
LEAST_ODDS = 0.0
"""Pairs are merged from these odds on (their logarithm)."""
STRAIGHTENED_M = 0.3
"""Borders move at most so far to where free space is narrowest."""
WALL_M = 0.5
"""Walls are at most so thick."""
MOST_SUPPORT_M = 5.0
"""A longer wall beside a gap says no more."""
DIRECTIONS = 32
"""In which the reach of places is measured."""
NO_SAMPLES = kernels.Samples(np.zeros(0, np.int32), np.zeros((0, 0)), np.zeros(1, np.int64))

Flags = NDArray[np.bool_]
Labels = NDArray[np.int32]
Cells = NDArray[np.int64]
Floats = NDArray[np.float64]


class ZoneGraph(NamedTuple):
    """The zones of a view and what is known of them."""

    zone: Labels
    """(h, w) zone of each cell, -1 where not free."""
    places: kernels.Places
    bonds: Bonds
    about: Floats
    """(3,) features of the whole map."""


def merged_regions(
    view: View, occupied: Flags, min_area_m2: float, meanwhile: Callable[[], Result]
) -> tuple[Labels, Result]:
    """(h, w) region of each cell of the view, -1 where it is not free; occupied (H, W).

    And what a task makes that another processor has time for.
    """
    graph, made = zone_graph_of(view, occupied, meanwhile)
    asked = questions()

    def merge(chosen: Cells) -> None:
        of_map = asked, graph.about, LEAST_ODDS, min_area_m2, NO_SAMPLES
        kernels.merge(graph.places, graph.bonds, chosen, *of_map)

    both(*(partial(merge, half) for half in apart(graph.bonds)))
    region = renumber(graph.zone, graph.places.parent)
    return straightened(region, view, STRAIGHTENED_M / view.cell_m), made


def apart(bonds: Bonds) -> tuple[Cells, Cells]:
    """The zones in two parts that no bonds lead between, as near to halves as can be: of one building, all and none."""
    count = len(bonds.first)
    ends, starts = np.ascontiguousarray(bonds.target.reshape(-1, 2).T, np.int64)
    piece = linking.pieces(starts, ends, count)
    cells = np.bincount(piece)
    is_first = (np.cumsum(cells) - cells / 2 <= count / 2)[piece]
    return np.flatnonzero(is_first), np.flatnonzero(~is_first)


@cache
def questions() -> Questions:
    """What the trained trees ask."""
    with np.load(str(files("qualrl.spatial").joinpath("merging.npz")), allow_pickle=False) as stored:
        return questions_of(unpacked({name: stored[name] for name in stored.files}))


def unpacked(stored: dict[str, NDArray[np.generic]]) -> Trees:
    """Trees from their arrays as they are stored."""
    whole = {name: np.asarray(stored[name], np.int32) for name in ("root", "feature", "left", "right")}
    parts = {name: np.asarray(stored[name], np.float32) for name in ("threshold", "leaf")}
    return Trees(
        whole["root"], whole["feature"], parts["threshold"], whole["left"], whole["right"], parts["leaf"],
        float(stored["start"]),
    )  # fmt: skip


def zone_graph_of(view: View, occupied: Flags, meanwhile: Callable[[], Result]) -> tuple[ZoneGraph, Result]:
    """The zones of a view, unmerged; occupied (H, W).  And what a task makes that another processor has time for."""
    wall = walls_of(view.of_grid(without_specks(occupied) if view.zoom == 1 else occupied), view.clear)
    lines, _ = both(partial(find_wall_lines, wall, view.clear, view.cell_m), view.measure)
    zone, count, made = _zones(view, view.clear & (lines.line < 0), meanwhile)
    ends = zone_kernels.crossings(zone)
    places, (bonds, touching) = both(
        partial(_places, zone, count, view, wall, lines), partial(_bonds, zone, count, ends, view, lines)
    )
    places.sums[:, kernels.TOUCHING] = touching
    walls, unknown, area = (places.sums[:, column].sum() for column in (kernels.WALLS, kernels.UNKNOWN, kernels.AREA))
    breadth = places.sums[:, kernels.THICK].sum() / max(area, 1e-6)
    about = np.array([unknown / max(walls + unknown, 1e-6), np.log(max(count, 1) / max(area, 1e-2)), breadth])
    return ZoneGraph(zone, places, bonds, about), made


def _zones(view: View, cut: Flags, meanwhile: Callable[[], Result]) -> tuple[Labels, int, Result]:
    """(h, w) zones of alike thickness of the free space as the lines cut it (h, w), numbered from 0; and how many.

    Cells that small zones leave are reached one after the other: another processor has time meanwhile.
    """
    distance = distance_within(cut)
    zone, count = flat_zones(thickness_over(distance), distance, PINCH, STEP)
    del distance, cut
    is_small = sizes(zone, count) < LEAST_ZONE_M2 / view.cell_m**2
    renumber(zone, np.where(is_small, -1, np.arange(count)).astype(np.int32))
    _, made = both(partial(flooding.flood, zone, view.clear, view.distance), meanwhile)
    flooding.number_rest(zone, view.clear)
    return zone, consecutive(zone), made


def _places(zone: Labels, count: int, view: View, wall: Flags, lines: WallLines) -> kernels.Places:
    """The zones as places, each by itself; ``TOUCHING`` is left 0."""
    cell_m = view.cell_m
    cells, wide, widest = zone_graph.amounts(zone, view.thickness, count).T
    border = borders(zone, wall, count) * cell_m
    angles = np.radians(lines.turn_deg) + 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    reach = zone_graph.reaches(zone, count, np.stack([np.sin(angles), np.cos(angles)], axis=1)) * cell_m
    sums = np.stack([cells * cell_m**2, wide * cell_m**3, border[:, 0], border[:, 1], np.zeros(count)], axis=1)
    return kernels.Places(np.arange(count, dtype=np.int32), sums, widest * cell_m, reach)


def _bonds(zone: Labels, count: int, ends: Labels, view: View, lines: WallLines) -> tuple[Bonds, Floats]:
    """Where zones touch (ends (N, 2): the steps that cross) or have a wall between them; and how many metres of each
    zone's border (Z,) touch others.
    """
    at = zone_graph.line_at_steps(ends, lines.line)
    is_lined = at >= 0
    support_m = np.where(is_lined, np.append(np.minimum(lines.support_m, MOST_SUPPORT_M), 0.0)[at], 0.0)
    gap_m = np.where(is_lined, np.append(lines.gap_m, 0.0)[at], 0.0)
    touching = zone.ravel()[ends]
    is_row = ends[:, 1] - ends[:, 0] == 1
    facing, axis = wall_gaps.walls_between(zone, max(round(WALL_M / view.cell_m), 2))
    pair = np.sort(np.concatenate([touching, facing]), axis=1).astype(np.int64)
    key, contact = np.unique(pair[:, 0] * count + pair[:, 1], return_inverse=True)
    here, there = contact[: len(touching)], contact[len(touching) :]
    way = np.zeros(key.size)
    np.maximum.at(way, here, view.distance.ravel()[ends].min(axis=1))
    columns = [np.bincount(here, weights, key.size) for weights in (is_row, ~is_row, is_lined, support_m, gap_m)] + [
        np.bincount(there, axis == along, key.size) for along in (0, 1)
    ]
    sums = np.stack([*columns, way], axis=1) * view.cell_m
    bonds = linked(np.stack(np.divmod(key, max(count, 1)), axis=1).astype(np.int32), sums, count)
    return bonds, np.bincount(touching.ravel(), minlength=count).astype(np.float64) * view.cell_m
