"""Netpbm images (PBM, PGM, PPM; text or binary), what ROS writes maps as.

Read here and not by OpenCV, which ignores the greatest value that the header names.
"""

import re

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError

GAP = rb"(?:\s|#[^\n]*\n)+"
SIZE = re.compile(rb"P([1-6])" + GAP + rb"(\d{1,9})" + GAP + rb"(\d{1,9})")
GREATEST = re.compile(GAP + rb"(\d{1,9})")

Samples = NDArray[np.uint8] | NDArray[np.uint16]


def netpbm_size(data: bytes) -> tuple[int, int] | None:
    """(width, height), or None when the header is damaged."""
    header = SIZE.match(data)
    return (int(header[2]), int(header[3])) if header else None


def decode_netpbm(data: bytes, source: str) -> Samples:
    """(H, W) grey or (H, W, 3) red, green, blue; 8 bits, or 16 when the file's greatest value needs them."""
    header = SIZE.match(data)
    if header is None:
        raise MapError(f"{source}: the header of the Netpbm image is damaged; expected 'P5 WIDTH HEIGHT 255'")
    kind, width, height = (int(number) for number in header.groups())
    start, greatest = header.end(), 1
    if kind not in (1, 4):
        match = GREATEST.match(data, start)
        if match is None or not 1 <= int(match[1]) <= 65535:
            raise MapError(f"{source}: the Netpbm header needs a greatest value from 1 to 65535 after the size")
        start, greatest = match.end(), int(match[1])
    shape = (height, width, 3) if kind in (3, 6) else (height, width)
    if kind == 4:
        return np.where(_packed_bits(data[start + 1 :], height, width, source), 0, 255).astype(np.uint8)
    wanted = int(np.prod(shape))
    values = _text(data[start:], kind, source) if kind <= 3 else _binary(data[start + 1 :], greatest, wanted)
    if values.size < wanted:
        raise MapError(f"{source}: the image is cut off: {values.size:,} of {wanted:,} samples; copy the file again")
    values = values[:wanted].reshape(shape)
    return np.where(values, 0, 255).astype(np.uint8) if kind == 1 else _scaled(values, greatest)


def _packed_bits(data: bytes, height: int, width: int, source: str) -> NDArray[np.bool_]:
    row_bytes = (width + 7) // 8
    if len(data) < height * row_bytes:
        raise MapError(f"{source}: the image is cut off: {len(data):,} of {height * row_bytes:,} bytes of pixels")
    packed = np.frombuffer(data, np.uint8, height * row_bytes).reshape(height, row_bytes)
    return np.unpackbits(packed, axis=1, count=width).astype(np.bool_)


def _binary(data: bytes, greatest: int, wanted: int) -> NDArray[np.uint32]:
    kind = np.dtype(np.uint8 if greatest < 256 else ">u2")
    return np.frombuffer(data, kind, min(wanted, len(data) // kind.itemsize)).astype(np.uint32)


def _text(data: bytes, kind: int, source: str) -> NDArray[np.uint32]:
    text = re.sub(rb"#[^\n]*", b"", data)
    words = [bytes([digit]) for digit in text if digit in b"01"] if kind == 1 else text.split()
    try:
        return np.array([int(word) for word in words], np.uint32)
    except (ValueError, OverflowError):
        raise MapError(f"{source}: the pixels of this text image must be whole numbers from 0") from None


def _scaled(values: NDArray[np.uint32], greatest: int) -> Samples:
    values = np.minimum(values, greatest)
    if greatest < 256:
        return ((values * 255 + greatest // 2) // greatest).astype(np.uint8)
    return ((values.astype(np.uint64) * 65535 + greatest // 2) // greatest).astype(np.uint16)
