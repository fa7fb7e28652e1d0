"""Region labels as a 16-bit PNG: 0 = not free, k = region k, counted from 1."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import OutputError

MOST_REGIONS = 65535


def write_label_image(label: NDArray[np.int32], file: Path) -> None:
    """Write labels (H, W), -1 where not free, as 16-bit PNG.  Raises OutputError for more than 65535 regions."""
    if label.max() >= MOST_REGIONS:
        raise OutputError(f"{file.name}: {label.max() + 1} regions do not fit into 16 bits; raise segment.min_area_m2")
    done, data = cv2.imencode(".png", (label + 1).astype(np.uint16))
    if not done:
        raise OutputError(f"{file.name}: could not be encoded as PNG")
    file.write_bytes(data.tobytes())


def read_label_image(file: Path) -> NDArray[np.int32]:
    """Labels (H, W) as ``write_label_image`` was given them."""
    pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    return pixels.astype(np.int32) - 1
