"""Reading images: bytes in, samples out, nothing printed, and never more pixels than the limit.

H, W: rows, columns; C: 1 (grey) or 3 (red, green, blue).  Samples keep the file's 8 or 16 bits.
"""

import contextlib
import hashlib
import os
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError
from qualrl.io.files import read_bytes
from qualrl.io.netpbm import decode_netpbm, netpbm_size

MOST_FILE_BYTES = 1 << 30
MOST_PIXELS = 20_000 * 20_000
KINDS = "PNG, PGM, JPEG, BMP and TIFF"
EXTENSIONS = frozenset({".png", ".pgm", ".ppm", ".pbm", ".pnm", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"})
SAVE_AGAIN = "save it again as PNG or PGM with 8 bits"


@dataclass(frozen=True, eq=False)
class Image:
    """An image as it was stored."""

    samples: NDArray[np.uint8] | NDArray[np.uint16]
    """(H, W, C)."""
    alpha: NDArray[np.uint8] | NDArray[np.uint16] | None
    """(H, W), 0 = transparent; None for an image without alpha."""
    sha256: str = ""
    """SHA-256 of the file's bytes."""

    @property
    def top(self) -> int:
        """The greatest sample: 255 or 65535."""
        return int(np.iinfo(self.samples.dtype).max)

    def grey(self) -> NDArray[np.uint8]:
        """(H, W) 8-bit grey: Rec. 601 luma, in the whole-number arithmetic of GraphicsMagick."""
        if self.samples.shape[2] == 1:
            return self.in_8_bits().samples[:, :, 0].astype(np.uint8, copy=False)
        red, green, blue = (self.samples[:, :, channel].astype(np.uint32) for channel in range(3))
        luma = (306 * red + 601 * green + 117 * blue) // 1024
        return (luma // (self.top // 255)).astype(np.uint8)

    def in_8_bits(self) -> "Image":
        """The same image with 16-bit samples divided down."""
        if self.top == 255:
            return self
        alpha = None if self.alpha is None else (self.alpha // 257).astype(np.uint8)
        return Image((self.samples // 257).astype(np.uint8), alpha, self.sha256)


def read_image(path: Path, source: str | None = None) -> Image:
    """Read an image file; ``source`` is what error messages call it. Raises MapError with one line."""
    source = str(path) if source is None else source
    return decode_image(read_bytes(path, what="map", most_bytes=MOST_FILE_BYTES, error=MapError), source)


def decode_image(data: bytes, source: str) -> Image:
    """The image in a file's bytes."""
    kind = image_kind(data)
    if kind is None:
        what = "the file is empty" if not data else f"not an image that can be read ({KINDS})"
        raise MapError(f"{source}: {what}; {SAVE_AGAIN}")
    _check_size(kind, data, source)
    try:
        pixels = decode_netpbm(data, source) if kind == "Netpbm" else _decode_quietly(data)
    except MemoryError:
        raise MapError(f"{source}: the image does not fit into memory; make it smaller") from None
    if pixels is None:
        raise MapError(f"{source}: the {kind} image is damaged or cut off; copy the file again, or {SAVE_AGAIN}")
    return _split(pixels, kind, hashlib.sha256(data).hexdigest(), source)


def image_kind(data: bytes) -> str | None:
    """What the first bytes say: "PNG", "JPEG", "BMP", "TIFF", "Netpbm", or None for no image."""
    if data[:1] == b"P" and data[1:2] in (b"1", b"2", b"3", b"4", b"5", b"6") and data[2:3].isspace():
        return "Netpbm"
    starts = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"BM": "BMP", b"II*\0": "TIFF", b"MM\0*": "TIFF"}
    return next((kind for start, kind in starts.items() if data.startswith(start)), None)


def _check_size(kind: str, data: bytes, source: str) -> None:
    """Refuse by the header alone, before anything is unpacked."""
    sizes = {"PNG": _png_size, "JPEG": _jpeg_size, "BMP": _bmp_size, "TIFF": _tiff_size, "Netpbm": netpbm_size}
    try:
        size = sizes[kind](data)
    except (struct.error, IndexError):
        size = None
    if size is None:
        raise MapError(f"{source}: the {kind} image is damaged or cut off; copy the file again, or {SAVE_AGAIN}")
    width, height = size
    if width < 1 or height < 1:
        raise MapError(f"{source}: the image has no pixels ({width} x {height}); {SAVE_AGAIN}")
    if width * height > MOST_PIXELS:
        raise MapError(
            f"{source}: {width} x {height} pixels are more than the {MOST_PIXELS:,} that can be read; make it smaller"
        )


def _png_size(data: bytes) -> tuple[int, int] | None:
    width, height = struct.unpack_from(">II", data, 16)
    return (width, height) if data[12:16] == b"IHDR" else None


def _bmp_size(data: bytes) -> tuple[int, int]:
    (header_bytes,) = struct.unpack_from("<I", data, 14)
    width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", data, 18)
    return width, abs(height)  # negative: the first row is the top row


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """From the start of frame; None also when no end of image follows, as OpenCV invents the missing rows."""
    size, at = None, 2
    while True:
        while data[at] == 0xFF:
            at += 1
        marker = data[at]
        (length,) = struct.unpack_from(">H", data, at + 1)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 4)
            size = (width, height)
        if marker == 0xDA:
            return size if data.find(b"\xff\xd9", at) >= 0 else None
        at += 1 + length
        if data[at] != 0xFF or length < 2:
            return None


def _tiff_size(data: bytes) -> tuple[int, int] | None:
    order = "<" if data[:2] == b"II" else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    (entries,) = struct.unpack_from(order + "H", data, directory)
    found = {}
    for at in range(directory + 2, directory + 2 + 12 * entries, 12):
        tag, kind, _, value = struct.unpack_from(order + "HHII", data, at)
        found[tag] = value if kind == 4 else struct.unpack_from(order + "H", data, at + 8)[0]
    return (found[256], found[257]) if 256 in found and 257 in found else None


def _decode_quietly(data: bytes) -> NDArray[Any] | None:
    import cv2  # 0.2 s, so only when an image is read

    with _silence():
        try:
            return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            return None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """No standard error: OpenCV's decoders write there in C, past sys.stderr and past OpenCV's own log level."""
    try:
        sys.stderr.flush()
        kept = os.dup(2)
    except (OSError, ValueError, AttributeError):  # no standard error to begin with
        yield
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        os.close(nowhere)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _split(pixels: NDArray[Any], kind: str, sha256: str, source: str) -> Image:
    """Samples and alpha of what OpenCV decoded (blue, green, red) or netpbm did (red, green, blue)."""
    if pixels.dtype not in (np.uint8, np.uint16):
        raise MapError(f"{source}: has samples of type {pixels.dtype}, expected 8 or 16 bits; {SAVE_AGAIN}")
    if pixels.ndim == 2:
        return Image(pixels[:, :, None], None, sha256)
    channels = pixels.shape[2]
    if channels > 4:
        raise MapError(f"{source}: has {channels} channels, expected grey or colour; {SAVE_AGAIN}")
    colour = pixels[:, :, :1] if channels < 3 else pixels[:, :, :3] if kind == "Netpbm" else pixels[:, :, 2::-1]
    alpha = pixels[:, :, channels - 1] if channels in (2, 4) else None
    if kind == "BMP" and alpha is not None and not alpha.any():
        alpha = None  # most writers leave the fourth byte of a BMP pixel unused
    return Image(colour, alpha, sha256)
