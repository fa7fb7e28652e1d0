"""ROS maps and lone images: the arithmetic against a slow twin, every field, every kind of image, every error."""

import hashlib
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from qualrl.errors import MapError, QualrlError, SettingError
from qualrl.io.images import Image
from qualrl.io.read_map import read_map
from qualrl.io.ros_arithmetic import RosSettings, occupancy
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests import oracles_maps as oracles
from tests.images_by_hand import pgm, png

YAML = "image: m.pgm\nresolution: 0.05\norigin: [-10, 2.5, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
ROOM = np.array([[0, 0, 0], [254, 254, 205], [0, 254, 205]], np.uint8)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh current folder with a map in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(YAML)
    (tmp_path / "m.pgm").write_bytes(pgm(ROOM))
    return tmp_path


def complaint(path: str, **options: Any) -> str:
    with pytest.raises(QualrlError) as caught:
        read_map(path, **options)
    return str(caught.value)


def read_with(change: str, instead: str, **options: Any) -> OccupancyGrid:
    """The map with a part of its YAML replaced."""
    assert change in YAML
    Path("m.yaml").write_text(YAML.replace(change, instead))
    return read_map("m.yaml", **options)


def test_a_map(here: Path) -> None:
    grid = read_map("m.yaml")
    assert grid.free.tolist() == [[False] * 3, [True, True, False], [False, True, False]]
    assert grid.occupied.tolist() == [[True] * 3, [False] * 3, [True, False, False]]
    assert (grid.resolution_m, grid.origin, grid.source, grid.warnings) == (0.05, (-10.0, 2.5, 0.0), "m.yaml", ())
    assert grid.sha256 == hashlib.sha256((here / "m.pgm").read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("grey", "at_0196", "at_025"),
    [(0, 100, 100), (89, 100, 100), (90, -1, -1), (204, -1, 0), (205, -1, 0), (206, 0, 0), (254, 0, 0)],
)
def test_reference_pixels(grey: int, at_0196: int, at_025: int) -> None:
    image = Image(np.full((1, 1, 1), grey, np.uint8), None)
    assert occupancy(image, RosSettings(free_thresh=0.196))[0, 0] == at_0196
    assert occupancy(image, RosSettings(free_thresh=0.25))[0, 0] == at_025


THRESHOLDS = st.tuples(st.floats(0, 1), st.floats(0, 1)).map(sorted).filter(lambda pair: pair[0] < pair[1])
EXACT = st.sampled_from([v / 255 for v in range(256)] + [1 - v / 255 for v in range(256)])
EXACT_THRESHOLDS = st.tuples(EXACT, EXACT).map(sorted).filter(lambda pair: pair[0] < pair[1])
MODES = st.sampled_from(["trinary", "scale", "raw"])


@hypothesis_settings(deadline=None)
@given(THRESHOLDS | EXACT_THRESHOLDS, MODES, st.booleans())
def test_every_grey_under_every_rule_equals_the_twin(thresholds: list[float], mode: str, negate: bool) -> None:
    free_thresh, occupied_thresh = thresholds
    settings = RosSettings(occupied_thresh, free_thresh, negate, mode)
    image = Image(np.arange(256, dtype=np.uint8)[None, :, None], None)
    rule = (mode, negate, occupied_thresh, free_thresh)
    assert occupancy(image, settings)[0].tolist() == [oracles.nav2_value(v, 255, *rule) for v in range(256)]
    grey = [(v, v, v) for v in range(256)]
    assert occupancy(image, settings, "humble")[0].tolist() == [oracles.humble_value(v, None, *rule) for v in grey]
    assert occupancy(image, settings, "ros1")[0].tolist() == [oracles.ros1_value(v, None, *rule) for v in grey]


@hypothesis_settings(deadline=None)
@given(st.integers(0, 2**32 - 1), THRESHOLDS, MODES, st.booleans(), st.booleans())
def test_colour_and_alpha_under_every_rule_equal_the_twin(
    seed: int, thresholds: list[float], mode: str, negate: bool, transparent: bool
) -> None:
    free_thresh, occupied_thresh = thresholds
    settings, rule = (
        RosSettings(occupied_thresh, free_thresh, negate, mode),
        (mode, negate, occupied_thresh, free_thresh),
    )
    random = np.random.default_rng(seed)
    rgb = random.integers(0, 256, (1, 40, 3), dtype=np.uint8)
    alpha = random.choice(np.array([0, 1, 128, 254, 255], np.uint8), (1, 40)) if transparent else None
    image = Image(rgb, alpha)
    colours = [tuple(map(int, pixel)) for pixel in rgb[0]]
    alphas = [None] * 40 if alpha is None else [int(value) for value in alpha[0]]
    pixels = list(zip(colours, alphas, strict=True))
    expected = [oracles.nav2_value(oracles.luma(*c), 255 if a is None else a, *rule) for c, a in pixels]
    assert occupancy(image, settings)[0].tolist() == expected
    assert occupancy(image, settings, "humble")[0].tolist() == [oracles.humble_value(c, a, *rule) for c, a in pixels]
    assert occupancy(image, settings, "ros1")[0].tolist() == [oracles.ros1_value(c, a, *rule) for c, a in pixels]


