"""How sets of cells touch, overlap and hold each other: RCC8, each cell taken with its border.

H, W: rows, columns.  Beyond the map nothing belongs to any set.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

RCC8_WORDS = {
    "DC": "apart from", "EC": "touches", "PO": "overlaps", "TPP": "inside", "NTPP": "inside",
    "TPPi": "contains", "NTPPi": "contains", "EQ": "the same as",
}  # fmt: skip
"""The base relations in words; a T says that the borders touch, and NT that they do not."""
AROUND = np.ones((3, 3), np.uint8)

Flags = NDArray[np.bool_]


def rcc8(first: Flags, second: Flags) -> str:
    """The relation of one set of cells (H, W) to another: DC, EC, PO, TPP, NTPP, TPPi, NTPPi or EQ; none is empty."""
    first, second = _cropped(first, second)
    only_first, only_second = bool((first & ~second).any()), bool((second & ~first).any())
    if not only_first and not only_second:
        return "EQ"
    if not (first & second).any():
        return "EC" if (_grown(first) & second).any() else "DC"
    if not only_first:
        return "TPP" if (_grown(first) & ~second).any() else "NTPP"
    if not only_second:
        return "TPPi" if (_grown(second) & ~first).any() else "NTPPi"
    return "PO"


def contacts(label: NDArray[np.int32]) -> set[tuple[int, int]]:
    """Pairs of labels (H, W), the smaller first, with cells that share a side or a corner; -1 is none."""
    found: set[tuple[int, int]] = set()
    for here, there in (
        (label[1:], label[:-1]), (label[:, 1:], label[:, :-1]),
        (label[1:, 1:], label[:-1, :-1]), (label[1:, :-1], label[:-1, 1:]),
    ):  # fmt: skip
        differ = (here != there) & (here >= 0) & (there >= 0)
        pairs = np.sort(np.stack([here[differ], there[differ]], axis=1), axis=1)
        found |= {(int(a), int(b)) for a, b in np.unique(pairs, axis=0)}
    return found


def _cropped(first: Flags, second: Flags) -> tuple[Flags, Flags]:
    """Both, cut to the box around them and one cell more on each side."""
    either = first | second
    spans = [np.flatnonzero(either.any(axis=axis))[[0, -1]].tolist() for axis in (1, 0)]
    (top, bottom), (left, right) = spans
    cut = np.s_[top : bottom + 1, left : right + 1]
    return np.pad(first[cut], 1), np.pad(second[cut], 1)


def _grown(cells: Flags) -> Flags:
    """The cells and all that share a side or a corner with one."""
    return np.asarray(cv2.dilate(cells.view(np.uint8), AROUND), np.bool_)
