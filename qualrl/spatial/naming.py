"""Order and names of places: the same map gives the same names, and a few stray cells do not change them."""

from collections.abc import Sequence
from dataclasses import replace

from qualrl.spatial.region_map import Region

KINDS = ("room", "corridor", "pocket")
"""The order in which regions are listed."""
ALIKE = 0.98
"""Areas are alike, and position decides, when the smaller is at least this share of the larger."""


def letters(index: int) -> str:
    """A, B, .. Z, AA, AB, .. for 0, 1, ..

    >>> letters(0), letters(25), letters(26)
    ('A', 'Z', 'AA')
    """
    name = ""
    index += 1
    while index > 0:
        index, last = divmod(index - 1, 26)
        name = chr(ord("A") + last) + name
    return name


def reading_order(places: Sequence[tuple[float, float]], line: float) -> list[int]:
    """Indices of (row, column) places as one reads: line by line, and from west to east within a line.

    A line takes in all places at most ``line`` rows below its first one.
    """
    order: list[int] = []
    waiting = sorted(range(len(places)), key=lambda index: places[index])
    while waiting:
        last = places[waiting[0]][0] + line
        end = next((at for at, index in enumerate(waiting) if places[index][0] > last), len(waiting))
        order += sorted(waiting[:end], key=lambda index: (places[index][1], places[index][0]))
        waiting = waiting[end:]
    return order


def ordered(regions: Sequence[Region], line: float) -> list[int]:
    """Indices of regions by kind, then area (largest first), then position.

    Regions whose areas are alike form one group, led by the largest: within it they go in reading order.
    """
    order: list[int] = []
    for kind in KINDS:
        waiting = [at for at, region in enumerate(regions) if region.kind == kind]
        waiting.sort(key=lambda at: -regions[at].cells)
        while waiting:
            least = ALIKE * regions[waiting[0]].cells
            end = next((at for at, index in enumerate(waiting) if regions[index].cells < least), len(waiting))
            group, waiting = waiting[:end], waiting[end:]
            order += [group[at] for at in reading_order([regions[index].centroid for index in group], line)]
    return order


def name_regions(regions: Sequence[Region]) -> tuple[Region, ...]:
    """The regions, in their order, with names: room A, corridor 1, pocket 1."""
    count = dict.fromkeys(KINDS, 0)
    named = []
    for region in regions:
        number = count[region.kind]
        count[region.kind] += 1
        tail = letters(number) if region.kind == "room" else str(number + 1)
        named.append(replace(region, name=f"{region.kind} {tail}"))
    return tuple(named)
