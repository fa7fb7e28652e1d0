"""Which thresholds or mode of a ROS map would open a way that there is not.

A map's file is read again; its thresholds are tried to four decimals, which tells any two 8-bit greys apart.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.blocked import Blocked
from qualrl.answers.openings import OtherThresholds, first_to_open
from qualrl.errors import MapError
from qualrl.io.files import read_bytes
from qualrl.io.images import MOST_FILE_BYTES, Image, decode_image, image_kind, read_image
from qualrl.io.ros_arithmetic import DIALECTS, MODES, RosSettings, occupancy
from qualrl.io.ros_map import read_map_yaml
from qualrl.spatial.occupancy_grid import OccupancyGrid

Free = Callable[[RosSettings], NDArray[np.bool_]]
"""(H, W) the free cells of a map under other settings."""
DECIMALS = 4
PARTS = 10**DECIMALS


def other_thresholds(blocked: Blocked) -> tuple[tuple[OtherThresholds, ...], str]:
    """The least free_thresh, or another mode if that changes fewer cells, under which there is a way; or why none.

    Thresholds below 1 are tried: at 1 all of a map is free.  The mode is tried with the thresholds as they are.
    """
    try:
        image, settings, dialect = _as_read(blocked.grid)
    except MapError as problem:
        return (), f"The thresholds of the map were not tried: {problem}."

    def free(changed: RosSettings) -> NDArray[np.bool_]:
        return np.asarray(occupancy(image, changed, dialect) == 0)

    found = [_opening(blocked, settings, changed, free(changed)) for changed in _least(blocked, settings, free)]
    modes = [(mode, free(mode)) for mode in _modes(settings)]
    found += [_opening(blocked, settings, *mode) for mode in modes if blocked.steps(blocked.standing(mode[1])) >= 0]
    nearest = min(found, key=lambda opening: opening.freed.total + opening.lost, default=None)
    if nearest is None:
        return (), "No threshold below 1 and no mode of the map would open a way."
    return (nearest,), ""


def _as_read(grid: OccupancyGrid) -> tuple[Image, RosSettings, str]:
    """A map's image, settings and dialect; raises MapError for one without, or that is not as it was."""
    image, settings = _file_of(grid.source)
    map_free = grid.free if grid.tight is None else grid.free | grid.tight
    for dialect in DIALECTS:
        values = occupancy(image, settings, dialect)
        if np.array_equal(values == 0, map_free) and np.array_equal(values == 100, grid.occupied):
            return image, settings, dialect
    raise MapError(f"{grid.source} has changed since it was read")


def _file_of(source: str) -> tuple[Image, RosSettings]:
    if not source:
        raise MapError("it was made in memory")
    if Path(source).suffix.lower() in (".yaml", ".yml"):
        said = read_map_yaml(source)
        return read_image(said.image), said.settings
    data = read_bytes(Path(source), what="map", most_bytes=MOST_FILE_BYTES, error=MapError)
    if image_kind(data) is None:
        raise MapError(f"{source} is no ROS map or image, so it has none")
    return decode_image(data, source), RosSettings()


def _least(blocked: Blocked, settings: RosSettings, free: Free) -> list[RosSettings]:
    """The settings with the least free_thresh under which there is a way, in as few decimals as do; one or none."""
    if settings.mode == "raw":
        return []
    first = math.floor(max(settings.free_thresh, 0.0) * PARTS) + 1

    def opens(more: int) -> bool:
        return blocked.steps(blocked.standing(free(_raised(settings, (first + more) / PARTS)))) >= 0

    at = first_to_open(PARTS - first, opens)
    if at is None:
        return []
    exact = _raised(settings, (first + at) / PARTS)
    units = (10**decimals for decimals in range(2, DECIMALS))
    shorter = [_raised(settings, math.ceil(exact.free_thresh * unit) / unit) for unit in units]
    return [next((short for short in shorter if _is_as(short, exact, free)), exact)]


def _is_as(short: RosSettings, exact: RosSettings, free: Free) -> bool:
    return short.free_thresh < 1 and np.array_equal(free(short), free(exact))


def _raised(settings: RosSettings, free_thresh: float) -> RosSettings:
    """The settings with another free_thresh, and occupied_thresh raised as far as it must be above that."""
    if free_thresh < settings.occupied_thresh:
        return replace(settings, free_thresh=free_thresh)
    return replace(settings, free_thresh=free_thresh, occupied_thresh=(math.floor(free_thresh * 100) + 1) / 100)


def _modes(settings: RosSettings) -> list[RosSettings]:
    """The settings with each other mode that goes with the thresholds."""
    ordered = settings.free_thresh < settings.occupied_thresh  # a map of mode raw may say what it likes
    return [replace(settings, mode=mode) for mode in MODES if mode != settings.mode and (ordered or mode == "raw")]


def _opening(
    blocked: Blocked, settings: RosSettings, changed: RosSettings, then_free: NDArray[np.bool_]
) -> OtherThresholds:
    """The record of settings that open a way."""
    standing = blocked.standing(then_free)
    way = blocked.way_changing_least(standing)
    freed = then_free & ~blocked.map_free
    on_way = [cell for cell in way if freed[cell]]
    keys = ("free_thresh", "occupied_thresh", "mode")
    pairs = [(key, getattr(settings, key), getattr(changed, key)) for key in keys]
    return OtherThresholds(
        blocked.steps(standing), way, tuple(pair for pair in pairs if pair[1] != pair[2]), blocked.kinds(freed),
        blocked.kinds(on_way), int(np.count_nonzero(blocked.map_free & ~then_free)),
    )  # fmt: skip
