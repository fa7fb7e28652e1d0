"""Colours of regions: neighbours differ, in any eye, and black text is readable on all of them.

H, W: rows, columns of the map.  Colours are sRGB; distances between them are CIE76 in Lab.
"""

from collections.abc import Sequence
from typing import Any

import cv2
import networkx as nx
import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from qualrl.spatial.region_map import RegionMap

PALETTE = ("#f4dc64", "#ac94f4", "#88ac70", "#f4d0f4", "#b8a040", "#dcf4a0", "#b894c4", "#c4e8c4")
"""Any two are 22 apart and more, also as those see them who lack red or green cones; lightness 66 to 93 of 100."""
WALL, UNKNOWN, TIGHT, POCKET = "#222222", "#b5b5b5", "#ffffff", "#ffffff"
NOT_FREE = (TIGHT, UNKNOWN, WALL)
STRIPE_PX = 6
"""Pockets are striped; their stripes come again after so many pixels."""
NEAR_M, NEAR_CELLS, NEAR_PX = 0.5, 3.0, 10.0
"""Regions this near to each other, by any of the three, get different colours: a wall is no thicker."""
LONG_SIDE = 1200
"""Neighbours are looked for on at most so many cells a side."""

Image = NDArray[np.uint8]


def region_image(regions: RegionMap, window: tuple[slice, slice], height_px: int, width_px: int) -> Image:
    """(height_px, width_px, 3) a part of the map in colours; cells smaller than pixels are mixed."""
    index = colour_index(regions)[window]
    numbers = colour_numbers(regions, width_px / index.shape[1])
    names = [*(POCKET if number is None else PALETTE[number] for number in numbers), *NOT_FREE]
    image = painted(index, names, height_px, width_px)
    is_pocket = np.array([*(number is None for number in numbers), *(False for _ in NOT_FREE)])
    if is_pocket.any():
        size = (width_px, height_px)
        rows, columns = np.indices((height_px, width_px), np.int32)
        pockets = cv2.resize(is_pocket[index].astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT) > 0
        image[pockets & ((rows + columns) % STRIPE_PX < STRIPE_PX // 3)] = np.multiply(to_rgb(UNKNOWN), 255)
    return image


def painted(index: NDArray[np.integer[Any]], names: Sequence[str], height_px: int, width_px: int) -> Image:
    """(height_px, width_px, 3) cells by their colours' index in a list of names; smaller than pixels they are mixed."""
    table = np.array([np.multiply(to_rgb(name), 255).round() for name in names], np.uint8)
    way = cv2.INTER_AREA if width_px < index.shape[1] else cv2.INTER_NEAREST_EXACT
    return np.asarray(cv2.resize(table[index], (width_px, height_px), interpolation=way), np.uint8)


def colour_index(regions: RegionMap) -> NDArray[np.int32]:
    """(H, W) number of each cell's region, or that of its colour in ``NOT_FREE``, counted from the end."""
    tight = regions.grid.tight
    index = np.where(regions.label >= 0, regions.label, np.where(regions.grid.occupied, -1, -2))
    return np.asarray(index if tight is None else np.where(tight, -3, index), np.int32)


def colour_numbers(regions: RegionMap, px_per_cell: float) -> list[int | None]:
    """A colour for each region: not that of one nearby, and of the rest the least used.  None for a pocket.

    Of a planar graph's nodes, taken smallest last, each has at most five neighbours before it, so eight suffice.
    """
    graph = nearby_regions(regions, px_per_cell)
    numbers: list[int | None] = [None] * len(regions.regions)
    used = [0] * len(PALETTE)
    for index in nx.coloring.strategy_smallest_last(graph, None):
        taken = {numbers[other] for other in graph[index]}
        number = min(range(len(PALETTE)), key=lambda colour: (colour in taken, used[colour], colour))
        used[number] += 1
        numbers[index] = number
    return numbers


def nearby_regions(regions: RegionMap, px_per_cell: float) -> "nx.Graph[int]":
    """Indices of regions, pockets left out, joined where nothing but a wall's thickness is between them."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(index for index, region in enumerate(regions.regions) if region.kind != "pocket")
    step = -(-max(regions.label.shape) // LONG_SIDE)
    label = regions.label[::step, ::step]
    coloured = np.array([*(region.kind != "pocket" for region in regions.regions), False])
    blank = (~coloured[label]).astype(np.uint8)  # label -1 reads the last entry
    if blank.all():
        return graph
    # The nearest coloured cell of each cell: the borders between these areas are the neighbourhoods, in any direction.
    distance, nearest = cv2.distanceTransformWithLabels(
        blank, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner_of = np.zeros(int(nearest.max()) + 1, np.int64)
    owner_of[nearest[blank == 0]] = label[blank == 0]
    owner = owner_of[nearest]
    near = max(NEAR_M / regions.grid.resolution_m, NEAR_CELLS, NEAR_PX / px_per_cell) / step
    for here, there in ((np.s_[1:, :], np.s_[:-1, :]), (np.s_[:, 1:], np.s_[:, :-1])):
        apart = (owner[here] != owner[there]) & (distance[here] + distance[there] <= near)
        pairs = np.unique(owner[here][apart] * len(regions.regions) + owner[there][apart])
        graph.add_edges_from((pair // len(regions.regions), pair % len(regions.regions)) for pair in pairs.tolist())
    return graph
