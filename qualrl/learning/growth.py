"""The record of how a robot came to know its map."""

from dataclasses import dataclass

from qualrl.spatial.region_map import RegionMap


@dataclass(frozen=True)
class Stage:
    """The map as known when its regions were found anew."""

    steps: int
    """Steps made before."""
    episode: int
    """Episodes over before."""
    known_cells: int
    """Free cells known."""
    regions: int
    doorways: int
    landmarks: int
    knows_goal: bool
    """Whether the goal was seen."""


@dataclass(frozen=True, eq=False)
class Growth:
    """All stages, and the map as known in the end."""

    stages: tuple[Stage, ...]
    free_cells: int
    """Free cells of the whole map."""
    regions: RegionMap
    """Cells not seen are unknown here."""
    snapshots: tuple[RegionMap, ...]
    """The map at a few of the stages, from one to the next about twice as large."""
