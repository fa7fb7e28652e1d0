"""Images: every kind that is read, and what is refused without a sound."""

import os
import struct
import zlib
from itertools import product
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from qualrl.errors import MapError
from qualrl.io.images import Image, decode_image
from tests import oracles_maps as oracles
from tests.images_by_hand import pgm, png


def complaint(data: bytes) -> str:
    with pytest.raises(MapError) as caught:
        decode_image(data, "x")
    return str(caught.value)


PALETTE = [(0, 0, 0), (255, 255, 255), (10, 200, 30)]


def packed_palette() -> bytes:
    data = bytes(value for colour in PALETTE for value in colour)
    return struct.pack(">I", len(data)) + b"PLTE" + data + struct.pack(">I", zlib.crc32(b"PLTE" + data))


GREY = np.array([[0, 90, 205], [206, 254, 255]], np.uint8)
RGB = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [10, 200, 30]]], np.uint8)
LUMA = np.array([[oracles.luma(*map(int, pixel)) for pixel in row] for row in RGB])


@pytest.mark.parametrize(
    ("data", "grey", "alpha"),
    [
        (png(GREY, 0), GREY, None),
        (png((GREY.astype(np.uint32) * 257).astype(">u2").view(np.uint8), 0, 16), GREY, None),
        (png(np.array([[0xAA]], np.uint8), 0, 1), np.array([[255, 0] * 4]), None),
        (png(np.array([[0x1B]], np.uint8), 0, 2), np.array([[0, 85, 170, 255]]), None),
        (png(RGB.reshape(2, 6), 2), LUMA, None),
        (png((RGB.astype(np.uint32) * 257).astype(">u2").reshape(2, 6).view(np.uint8), 2, 16), LUMA, None),
        (
            png(np.array([[0, 1, 2]], np.uint8), 3, 8, packed_palette()),
            np.array([[0, 255, oracles.luma(*PALETTE[2])]]),
            None,
        ),
        (png(np.array([[7, 255, 9, 128]], np.uint8), 4), np.array([[7, 9]]), np.array([[255, 128]])),
        (png(np.array([[255, 0, 0, 255, 0, 255, 0, 3]], np.uint8), 6), LUMA[:1], np.array([[255, 3]])),
        (pgm(GREY), GREY, None),
        (b"P2 3 2 # size\n255 0 90 205 206 254 255", GREY, None),
        (b"P5 3 1 100\n\x00\x32\x64", np.array([[0, 128, 255]]), None),
        (b"P5 2 1 65535\n\x00\x00\xcd\xcd", np.array([[0, 205]]), None),
        (b"P5 2 1 1023\n\x00\x00\x03\xff", np.array([[0, 255]]), None),
        (b"P1 3 2 101 0 1 0", np.array([[0, 255, 0], [255, 0, 255]]), None),
        (b"P4 3 2\n\xa0\x40", np.array([[0, 255, 0], [255, 0, 255]]), None),
        (b"P6 2 2 255\n" + RGB.tobytes(), LUMA, None),
        (b"P3 2 2 255 " + " ".join(map(str, RGB.ravel())).encode(), LUMA, None),
        *[(cv2.imencode(kind, GREY)[1].tobytes(), GREY, None) for kind in (".bmp", ".tiff")],
        *[(cv2.imencode(kind, RGB[:, :, ::-1])[1].tobytes(), LUMA, None) for kind in (".bmp", ".tiff", ".png", ".ppm")],
    ],
)
def test_kinds_of_images(data: bytes, grey: NDArray[Any], alpha: NDArray[Any] | None) -> None:
    image = decode_image(data, "x")
    assert image.grey().tolist() == grey.tolist()
    assert (image.alpha is None) == (alpha is None)
    if alpha is not None and image.alpha is not None:
        assert image.alpha.tolist() == alpha.tolist()


def test_jpeg_is_read_to_within_its_losses() -> None:
    flat = np.full((16, 16), 200, np.uint8)
    image = decode_image(cv2.imencode(".jpg", flat)[1].tobytes(), "x")
    assert np.abs(image.grey().astype(int) - 200).max() <= 2


@settings(deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 65535)] * 3), min_size=1, max_size=8))
def test_16_bit_colour_becomes_grey_before_it_becomes_8_bits(pixels: list[tuple[int, int, int]]) -> None:
    image = Image(np.array([pixels], np.uint16), None)
    assert image.grey()[0].tolist() == [oracles.luma(*pixel) // 257 for pixel in pixels]
    assert image.in_8_bits().samples[0].tolist() == [[sample // 257 for sample in pixel] for pixel in pixels]


def huge(kind: str) -> bytes:
    """A small file whose header promises 30000 x 20000 pixels."""
    if kind == "png":
        header = struct.pack(">IIBBBBB", 30000, 20000, 8, 0, 0, 0, 0)
        return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + header + b"\0" * 8
    if kind == "bmp":
        return b"BM" + b"\0" * 12 + struct.pack("<Iii", 40, 30000, -20000) + b"\0" * 40
    if kind == "jpg":
        frame = struct.pack(">BBHBHHB", 0xFF, 0xC0, 8, 8, 20000, 30000, 1) + b"\xff\xda\0\2\xff\xd9"
        return b"\xff\xd8\xff\xe0\0\2" + frame
    if kind == "tif":
        entries = struct.pack("<HHIIHHIH2x", 256, 4, 1, 30000, 257, 3, 1, 20000)
        return b"II*\0" + struct.pack("<IH", 8, 2) + entries
    return b"P5 30000 20000 255\n\0"


@pytest.mark.parametrize("kind", ["png", "bmp", "jpg", "tif", "pgm"])
def test_huge_images_are_refused_by_their_header(kind: str) -> None:
    assert (
        complaint(huge(kind))
        == "x: 30000 x 20000 pixels are more than the 400,000,000 that can be read; make it smaller"
    )


BIG = np.random.default_rng(0).integers(0, 256, (64, 64), dtype=np.uint8)


@pytest.mark.parametrize(
    ("kind", "part"), list(product([".png", ".jpg", ".bmp", ".tiff", ".pgm", ".ppm", ".pbm"], [0.02, 0.5, 0.97]))
)
def test_cut_off_images_are_one_line_and_silence(capfd: pytest.CaptureFixture[str], kind: str, part: float) -> None:
    whole = cv2.imencode(kind, BIG if kind != ".ppm" else np.dstack([BIG] * 3))[1].tobytes()
    told = complaint(whole[: max(12, int(len(whole) * part))])
    assert told.startswith("x: ")
    assert "\n" not in told
    assert capfd.readouterr() == ("", "")


def test_standard_error_works_again_after_reading(capfd: pytest.CaptureFixture[str]) -> None:
    decode_image(png(GREY, 0), "x")
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"
