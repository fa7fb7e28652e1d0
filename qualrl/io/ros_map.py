"""ROS maps: a YAML file with the scale and the thresholds, and the image it names.

Fields are those of Nav2's map_server; keys that it does not know are ignored, as Nav2 does.
The origin's yaw is kept, though Nav2's costmaps ignore it.
"""

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError, shown
from qualrl.io.images import Image, read_image
from qualrl.io.positioned_yaml import PositionedYaml, read_scalar, read_yaml
from qualrl.io.ros_arithmetic import MODES, RosSettings, occupancy
from qualrl.spatial.occupancy_grid import OccupancyGrid

REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
YES_NO = {"y": True, "yes": True, "true": True, "on": True, "n": False, "no": False, "false": False, "off": False}
UNKNOWN_GREY = 205
"""What map_saver writes for unknown."""


@dataclass(frozen=True)
class RosMap:
    """The content of a map YAML."""

    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    settings: RosSettings
    warnings: tuple[str, ...]


def read_ros_map(path: str | Path, dialect: str = "nav2") -> OccupancyGrid:
    """Read a map YAML and its image. Raises MapError with one line for each problem."""
    said = read_map_yaml(path)
    return grid_from_image(
        read_image(said.image), said.settings, said.resolution_m, said.origin, dialect, str(path), said.warnings
    )


def read_map_yaml(path: str | Path) -> RosMap:
    """Read and check a map YAML; its image must exist but is not read."""
    content = read_yaml(path, what="map", error=MapError)
    if not isinstance(content.data, dict):
        raise MapError(content.line((), f"expected a map YAML with keys {', '.join(REQUIRED)}"))
    fields = _Fields(content, content.data)
    resolution_m = fields.checked("resolution", _number)
    origin = fields.checked("origin", _origin)
    settings = RosSettings(
        occupied_thresh=fields.checked("occupied_thresh", _number) or 0.0,
        free_thresh=fields.checked("free_thresh", _number) or 0.0,
        negate=bool(fields.checked("negate", _yes_or_no)),
        mode=fields.checked("mode", _mode) if "mode" in content.data else "trinary",
    )
    image, moved = fields.image_path(Path(path))
    fields.check_ranges(resolution_m, settings)
    if fields.problems:
        raise MapError("\n".join(what for _, what in sorted(fields.problems)))
    return RosMap(image, resolution_m, origin, settings, (*fields.misspelled(), *moved))


def grid_from_image(
    image: Image,
    settings: RosSettings,
    resolution_m: float,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    dialect: str = "nav2",
    source: str = "",
    warnings: tuple[str, ...] = (),
) -> OccupancyGrid:
    """The grid that an image stands for, with warnings about what is odd in it."""
    values = occupancy(image, settings, dialect)
    free, occupied = values == 0, values == 100
    if not free.any():
        raise MapError(f"{source}: no pixel is free; {_why_none_free(image, settings)}")
    odd = _oddities(image, values, settings)
    return OccupancyGrid(free, occupied, resolution_m, origin, source, image.sha256, (*warnings, *odd))


class _Fields:
    """Reads fields of a map YAML and collects what is wrong with them, with positions."""

    def __init__(self, content: PositionedYaml, data: dict[str, object]) -> None:
        self.content = content
        self.data = data
        self.problems: list[tuple[tuple[int, int], str]] = []
        for key in REQUIRED:
            if key not in data:
                self.add((), f"{key}: missing; {self._meant(key)}")

    def add(self, path: tuple[str, ...], what: str) -> None:
        self.problems.append((self.content.position(path), self.content.line(path, what)))

    def checked(self, key: str, read: Callable[[object], Any]) -> Any:
        """The value of a field, or None when it is missing or wrong."""
        if key not in self.data:
            return None
        try:
            return read(self.data[key])
        except ValueError as problem:
            self.add((key,), f"{key}: {problem}, got {shown(self.data[key])}")
            return None

    def check_ranges(self, resolution_m: float | None, settings: RosSettings) -> None:
        if resolution_m is not None and resolution_m <= 0:
            self.add(("resolution",), f"resolution: must be above 0 metres a pixel, got {resolution_m:g}")
        readable = not self.problems and settings.mode != "raw"  # raw ignores the thresholds
        if readable and settings.free_thresh >= settings.occupied_thresh:
            what = f"must be below occupied_thresh ({settings.occupied_thresh:g}), got {settings.free_thresh:g}"
            self.add(("free_thresh",), f"free_thresh: {what}")

    def image_path(self, yaml_path: Path) -> tuple[Path, tuple[str, ...]]:
        """Where the image lies, and a warning when that is not where the YAML says."""
        name = self.data.get("image")
        if "image" not in self.data or not isinstance(name, str) or not name:
            if "image" in self.data:
                self.add(("image",), f"image: must be the path of an image, got {shown(name)}")
            return yaml_path, ()
        said, beside = yaml_path.parent / name, yaml_path.parent / PureWindowsPath(name).name
        if _is_file(said):
            return said, ()
        elsewhere = Path(name).is_absolute() or PureWindowsPath(name).is_absolute()
        if elsewhere and _is_file(beside):
            return beside, (f"image {name} does not exist; {beside}, of the same name, was read instead",)
        self.add(("image",), f"image: no such file: {shown(str(said), 300)}; correct the path or copy the image there")
        return said, ()

    def misspelled(self) -> tuple[str, ...]:
        """Warnings about unknown keys that come close to the one optional key."""
        if "mode" in self.data:
            return ()
        near = difflib.get_close_matches("mode", [key for key in self.data if key not in REQUIRED], cutoff=0.7)
        return tuple(self.content.line((key,), f"{key!r} is ignored; was 'mode' meant?", of_key=True) for key in near)

    def _meant(self, key: str) -> str:
        unknown = [other for other in self.data if other not in (*REQUIRED, "mode")]
        near = difflib.get_close_matches(key, unknown, n=1, cutoff=0.7)
        if near:
            return f"rename {near[0]!r} in line {self.content.position((near[0],), of_key=True)[0]}"
        scenario = key == "image" and {"map", "goal"} & self.data.keys()
        return "is this a scenario, not a map?" if scenario else f"add a line '{key}: ...'"