def test_the_dialects_differ_exactly_at_the_thresholds() -> None:
    image = Image(np.array([[[0], [102], [255]]], np.uint8), None)  # occupancies 1, 0.6, 0
    settings = RosSettings(occupied_thresh=1.0, free_thresh=0.0, mode="trinary")
    assert occupancy(image, settings).tolist() == [[100, -1, 0]]
    assert occupancy(image, settings, "humble").tolist() == [[-1, -1, -1]]
    assert occupancy(image, settings, "ros1").tolist() == [[-1, -1, -1]]


@hypothesis_settings(deadline=None)
@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(-7, 7), st.floats(0.01, 2), st.data())
def test_yaw_turns_the_map_about_its_lower_left_corner(
    x_m: float, y_m: float, yaw_rad: float, resolution_m: float, data: st.DataObject
) -> None:
    height, width = data.draw(st.integers(1, 50)), data.draw(st.integers(1, 50))
    grid = OccupancyGrid(
        np.ones((height, width), np.bool_), np.zeros((height, width), np.bool_), resolution_m, (x_m, y_m, yaw_rad)
    )
    row, column = data.draw(st.integers(0, height - 1)), data.draw(st.integers(0, width - 1))
    world = oracles.world_of_pixel(row, column, height, resolution_m, grid.origin)
    assert grid.to_world(row, column) == pytest.approx((world.real, world.imag), abs=1e-9)
    assert grid.to_cell(world.real, world.imag) == (row, column)
    nudge = data.draw(st.floats(-0.49, 0.49))
    inside = oracles.world_of_pixel(row + nudge, column - nudge, height, resolution_m, grid.origin)
    assert grid.to_cell(inside.real, inside.imag) == (row, column)


def test_yaw_is_kept(here: Path) -> None:
    grid = read_with("origin: [-10, 2.5, 0]", "origin: [1, 2, 1.5707963267948966]")
    assert grid.to_world(2, 0) == pytest.approx((1 - 0.025, 2 + 0.025))
    assert grid.to_world(2, 2) == pytest.approx((1 - 0.025, 2 + 0.125))


@pytest.mark.parametrize(
    ("written", "negated"),
    [
        *[("0", False), ("1", True), ("2", True), ("'1'", True), ("'false'", False), ("false", False)],
        *[("True", True), ("no", False), ("yes", True), ("Off", False), ("ON", True), ("n", False)],
    ],
)
def test_negate_as_yaml_cpp_reads_it(here: Path, written: str, negated: bool) -> None:
    grid = read_with("negate: 0", f"negate: {written}")
    assert grid.free[0, 0] == negated


def test_fields_as_nav2_reads_them(here: Path) -> None:
    assert read_with("resolution: 0.05", "resolution: '5e-2'").resolution_m == 0.05
    assert read_with("resolution: 0.05", "mode: TriNary\nresolution: 1").warnings == ()
    assert read_with("negate: 0", "negate: 0\nmap_type: occupancy\ncost_scaling: 3").warnings == ()
    assert read_with("negate: 0", "negate: 0\nmod: scale").warnings == (
        "m.yaml:5:1: 'mod' is ignored; was 'mode' meant?",
    )


def test_modes(here: Path) -> None:
    (here / "m.pgm").write_bytes(pgm(np.array([[0, 100, 101, 128, 205, 254]], np.uint8)))
    trinary = read_with("negate: 0", "negate: 0\nmode: trinary")
    scale = read_with("negate: 0", "negate: 0\nmode: scale")
    raw = read_with("negate: 0", "negate: 0\nmode: raw")
    assert trinary.free.tolist() == [[False] * 5 + [True]]
    assert scale.free.tolist() == [[False] * 4 + [True] * 2]  # 205 is 0.02 % above free_thresh, published as 0
    assert raw.free.tolist() == [[True] + [False] * 5]
    assert raw.occupied.tolist() == [[False, True] + [False] * 4]
    assert scale.warnings == (
        "grey 205, which map_saver writes for unknown, counts as free; use mode trinary",
        "3 cells are between free and occupied (mode scale); they count as unknown",
    )


