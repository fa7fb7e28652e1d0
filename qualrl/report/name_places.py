"""Where text goes on a map: each name inside its region, widths beside their doors, nothing over anything else.

x, y: pixels from the sheet's top left corner; a "box" is the width and height of a text in pixels.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.labels import boxes
from qualrl.report.lettering import SMALLEST_PX, Lettering
from qualrl.report.sheet import Sheet
from qualrl.spatial.region_map import Region, RegionMap

MOST_NAMES = 5000
"""The largest regions have names; a place for each costs a millisecond or two."""
SPECK_EM = 0.5
"""Furniture smaller than this does not keep names away."""
LARGEST_EM, SIZES = 1.5, 5
"""Names are tried from this many em down to the smallest size that can be read, in so many steps."""
WHOLE_EM = 0.55
"""Where there is a shorter name, the whole one is not set smaller than this: in large pictures it would be lost."""
LONGEST_LETTERS = 3
"""A text of so few letters is never upright: an N would be a Z."""
UPRIGHT_COUNTS = 0.7
"""Upright text is as good as other text of this share of its size."""
GAP_PX = 2
"""Free pixels around a text."""
WHOLE_SHARE, OWN_SHARE = 0.96, 0.7
"""A name lies on its region, but for specks; in one too narrow at least with this share, the rest on walls."""
MOST_WALL = 0.3
"""Text beside a door lies on walls with at most this share, and in line with the wall not at all: black would strike
it through."""

Mask = NDArray[np.bool_]
Box = tuple[float, float]


@dataclass(frozen=True)
class Lettered:
    """A text that has found its place: its middle, size and orientation."""

    text: str
    x: float
    y: float
    size: float
    upright: bool = False


class Room:
    """What of the map's part of a sheet is still free for text."""

    def __init__(self, regions: RegionMap, sheet: Sheet) -> None:
        self.sheet = sheet
        size = (sheet.map_width, sheet.map_height)
        blown = cv2.resize(regions.label[sheet.window], size, interpolation=cv2.INTER_NEAREST_EXACT)
        self.label = np.asarray(blown, np.int32)
        self.taken = np.zeros(self.label.shape, np.bool_)
        """Text and marks that no text may cover."""
        self.marked = np.zeros(self.label.shape, np.bool_)
        """What text had better not cover: landmarks and the path."""

    def mark(self, points: NDArray[np.float64], radius_px: float, hard: bool = False) -> None:
        """Take discs around (N, 2) points x, y."""
        layer = np.zeros(self.label.shape, np.uint8)
        for x, y in self._pixels(points).tolist():
            cv2.circle(layer, (x, y), max(1, round(radius_px)), 1, -1)
        (self.taken if hard else self.marked)[layer > 0] = True

    def mark_lines(self, lines: Sequence[NDArray[np.float64]], radius_px: float, hard: bool = True) -> None:
        """Take lines, each through its (N, 2) points x, y."""
        layer = np.zeros(self.label.shape, np.uint8)
        cv2.polylines(layer, [self._pixels(line) for line in lines], False, 1, max(1, round(2 * radius_px)))
        (self.taken if hard else self.marked)[layer > 0] = True

    def _pixels(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        return np.round(points - (self.sheet.left, self.sheet.top)).astype(np.int32)

    def take(self, x: float, y: float, box: Box) -> None:
        """Take the place of a text with its middle there."""
        self.taken[self._slices(x, y, box)] = True

    def free(self, x: float, y: float, box: Box, on: Sequence[int], most_wall: float, over_marks: bool) -> bool:
        """Whether a text there lies on the map, covers no other, and nothing but those regions and walls.

        most_wall: the share of it that may lie on walls; over_marks: whether it may cover landmarks and the path.
        """
        left, top = x - self.sheet.left - box[0] / 2, y - self.sheet.top - box[1] / 2
        if left < 0 or top < 0 or left + box[0] > self.label.shape[1] or top + box[1] > self.label.shape[0]:
            return False
        at = self._slices(x, y, box)
        covers = self.taken[at].any() or (not over_marks and self.marked[at].any())
        if covers or not np.isin(self.label[at], (-1, *on)).all():
            return False
        return bool((self.label[at] < 0).mean() <= most_wall)

    def _slices(self, x: float, y: float, box: Box) -> tuple[slice, slice]:
        middle = y - self.sheet.top, x - self.sheet.left
        first = [max(0, int(at - side / 2) - GAP_PX) for at, side in zip(middle, box[::-1], strict=True)]
        last = [max(0, int(np.ceil(at + side / 2)) + GAP_PX) for at, side in zip(middle, box[::-1], strict=True)]
        return slice(first[0], last[0]), slice(first[1], last[1])


def place_names(regions: RegionMap, room: Room, letters: Lettering) -> dict[int, Lettered]:
    """A place for the names of regions, by index: the larger regions first, pockets last.

    A name that does not fit is set smaller, in two lines or upright, then shortened (see ``short_names``),
    then left out.
    """
    ends = boxes(room.label, len(regions.regions)).tolist()
    area = np.bincount(room.label[room.label >= 0].ravel(), minlength=len(regions.regions))
    short = short_names(regions.regions)
    order = sorted(range(len(ends)), key=lambda at: (regions.regions[at].kind == "pocket", -area[at], at))
    placed: dict[int, Lettered] = {}
    for index in order:
        if area[index] < SMALLEST_PX**2 or len(placed) == MOST_NAMES:
            continue
        top, bottom, left, right = ends[index]
        box = slice(top, bottom), slice(left, right)
        region = regions.regions[index]
        texts = [region.name] if letters.can_write(region.name) else []
        if region.kind != "pocket" and (not texts or len(short[index]) < len(region.name)):
            texts.append(short[index])
        found = _place(region, index, texts, (box[0], box[1]), room, letters)
        if found is not None:
            placed[index] = found
            width, height = letters.box(found.text, found.size)
            room.take(found.x, found.y, (height, width) if found.upright else (width, height))
    return placed


def _place(
    region: Region, index: int, texts: Sequence[str], box: tuple[slice, slice], room: Room, letters: Lettering
) -> Lettered | None:
    """The first of the texts, ways and sizes that fits, at the clearest spot."""
    spread = int(2 * room.sheet.em)
    top, left = max(0, box[0].start - spread), max(0, box[1].start - spread)
    window = np.s_[top : box[0].stop + spread, left : box[1].stop + spread]
    label, taken = room.label[window], room.taken[window]
    own = _without_specks(label == index, label, round(SPECK_EM * room.sheet.em))
    x, y = room.sheet.at(*region.centre)
    centre = (y - room.sheet.top - top, x - room.sheet.left - left)
    apart = np.asarray(cv2.distanceTransform(np.pad(own, 1).astype(np.uint8), cv2.DIST_L2, 3))[1:-1, 1:-1]
    rows, columns = np.ogrid[: own.shape[0], : own.shape[1]]
    clearness = np.asarray(apart - 0.2 * np.hypot(rows - centre[0], columns - centre[1]), np.float32)
    free = own & ~taken
    usable = (own | (label < 0)) & ~taken
    unmarked = ~room.marked[window]
    fills = [(free & unmarked, WHOLE_SHARE, usable & unmarked), (free, WHOLE_SHARE, usable)]
    if region.kind != "pocket":
        fills.append((free, OWN_SHARE, usable))
    high, wide = box[0].stop - box[0].start, box[1].stop - box[1].start
    for text in texts:
        ways = _ways(text, room.sheet.em, letters)
        least = SMALLEST_PX if text == texts[-1] else max(SMALLEST_PX, WHOLE_EM * room.sheet.em)
        for fill, share, within in fills:
            total = int(fill.sum())
            for size, written, upright, sides in ways:
                if size < least:
                    continue
                # Most ways fail in small regions, and are told by their sizes alone.
                if share < WHOLE_SHARE and size > room.sheet.em:
                    continue  # beyond its region a name had better be small
                if min(total, min(sides[0], wide) * min(sides[1], high)) < share * sides[0] * sides[1]:
                    continue
                spot = _spot(fill, within, share, sides, clearness)
                if spot is not None:
                    at = (room.sheet.left + left + spot[1] + 0.5, room.sheet.top + top + spot[0] + 0.5)
                    return Lettered(written, *at, size, upright)
    return None


def _without_specks(own: Mask, label: NDArray[np.int32], size_px: int) -> Mask:
    """A region with what is neither its own nor another's filled where that is small, as the legs of chairs are."""
    filled = cv2.morphologyEx(own.view(np.uint8), cv2.MORPH_CLOSE, np.ones((size_px, size_px), np.uint8))
    return own | ((filled > 0) & (label < 0))


def _ways(text: str, em: float, letters: Lettering) -> list[tuple[float, str, bool, Box]]:
    """Sizes, from large to small, in one line, in two, and upright, with the box on the sheet.

    Upright text is harder to read: it counts as smaller than it is.
    """
    ways = []
    for size in np.geomspace(max(LARGEST_EM * em, SMALLEST_PX), SMALLEST_PX, SIZES).tolist():
        width, height = letters.box(text, size)
        ways.append((size, text, False, (width, height)))
        if " " in text:
            cut = min((at.start() for at in re.finditer(" ", text)), key=lambda at: abs(at - len(text) / 2))
            folded = f"{text[:cut]}\n{text[cut + 1 :]}"
            ways.append((size, folded, False, letters.box(folded, size)))
        if len(text) > LONGEST_LETTERS:
            ways.append((size, text, True, (height, width)))
    return sorted(ways, key=lambda way: -way[0] * (UPRIGHT_COUNTS if way[2] else 1.0))


def _spot(fill: Mask, usable: Mask, share: float, box: Box, clearness: NDArray[np.float32]) -> tuple[int, int] | None:
    """The clearest (row, column) where the box covers usable pixels only, and of ``fill`` at least that share."""
    across, down = (int(np.ceil(side)) + 2 * GAP_PX | 1 for side in box)  # odd: a box has a middle pixel
    if across > fill.shape[1] or down > fill.shape[0]:
        return None
    fits = _share_of(fill, across, down) > share
    # Beyond the window nothing is known: keep the box inside.
    fits[: down // 2], fits[:, : across // 2] = False, False
    fits[fits.shape[0] - down // 2 :], fits[:, fits.shape[1] - across // 2 :] = False, False
    if fits.any():
        fits &= _share_of(usable, across, down) > 1 - 1e-3
    if not fits.any():
        return None
    best = np.argmax(np.where(fits, clearness, -np.inf))
    return int(best // fits.shape[1]), int(best % fits.shape[1])


def _share_of(mask: Mask, across: int, down: int) -> NDArray[np.float32]:
    """For each pixel, of the box around it the share that the mask covers."""
    shares = cv2.boxFilter(
        mask.view(np.uint8), cv2.CV_32F, (across, down), normalize=True, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(shares, np.float32)


def place_beside(
    text: str, size: float, middle: NDArray[np.float64], reach: NDArray[np.float64], on: Sequence[int],
    room: Room, letters: Lettering, gap_px: float, must: bool = False,
) -> Lettered | None:  # fmt: skip
    """A place for text at the middle of a chord, on either side of it, or beyond its ends; None without room.

    reach: (x, y) from the middle to an end of the chord; on: the regions that the text may lie on; must: rather than
    leave it out, it covers walls, landmarks and the path.
    """
    box = letters.box(text, size)
    length = float(np.hypot(*reach))
    along = reach / length if length > 0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    ways = ((across, 0.0), (-across, 0.0), (along, length), (-along, length))
    for most_wall, over_marks in ((0.0, False), (MOST_WALL, False), *([(1.0, True)] if must else [])):
        for way, start in ways:
            out = start + gap_px + abs(way[0]) * box[0] / 2 + abs(way[1]) * box[1] / 2
            x, y = (middle + way * out).tolist()
            if room.free(x, y, box, on, 0.0 if start and not must else most_wall, over_marks):
                room.take(x, y, box)
                return Lettered(text, x, y, size)
    return None


def short_names(regions: Sequence[Region]) -> list[str]:
    """For each region what may stand for its name: "A" for "room A", "c1" for "corridor 1", else its number.

    The number is that of ``regions.png``, from 1.  Kinds get as many of their letters as tell them apart.
    """
    tails = [re.fullmatch(rf"{re.escape(region.kind)} (\w+)", region.name) for region in regions]
    lettered = {region.kind for region, tail in zip(regions, tails, strict=True) if tail and tail[1].isalpha()}
    kinds = sorted({region.kind for region in regions})
    heads = {kind: _head(kind, kinds) for kind in kinds}
    if len(lettered) == 1:
        heads[lettered.pop()] = ""
    pairs = zip(regions, tails, strict=True)
    return [
        f"{heads[region.kind]}{tail[1]}" if tail and (heads[region.kind] or tail[1].isalpha()) else str(number)
        for number, (region, tail) in enumerate(pairs, 1)
    ]


def _head(kind: str, kinds: Sequence[str]) -> str:
    others = [other for other in kinds if other != kind]
    length = next((n for n in range(1, len(kind)) if not any(o.startswith(kind[:n]) for o in others)), len(kind))
    return kind[:length].strip()