def _number(value: object) -> float:
    """A finite number, also in quotes, as yaml-cpp takes it."""
    plain = read_scalar(value) if isinstance(value, str) else value
    if not isinstance(plain, int | float) or isinstance(plain, bool):
        raise ValueError("must be a number")
    try:
        number = float(plain)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("must be a finite number")
    return number


def _origin(value: object) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError("must be three numbers [x, y, yaw] in metres and radians")
    try:
        x_m, y_m, yaw_rad = map(_number, value)
    except ValueError:
        raise ValueError("must be three finite numbers [x, y, yaw] in metres and radians") from None
    return x_m, y_m, yaw_rad


def _yes_or_no(value: object) -> bool:
    """A whole number or one of YAML 1.1's words, as Nav2 takes it."""
    word = str(value).lower() if isinstance(value, str | bool) else ""
    if word in YES_NO:
        return YES_NO[word]
    plain = read_scalar(value) if isinstance(value, str) else value
    if isinstance(plain, int):
        return plain != 0
    raise ValueError("must be 0, 1, true or false")


def _mode(value: object) -> str:
    if isinstance(value, str) and value.lower() in MODES:
        return value.lower()
    raise ValueError(f"must be one of {', '.join(MODES)}")


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a NUL character
        return False


def _why_none_free(image: Image, settings: RosSettings) -> str:
    """What to change when the thresholds leave no free pixel."""
    grey = image.grey()
    if settings.mode == "raw":
        return f"in raw mode free is grey 0, and the greys go from {grey.min()} to {grey.max()}; is mode right?"
    lightest = int(grey.min() if settings.negate else grey.max())
    p = lightest / 255 if settings.negate else 1 - lightest / 255
    which = "darkest" if settings.negate else "lightest"
    hint = "is alpha or negate wrong?" if p < settings.free_thresh else "raise free_thresh or change negate"
    return f"the {which} grey is {lightest}, occupancy {p:.3f}, and free_thresh is {settings.free_thresh:g}; {hint}"


def _oddities(image: Image, values: NDArray[np.int8], settings: RosSettings) -> tuple[str, ...]:
    """One line for each thing that the user should look at."""
    odd = []
    for name in ("occupied_thresh", "free_thresh"):
        threshold = getattr(settings, name)
        if not 0 <= threshold <= 1 and settings.mode != "raw":
            odd.append(f"{name} is {threshold:g}, but occupancy goes from 0 to 1")
    if settings.mode != "raw" and ((image.grey() == UNKNOWN_GREY) & (values == 0)).any():
        low = settings.free_thresh < 1 - UNKNOWN_GREY / 255  # then only the rounding of mode scale makes it free
        advice = "use mode trinary" if low else f"set free_thresh to 0.196 (it is {settings.free_thresh:g})"
        odd.append(f"grey {UNKNOWN_GREY}, which map_saver writes for unknown, counts as free; {advice}")
    between = np.count_nonzero((values > 0) & (values < 100))
    if between:
        odd.append(f"{between:,} cells are between free and occupied (mode {settings.mode}); they count as unknown")
    unknown = np.count_nonzero((values != 0) & (values != 100)) / values.size
    if unknown > 0.5:
        odd.append(f"{unknown:.0%} of the map is unknown, where no robot may stand")
    return tuple(odd)