@pytest.mark.parametrize(
    ("change", "instead", "said"),
    [
        ("image: m.pgm\n", "", "m.yaml:1:1: image: missing; add a line 'image: ...'"),
        ("image: m.pgm", "map: x\ngoal: y", "m.yaml:1:1: image: missing; is this a scenario, not a map?"),
        ("resolution", "resolutoin", "m.yaml:1:1: resolution: missing; rename 'resolutoin' in line 2"),
        ("m.pgm", "''", "m.yaml:1:8: image: must be the path of an image, got ''"),
        ("m.pgm", "[a]", "m.yaml:1:8: image: must be the path of an image, got ['a']"),
        ("m.pgm", "x/n.pgm", "m.yaml:1:8: image: no such file: 'x/n.pgm'; correct the path or copy the image there"),
        (
            "m.pgm",
            "/no/n.pgm",
            "m.yaml:1:8: image: no such file: '/no/n.pgm'; correct the path or copy the image there",
        ),
        (
            "m.pgm",
            '"n\\0.pgm"',
            "m.yaml:1:8: image: no such file: 'n\\x00.pgm'; correct the path or copy the image there",
        ),
        ("0.05", "0", "m.yaml:2:13: resolution: must be above 0 metres a pixel, got 0"),
        ("0.05", "five", "m.yaml:2:13: resolution: must be a number, got 'five'"),
        ("0.05", "true", "m.yaml:2:13: resolution: must be a number, got true"),
        ("0.05", ".inf", "m.yaml:2:13: resolution: must be a finite number, got inf"),
        (
            "[-10, 2.5, 0]",
            "[1, 2]",
            "m.yaml:3:9: origin: must be three numbers [x, y, yaw] in metres and radians, got [1, 2]",
        ),
        ("[-10, 2.5, 0]", "[1, 2, .nan]", "m.yaml:3:9: origin: must be three finite numbers"),
        ("negate: 0", "negate: maybe", "m.yaml:4:9: negate: must be 0, 1, true or false, got 'maybe'"),
        ("negate: 0", "negate: 0\nmode: tri", "m.yaml:5:7: mode: must be one of trinary, scale, raw, got 'tri'"),
        ("0.196", "0.65", "m.yaml:6:14: free_thresh: must be below occupied_thresh (0.65), got 0.65"),
        (
            "0.196",
            "0.001",
            "m.yaml: no pixel is free; the lightest grey is 254, occupancy 0.004, and free_thresh is 0.001",
        ),
        (YAML, "- a\n", "m.yaml:1:1: expected a map YAML with keys image, resolution"),
        (YAML, "", "m.yaml:1:1: expected a map YAML with keys image, resolution"),
        ("negate: 0", "negate: 0\nnegate: 1", "m.yaml:5:1: 'negate' was given before, at 4:1"),
    ],
)
def test_what_is_wrong_with_a_map_yaml(here: Path, change: str, instead: str, said: str) -> None:
    assert change in YAML
    Path("m.yaml").write_text(YAML.replace(change, instead))
    told = complaint("m.yaml").split("\n")
    assert any(line.startswith(said) for line in told), told


def test_all_problems_of_a_map_yaml_at_once(here: Path) -> None:
    Path("m.yaml").write_text("image: none.png\nresolution: -1\norigin: 3\nnegate: x\nmode: y\n")
    told = complaint("m.yaml").split("\n")
    assert [line.split(": ")[1] for line in told] == [
        "free_thresh", "occupied_thresh", "image", "resolution", "origin", "negate", "mode",
    ]  # fmt: skip


def test_thresholds_matter_not_in_raw_mode(here: Path) -> None:
    (here / "m.pgm").write_bytes(pgm(np.array([[0, 100]], np.uint8)))
    grid = read_with("free_thresh: 0.196", "free_thresh: 0.9\nmode: raw")
    assert grid.free.tolist() == [[True, False]]


