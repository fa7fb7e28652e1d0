"""From grey to occupancy, with the arithmetic of Nav2's map_server or of its predecessors.

p: occupancy of a pixel from 0 (free) to 1; v: its 8-bit grey.  p = 1 - v/255, or v/255 when ``negate`` is set.
Values are what map_server would publish: -1 unknown, 0 free to 100 occupied; but in image order, (H, W).
Dialects: "nav2" (jazzy and later: 32-bit floats, limits included), "humble" and "ros1" (64-bit, limits excluded).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError, did_you_mean
from qualrl.io.images import Image

DIALECTS = ("nav2", "humble", "ros1")
MODES = ("trinary", "scale", "raw")


@dataclass(frozen=True)
class RosSettings:
    """How grey becomes occupancy; the defaults are those that Nav2's map_saver writes."""

    occupied_thresh: float = 0.65
    free_thresh: float = 0.196
    negate: bool = False
    mode: str = "trinary"


def occupancy(image: Image, settings: RosSettings, dialect: str = "nav2") -> NDArray[np.int8]:
    """(H, W) what map_server publishes for each pixel: -1, or 0 to 100."""
    rules = {"nav2": _nav2, "humble": _humble, "ros1": _ros1}
    if dialect not in rules:
        raise SettingError(f"unknown dialect {dialect!r}; {did_you_mean(dialect, DIALECTS)}")
    return rules[dialect](image, settings)


def _nav2(image: Image, settings: RosSettings) -> NDArray[np.int8]:
    """Whatever is not opaque is unknown, but for raw."""
    grey = image.grey()
    # As the table[grey], which makes eight bytes of each pixel's one first.
    looked_up = bytearray(np.ascontiguousarray(grey)).translate(_nav2_table(settings).tobytes())
    values = np.frombuffer(looked_up, np.int8).reshape(grey.shape)
    if image.alpha is not None and settings.mode != "raw":
        values[image.alpha // (image.top // 255) < 255] = -1
    return values


def _nav2_table(settings: RosSettings) -> NDArray[np.int8]:
    """(256,) value by grey, all in 32-bit floats as Nav2's matrices are."""
    grey = np.arange(256)
    if settings.mode == "raw":
        return np.where(grey <= 100, grey, -1).astype(np.int8)
    p = grey.astype(np.float32) / np.float32(255)
    if not settings.negate:
        p = np.float32(1) - p
    occupied_from, free_to = np.float32(settings.occupied_thresh), np.float32(settings.free_thresh)
    table = np.full(256, -1, np.int8)
    if settings.mode == "scale":
        between = (p > free_to) & (p < occupied_from)
        percent = (p[between] - free_to) / (occupied_from - free_to) * np.float32(100)
        table[between] = np.floor(percent) + (percent - np.floor(percent) >= 0.5)  # halves away from zero
    table[p >= occupied_from] = 100
    table[p <= free_to] = 0
    return table


def _humble(image: Image, settings: RosSettings) -> NDArray[np.int8]:
    """The mean of the colours, in trinary mode also of alpha; in scale mode what is not opaque is unknown."""
    total, count = _sum_of_channels(image, settings)
    shade = np.arange(count * image.top + 1) / count / image.top
    p = shade if settings.negate else 1 - shade
    if settings.mode == "raw":
        level = np.floor(shade * 255 + 0.5)
        return np.where(level <= 100, level, -1).astype(np.int8)[total]
    values = _old_table(p, settings, lambda ratio: np.rint(ratio * 100))[total]
    if image.alpha is not None and settings.mode == "scale":
        values[image.alpha < image.top] = -1
    return values


def _ros1(image: Image, settings: RosSettings) -> NDArray[np.int8]:
    """As humble, but on 8 bits, cutting where humble rounds; only full transparency hides, and only between."""
    image = image.in_8_bits()
    total, count = _sum_of_channels(image, settings)
    level = np.arange(count * 255 + 1) / count
    if settings.negate:
        level = 255 - level
    if settings.mode == "raw":
        return np.where(np.floor(level) <= 100, np.floor(level), -1).astype(np.int8)[total]
    values = _old_table((255 - level) / 255, settings, lambda ratio: np.floor(1 + 98 * ratio))[total]
    if image.alpha is not None and settings.mode == "scale":
        values[(image.alpha == 0) & (values > 0) & (values < 100)] = -1
    return values


def _sum_of_channels(image: Image, settings: RosSettings) -> tuple[NDArray[np.uint32], int]:
    """Red + green + blue of each pixel, in trinary mode also + alpha; and how many were added."""
    total = image.samples.sum(axis=2, dtype=np.uint32) * np.uint32(3 // image.samples.shape[2])
    if image.alpha is None or settings.mode != "trinary":
        return total, 3
    return total + image.alpha, 4


def _old_table(
    p: NDArray[np.float64], settings: RosSettings, scaled: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.int8]:
    """Value by occupancy, in 64-bit floats."""
    table = np.full(p.size, -1, np.int8)
    if settings.mode == "scale":
        between = (p >= settings.free_thresh) & (p <= settings.occupied_thresh)
        ratio = (p[between] - settings.free_thresh) / (settings.occupied_thresh - settings.free_thresh)
        table[between] = scaled(ratio)
    table[p > settings.occupied_thresh] = 100
    table[p < settings.free_thresh] = 0
    return table
