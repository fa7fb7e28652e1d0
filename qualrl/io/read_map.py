"""One way in for every kind of map file."""

import math
from pathlib import Path

from qualrl.errors import MapError, SettingError, did_you_mean
from qualrl.io.files import read_bytes
from qualrl.io.images import EXTENSIONS, KINDS, MOST_FILE_BYTES, decode_image, image_kind
from qualrl.io.moving_ai import parse_moving_ai
from qualrl.io.ros_arithmetic import DIALECTS, RosSettings
from qualrl.io.ros_map import grid_from_image, read_ros_map
from qualrl.spatial.occupancy_grid import OccupancyGrid

RESOLUTION_M = 0.05
"""Assumed for an image alone: what most robots map with."""


def read_map(path: str | Path, *, resolution_m: float | None = None, dialect: str = "nav2") -> OccupancyGrid:
    """Read a ROS map YAML, an image alone, or a MovingAI map.

    resolution_m: side of a cell where the file does not say (images: 0.05, MovingAI: 1).
    dialect: whose arithmetic turns grey into free and occupied: "nav2", "humble" or "ros1".
    Raises MapError, with what is wrong where.
    """
    if dialect not in DIALECTS:
        raise SettingError(f"unknown dialect {dialect!r}; {did_you_mean(dialect, DIALECTS)}")
    if resolution_m is not None and not (math.isfinite(resolution_m) and resolution_m > 0):
        raise SettingError(f"resolution_m must be above 0, got {resolution_m}")
    file = Path(path)
    extension = file.suffix.lower()
    if extension in (".yaml", ".yml"):
        if resolution_m is not None:
            raise SettingError(f"{path}: a map YAML says its resolution itself; leave resolution_m out")
        return read_ros_map(path, dialect)
    data = read_bytes(file, what="map", most_bytes=MOST_FILE_BYTES, error=MapError)
    if image_kind(data) or extension in EXTENSIONS:
        return _read_lone_image(data, path, resolution_m, dialect)
    if extension == ".map" or data.startswith(b"type "):
        return parse_moving_ai(data, str(path), 1.0 if resolution_m is None else resolution_m)
    raise MapError(f"{path}: not a map that can be read; give a ROS map YAML, an image ({KINDS}) or a MovingAI .map")


def _read_lone_image(data: bytes, path: str | Path, resolution_m: float | None, dialect: str) -> OccupancyGrid:
    settings = RosSettings()
    metres = RESOLUTION_M if resolution_m is None else resolution_m
    scale = f"{metres:g} m a pixel and " if resolution_m is None else ""
    beside = [f for f in (Path(path).with_suffix(ending) for ending in (".yaml", ".yml")) if f.is_file()]
    hint = f"; {beside[0]} lies beside it, read that to use its settings" if beside else ""
    note = (
        f"an image without a map YAML: assumed {scale}thresholds "
        f"{settings.occupied_thresh:g} (occupied) and {settings.free_thresh:g} (free){hint}"
    )
    image = decode_image(data, str(path))
    return grid_from_image(image, settings, metres, dialect=dialect, source=str(path), warnings=(note,))