def test_the_image_is_found_from_the_yaml_not_from_here(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (here / "sub").mkdir()
    (here / "m.pgm").rename(here / "sub" / "m.pgm")
    (here / "m.yaml").rename(here / "sub" / "m.yaml")
    grid = read_map(Path("sub") / "m.yaml")
    assert grid.shape == (3, 3)
    assert grid.source == "sub/m.yaml"


@pytest.mark.parametrize("dead", ["/home/robot/maps/m.pgm", "'C:\\maps\\m.pgm'"])
def test_a_dead_absolute_path_gives_way_to_the_same_name_beside_the_yaml(here: Path, dead: str) -> None:
    grid = read_with("m.pgm", dead)
    assert grid.shape == (3, 3)
    path = dead.strip("'")
    assert grid.warnings == (f"image {path} does not exist; m.pgm, of the same name, was read instead",)


def test_warnings(here: Path) -> None:
    assert read_with("0.196", "0.25").warnings == (
        "grey 205, which map_saver writes for unknown, counts as free; set free_thresh to 0.196 (it is 0.25)",
    )
    (here / "m.pgm").write_bytes(pgm(np.array([[0, 205, 205, 254, 205, 205]], np.uint8)))
    assert read_with("0.196", "0.196").warnings == ("67% of the map is unknown, where no robot may stand",)
    assert "occupied_thresh is 65, but occupancy goes from 0 to 1" in read_with("0.65", "65").warnings


def test_an_unknown_dialect_is_refused(here: Path) -> None:
    with pytest.raises(SettingError, match="unknown dialect 'humbel'; did you mean 'humble'"):
        read_map("m.yaml", dialect="humbel")


def test_transparent_pixels_are_unknown_to_nav2(here: Path) -> None:
    (here / "m.png").write_bytes(png(np.array([[255, 255, 255, 254, 0, 255]], np.uint8), 4))
    grid = read_with("m.pgm", "m.png")
    assert (grid.free.tolist(), grid.occupied.tolist()) == ([[True, False, False]], [[False, False, True]])


def test_a_lone_image_is_read_with_stated_defaults(here: Path) -> None:
    grid = read_map("m.pgm")
    assert (grid.resolution_m, grid.origin) == (0.05, (0.0, 0.0, 0.0))
    assert grid.warnings == (
        "an image without a map YAML: assumed 0.05 m a pixel and thresholds 0.65 (occupied) and 0.196 (free); "
        "m.yaml lies beside it, read that to use its settings",
    )
    (here / "m.yaml").unlink()
    grid = read_map("m.pgm", resolution_m=0.1)
    assert grid.resolution_m == 0.1
    assert grid.warnings == ("an image without a map YAML: assumed thresholds 0.65 (occupied) and 0.196 (free)",)


def test_what_a_file_is_depends_on_its_content(here: Path) -> None:
    (here / "m.pgm").rename(here / "map.dat")
    assert read_map("map.dat").shape == (3, 3)
    (here / "text.png").write_text("hello")
    assert complaint("text.png").startswith("text.png: not an image that can be read (PNG, PGM, JPEG, BMP and TIFF)")
    (here / "text.txt").write_text("hello")
    assert complaint("text.txt").startswith("text.txt: not a map that can be read; give a ROS map YAML")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.png", "none.png: no such map file"),
        ("none.yaml", "none.yaml: no such map file"),
        (".", ".: is a folder, not a map file"),
        ("empty.png", "empty.png: the file is empty"),
        ("nul\0.png", "'nul\\x00.png': cannot be read"),
        ("/dev/zero", "/dev/zero: is not a regular file"),
    ],
)
def test_files_that_are_no_maps(here: Path, name: str, said: str) -> None:
    (here / "empty.png").write_bytes(b"")
    told = complaint(name)
    assert told.startswith(said)
    assert "\n" not in told


@pytest.mark.parametrize("wrong", [0, -1, math.inf, math.nan])
def test_a_wrong_resolution_is_refused(here: Path, wrong: float) -> None:
    assert complaint("m.pgm", resolution_m=wrong).startswith("resolution_m must be above 0")


def test_a_resolution_beside_a_map_yaml_is_refused(here: Path) -> None:
    assert (
        complaint("m.yaml", resolution_m=0.1) == "m.yaml: a map YAML says its resolution itself; leave resolution_m out"
    )


SEEDS = [
    pgm(ROOM),
    b"P2 2 1 9 3 4",
    png(ROOM, 0),
    *[cv2.imencode(kind, ROOM)[1].tobytes() for kind in (".jpg", ".bmp", ".tiff")],
]
SEEDS += [YAML.encode(), b"type octile\nheight 2\nwidth 2\nmap\n..\n@.\n"]


@hypothesis_settings(deadline=None)
@given(st.sampled_from(SEEDS), st.lists(st.tuples(st.integers(0, 200), st.integers(0, 255)), max_size=4), st.data())
def test_any_bytes_are_a_map_or_one_line_an_error(
    tmp_path_factory: pytest.TempPathFactory, whole: bytes, changes: list[tuple[int, int]], data: st.DataObject
) -> None:
    broken = bytearray(whole)
    for at, value in changes:
        broken[at % len(broken)] = value
    broken = broken[: data.draw(st.integers(0, len(broken)))] if data.draw(st.booleans()) else broken
    folder = tmp_path_factory.getbasetemp()
    (folder / "m.pgm").write_bytes(pgm(ROOM))
    for ending in ("png", "map", "yaml", "dat"):
        path = folder / f"any.{ending}"
        path.write_bytes(broken)
        told = str(path)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("qualrl.io.images.MOST_PIXELS", 10_000)  # a broken header may promise more, which takes time
            try:
                assert read_map(path).free.any()
            except MapError as problem:
                told = str(problem)
        assert all(line.startswith(str(path)) for line in told.split("\n"))
