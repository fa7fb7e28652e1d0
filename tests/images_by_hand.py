"""Image files written byte by byte, so that tests know what is in them."""

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray


def pgm(grey: NDArray[np.uint8]) -> bytes:
    return b"P5\n# a comment\n%d %d\n255\n" % grey.shape[::-1] + grey.tobytes()


def png(samples: NDArray[Any], colour: int, depth: int = 8, more: bytes = b"") -> bytes:
    """A PNG file by hand; samples (H, bytes a row), already packed."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    width = samples.shape[1] * 8 // (depth * channels)
    rows = b"".join(b"\0" + row.tobytes() for row in samples)
    header = struct.pack(">IIBBBBB", width, samples.shape[0], depth, colour, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + more + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    )
