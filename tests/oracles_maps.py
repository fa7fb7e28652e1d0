"""Slow twins of the map readers' arithmetic: one pixel at a time, in plain Python.

Written from the formulas of ROS's map servers, without NumPy: 32-bit floats are made with ``struct``.
"""

import cmath
import math
import struct
from collections.abc import Sequence
from fractions import Fraction


def f32(number: float) -> float:
    """The nearest 32-bit float."""
    return float(struct.unpack("f", struct.pack("f", number))[0])


def luma(red: int, green: int, blue: int) -> int:
    """Rec. 601 in whole numbers."""
    return (306 * red + 601 * green + 117 * blue) >> 10


def nav2_value(v: int, alpha: int, mode: str, negate: bool, occupied_thresh: float, free_thresh: float) -> int:
    """What Nav2 (jazzy and later) makes of an 8-bit grey and alpha."""
    if mode == "raw":
        return v if v <= 100 else -1
    if alpha < 255:
        return -1
    share = f32(v / 255)
    p = share if negate else f32(1 - share)
    occupied_from, free_to = f32(occupied_thresh), f32(free_thresh)
    if p <= free_to:
        return 0
    if p >= occupied_from:
        return 100
    if mode == "trinary":
        return -1
    percent = f32(f32(f32(p - free_to) / f32(occupied_from - free_to)) * 100)
    return math.floor(Fraction(percent) + Fraction(1, 2))


def humble_value(
    rgb: Sequence[int], alpha: int | None, mode: str, negate: bool, occupied_thresh: float, free_thresh: float
) -> int:
    """What Nav2 in humble makes of 8-bit colours; alpha None for an image without."""
    channels = [*rgb, alpha] if mode == "trinary" and alpha is not None else list(rgb)
    shade = sum(channels) / len(channels) / 255
    p = shade if negate else 1 - shade
    if mode == "raw":
        level = math.floor(shade * 255 + 0.5)
        return level if level <= 100 else -1
    if mode == "scale" and alpha is not None and alpha < 255:
        return -1
    if p > occupied_thresh:
        return 100
    if p < free_thresh:
        return 0
    return -1 if mode == "trinary" else round((p - free_thresh) / (occupied_thresh - free_thresh) * 100)


def ros1_value(
    rgb: Sequence[int], alpha: int | None, mode: str, negate: bool, occupied_thresh: float, free_thresh: float
) -> int:
    """What ROS 1's map_server makes of 8-bit colours; alpha None for an image without."""
    channels = [*rgb, alpha] if mode == "trinary" and alpha is not None else list(rgb)
    average = sum(channels) / len(channels)
    if negate:
        average = 255 - average
    if mode == "raw":
        return int(average) if int(average) <= 100 else -1
    p = (255 - average) / 255
    if p > occupied_thresh:
        return 100
    if p < free_thresh:
        return 0
    if mode == "trinary" or alpha == 0:
        return -1
    ratio = (p - free_thresh) / (occupied_thresh - free_thresh)
    return int(1 + 98 * ratio)


def world_of_pixel(
    row: float, column: float, height: int, resolution_m: float, origin: tuple[float, float, float]
) -> complex:
    """World x + iy of a pixel's centre: the pixel of the unturned map, turned and moved."""
    x_m, y_m, yaw_rad = origin
    unturned = complex((column + 0.5) * resolution_m, (height - 1 - row + 0.5) * resolution_m)
    return complex(x_m, y_m) + unturned * cmath.exp(1j * yaw_rad)
