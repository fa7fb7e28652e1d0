"""The sections ``zones`` and ``distance`` of a scenario: parts of the map with names, and what near and far mean.

A zone is drawn as a polygon, whose corners are (x, y) in metres, or as an image as large as the map's.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainSerializer, PlainValidator, WithJsonSchema, model_validator

from qualrl.errors import MapError, PlaceError, did_you_mean, shown
from qualrl.io.scenario_learn import Strict
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.occupancy_grid import FARTHEST
from qualrl.spatial.zones import MOST_CORNERS, zone_of_cells, zone_within

if TYPE_CHECKING:
    from qualrl.spatial.region_map import RegionMap
    from qualrl.spatial.zones import Zone

EXPECTED = "corners [[x, y], ...] in metres, or {image: FILE}"
SIDES = ("dark", "light")
CUTS = DistanceCuts()


@dataclass(frozen=True)
class Outline:
    """A zone as a polygon."""

    corners: tuple[tuple[float, float], ...]

    def on(self, regions: "RegionMap", name: str, folder: Path) -> "Zone":
        """The zone on a map; PlaceError."""
        return zone_within(name, self.corners, regions)

    def plain(self) -> list[list[float]]:
        """As a scenario holds it."""
        return [list(corner) for corner in self.corners]


@dataclass(frozen=True)
class MaskImage:
    """A zone as an image, relative to the scenario's file."""

    image: str
    inside: str = "dark"
    """Which pixels belong to it: those darker than middle grey, as in masks of ROS, or the lighter ones.  Transparent
    pixels never do."""

    def on(self, regions: "RegionMap", name: str, folder: Path) -> "Zone":
        """The zone on a map; PlaceError or MapError."""
        return zone_of_cells(name, self.pixels(folder / self.image), regions)

    def pixels(self, file: Path) -> NDArray[np.bool_]:
        """(H, W) which pixels belong to it."""
        from qualrl.io.images import read_image

        image = read_image(file).in_8_bits()
        is_dark = image.grey() < 128
        inside = is_dark if self.inside == "dark" else ~is_dark
        return inside if image.alpha is None else inside & (image.alpha >= 128)

    def plain(self) -> dict[str, str]:
        """As a scenario holds it."""
        return vars(self).copy()


def _zone(value: object) -> Outline | MaskImage:
    if isinstance(value, Outline | MaskImage):
        return value
    if isinstance(value, dict):
        return _mask_image(value)
    if not isinstance(value, list):
        raise ValueError(f"must be {EXPECTED}, got {shown(value)}")
    if not 3 <= len(value) <= MOST_CORNERS:
        raise ValueError(f"a polygon has 3 to {MOST_CORNERS} corners, got {len(value)}")
    return Outline(tuple(_corner(corner, number) for number, corner in enumerate(value, 1)))


def _corner(value: object, number: int) -> tuple[float, float]:
    numbers = [part for part in value if type(part) in (int, float)] if isinstance(value, list) else []
    if value != numbers or len(numbers) != 2 or not all(abs(part) <= FARTHEST for part in numbers):
        raise ValueError(f"corner {number} must be [x, y] in metres, numbers up to {FARTHEST:g}, got {shown(value)}")
    return float(numbers[0]), float(numbers[1])


def _mask_image(value: dict[str, object]) -> MaskImage:
    for key in value:
        if key not in ("image", "inside"):
            raise ValueError(f"unknown key {shown(key)}; {did_you_mean(str(key), ('image', 'inside'))}")
    image, inside = value.get("image"), value.get("inside", "dark")
    if not isinstance(image, str) or not image:
        raise ValueError(f"image must be the name of a file, got {shown(image)}")
    if not isinstance(inside, str) or inside not in SIDES:
        raise ValueError(f"inside must be dark or light (the pixels that belong to the zone), got {shown(inside)}")
    return MaskImage(image, inside)


ZONE_SCHEMA: dict[str, Any] = {
    "anyOf": [
        {
            "type": "array", "minItems": 3, "maxItems": MOST_CORNERS,
            "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
        },
        {
            "type": "object", "required": ["image"], "additionalProperties": False,
            "properties": {"image": {"type": "string", "minLength": 1}, "inside": {"enum": list(SIDES)}},
        },
    ]
}  # fmt: skip
ZoneField = Annotated[
    Outline | MaskImage, PlainValidator(_zone), PlainSerializer(lambda zone: zone.plain()), WithJsonSchema(ZONE_SCHEMA)
]


class DistanceSettings(Strict):
    """What near and far mean."""

    near_m: float = Field(default=CUTS.near_m, gt=0, description="near is up to so many metres of walking")
    far_m: float = Field(default=CUTS.far_m, gt=0, description="far is more; medium is between")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.near_m < self.far_m < math.inf:
            raise ValueError(f"near_m must be less than far_m, got near_m {self.near_m:g}, far_m {self.far_m:g}")
        return self

    @property
    def cuts(self) -> DistanceCuts:
        """As relations take them."""
        return DistanceCuts(self.near_m, self.far_m)


def zone_on(regions: "RegionMap", name: str, drawn: Outline | MaskImage, folder: Path) -> "Zone":
    """A zone of a scenario on its map.  Raises PlaceError, that begins with what is wrong of it."""
    try:
        return drawn.on(regions, name, folder)
    except MapError as problem:
        raise PlaceError(f"the image of the zone cannot be used: {problem}") from None
