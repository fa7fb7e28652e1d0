"""The picture of a map, as far as arithmetic can judge it."""

import itertools
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from matplotlib import font_manager
from matplotlib.colors import to_rgb
from matplotlib.text import Text

import qualrl
from qualrl.errors import SettingError
from qualrl.report import furniture, region_colours
from qualrl.report.lettering import MISSING, Lettering
from qualrl.report.name_places import short_names
from qualrl.report.overlay import chord_of, draw_overlay, overlay_figure
from qualrl.report.sheet import Pixels, drawn_window, lay_out, parse_size
from qualrl.spatial.occupancy_grid import OccupancyGrid
from tests.worlds import TWO_ROOMS, grid_of

SIZES = [(600, 400), (2000, 2000)]
FARTHEST_ALIKE = 20.0
"""Colours less than this apart in Lab could be taken for the same."""


@pytest.fixture(scope="module")
def office():
    return qualrl.segment(qualrl.read_map("maps/office.yaml"))


@pytest.fixture(scope="module")
def slam():
    return qualrl.segment(qualrl.read_map("maps/slam.yaml"))


def chessboard(rooms: int, side: int = 8) -> OccupancyGrid:
    """So many rooms a side, each with a door of two cells to its right and below."""
    free = np.ones((rooms * side + 1, rooms * side + 1), np.bool_)
    free[::side], free[:, ::side] = False, False
    for start in range(side, rooms * side, side):
        for middle in range(side // 2, rooms * side, side):
            free[start, middle : middle + 2] = free[middle : middle + 2, start] = True
    return OccupancyGrid.from_free(free)


def texts_of(figure) -> list[Text]:
    return [text for text in figure.axes[0].texts if text.get_text()]


def drawn_boxes(figure) -> list[tuple[float, float, float, float]]:
    """Left, bottom, right, top of each text on the sheet, as it is drawn."""
    renderer = figure.canvas.get_renderer()
    return [text.get_window_extent(renderer).extents.tolist() for text in texts_of(figure)]


def lab(colour: str) -> np.ndarray:
    return cv2.cvtColor(np.array([[to_rgb(colour)]], np.float32), cv2.COLOR_RGB2LAB)[0, 0]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["office", "slam", "clinic"])
def test_no_text_overlaps_another_or_leaves_the_sheet(name, size):
    """Boxes may touch by a pixel of rounding; the descent of letters is part of a box but seldom drawn."""
    figure = overlay_figure(qualrl.segment(qualrl.read_map(f"maps/{name}.yaml")), title="A → B", size=size)
    boxes = drawn_boxes(figure)
    assert len(boxes) > 8
    for left, bottom, right, top in boxes:
        assert min(left, bottom, size[0] - right, size[1] - top) >= -1
    for one, other in itertools.combinations(boxes, 2):
        across = min(one[2], other[2]) - max(one[0], other[0])
        up = min(one[3], other[3]) - max(one[1], other[1])
        assert across <= 1 or up <= 4, (one, other)


@pytest.mark.parametrize("size", SIZES)
def test_pictures_have_the_size_asked_for(office, tmp_path, size):
    draw_overlay(office, tmp_path / "sized.png", size=size)
    assert cv2.imread(str(tmp_path / "sized.png")).shape[1::-1] == size


def test_names_stand_on_their_own_regions(office):
    """At full size each region has its whole name, and its text's middle lies in the region."""
    figure = overlay_figure(office, size=(2000, 2000))
    sheet = lay_out(drawn_window(office), (2000, 2000), *_head_and_foot(figure), em=1.0)
    written = {text.get_text().replace("\n", " "): text.get_position() for text in texts_of(figure)}
    for index, region in enumerate(office.regions):
        x, y = written[region.name]
        row = int((y - sheet.top) / sheet.scale) + sheet.window[0].start
        column = int((x - sheet.left) / sheet.scale) + sheet.window[1].start
        assert office.label[row, column] == index, region.name


def _map_extent(figure) -> tuple[int, int, int, int]:
    """Left, right, bottom, top of the map's image, from the sheet's top left corner."""
    laid = _pixels(figure)
    height, width, _ = laid.image.shape
    top = int(figure.axes[0].get_ylim()[0]) - laid.bottom - height
    return laid.left, laid.left + width, top + height, top


def _pixels(figure) -> Pixels:
    (found,) = (artist for artist in figure.artists if isinstance(artist, Pixels))
    return found


def _head_and_foot(figure) -> tuple[float, float]:
    """The room that the map leaves at the top and at the bottom of its sheet, from where its image is."""
    *_, bottom, top = _map_extent(figure)
    height = figure.axes[0].get_ylim()[0]
    return top, height - bottom - 1


def test_neighbours_differ_in_colour_also_across_a_wall():
    regions = qualrl.segment(chessboard(8))
    graph = region_colours.nearby_regions(regions, px_per_cell=1.0)
    assert graph.number_of_edges() > 2 * 8 * 7 - 1
    numbers = region_colours.colour_numbers(regions, px_per_cell=1.0)
    assert all(numbers[one] != numbers[other] for one, other in graph.edges)
    assert numbers == region_colours.colour_numbers(regions, px_per_cell=1.0)


def test_the_palette_is_told_apart_and_bears_black_text():
    for one, other in itertools.combinations(region_colours.PALETTE, 2):
        assert np.linalg.norm(lab(one) - lab(other)) > FARTHEST_ALIKE, (one, other)
    for colour in region_colours.PALETTE:
        assert lab(colour)[0] > 60
        for blank in (region_colours.WALL, region_colours.UNKNOWN, region_colours.POCKET):
            assert np.linalg.norm(lab(colour) - lab(blank)) > 14, (colour, blank)


@pytest.mark.parametrize("yaw", [0.0, 0.7, np.pi / 2, -2.5])
def test_the_arrow_points_along_world_y(yaw):
    """A step along the arrow, taken in cells, is a step north in the world."""
    grid = grid_of(TWO_ROOMS, resolution_m=0.05)
    turned = OccupancyGrid(grid.free, grid.occupied, 0.05, (3.0, -7.0, yaw))
    right, down = furniture.north_of(turned)
    here, there = np.array(turned.to_world(0, 0)), np.array(turned.to_world(down, right))
    np.testing.assert_allclose(there - here, (0.0, 0.05), atol=1e-9)
    figure = overlay_figure(qualrl.segment(turned), size=(600, 400))
    arrow = next(text for text in figure.axes[0].texts if text.get_gid() == "north")
    way = np.subtract(arrow.xy, arrow.xyann)
    np.testing.assert_allclose(way / np.hypot(*way), (right, down), atol=1e-9)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("resolution_m", [0.05, 1.0, 0.033])
def test_the_scale_bar_is_as_long_as_it_says(size, resolution_m):
    regions = qualrl.segment(grid_of(TWO_ROOMS, resolution_m))
    figure = overlay_figure(regions, size=size)
    axes = figure.axes[0]
    bar = next(line for line in axes.lines if line.get_gid() == "scale bar")
    length_px = max(bar.get_xdata()) - min(bar.get_xdata())
    text = next(text.get_text() for text in axes.texts if text.get_gid() == "scale text")
    left, right, *_ = _map_extent(figure)
    columns = drawn_window(regions)[1]
    px_per_cell = (right - left) / (columns.stop - columns.start)
    assert length_px == pytest.approx(float(text.split()[0]) / resolution_m * px_per_cell, rel=0.01)


def test_round_lengths():
    for longest in (0.013, 0.5, 0.99, 1.0, 3.0, 49.9, 1234.0):
        length = furniture.round_length(longest)
        assert longest / 2.5 <= length <= longest * 1.000001
        assert f"{length:.0e}"[0] in "125"
    assert furniture.length_text(2000.0) == "2 km"


def test_doors_are_chords_from_wall_to_wall():
    """TWO_ROOMS has a door of one cell; its chord is a cell long and lies in the wall."""
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    sheet = lay_out(drawn_window(regions), (1900, 900), 0.0, 0.0, em=10.0)
    (door,) = regions.doorways
    chord = chord_of(door, regions, sheet)
    assert np.hypot(*(chord[1] - chord[0])) == pytest.approx(sheet.scale)
    assert chord[0, 0] == pytest.approx(chord[1, 0])
    texts = [text.get_text() for text in texts_of(overlay_figure(regions))]
    assert "1.00 m" in texts


def test_the_legend_names_what_occurs_and_nothing_else(office, slam):
    words = {text.get_text() for text in texts_of(overlay_figure(office))}
    assert {"door", "corner"} <= words
    assert not {"opening", "junction", "dead end", "path", "pocket"} & words
    assert {"pocket", "unknown"} <= {text.get_text() for text in texts_of(overlay_figure(slam))}


def test_kinds_that_nobody_has_heard_of_are_drawn_too():
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    odd = tuple(replace(mark, kind="pillar") if mark.kind == "corner" else mark for mark in regions.landmarks)
    rooms = tuple(replace(region, kind="atrium", name=f"atrium {n}") for n, region in enumerate(regions.regions))
    words = {text.get_text() for text in texts_of(overlay_figure(replace(regions, landmarks=odd, regions=rooms)))}
    assert {"pillar", "atrium 0", "atrium 1"} <= words


@pytest.mark.no_cover
def test_hundreds_of_small_regions_are_no_heap_of_text():
    regions = qualrl.segment(chessboard(30))
    assert len(regions.regions) > 800
    started = time.process_time()
    figure = overlay_figure(regions, size=(600, 400))
    assert time.process_time() - started < 10
    words = [text.get_text() for text in texts_of(figure)]
    assert len(words) < 30
    assert any(f"without a name here: {len(regions.regions):,} regions" in word for word in words)
    assert any("not drawn: 900 centres" in word for word in words)
    assert "centre" not in words
    assert "centre" in {text.get_text() for text in texts_of(overlay_figure(regions, size=(2000, 2000)))}


@pytest.mark.parametrize("size", SIZES)
def test_names_and_widths_leave_the_centres_free(office, size):
    """The office has room enough: no text lies on the mark of any region's centre."""
    figure = overlay_figure(office, size=size)
    centres = next(line for line in figure.axes[0].lines if line.get_gid() == "centre").get_xydata()
    assert len(centres) == len(office.regions)
    for x, y in centres:
        for left, bottom, right, top in drawn_boxes(figure):
            assert not (left < x < right and bottom < size[1] - y < top)


@pytest.mark.parametrize("size", SIZES)
def test_widths_are_not_struck_through_by_walls(office, size):
    figure = overlay_figure(office, size=size)
    pixels = _pixels(figure).image
    is_wall = (pixels == np.multiply(to_rgb(region_colours.WALL), 255).round()).all(axis=2)
    left, _, _, top = _map_extent(figure)
    widths = [text for text in texts_of(figure) if text.get_text().endswith("0 m")]
    assert 2 * len(widths) >= len(office.doorways)
    for text in widths:
        x, y = text.get_position()
        assert not is_wall[int(y - top), int(x - left) - 6 : int(x - left) + 7].all(), text.get_text()


def test_far_pockets_and_unknown_take_no_room_but_a_path_does():
    """A room in the corner of a large unknown map fills the picture; a path from a far pocket is drawn with it."""
    free = np.zeros((300, 300), np.bool_)
    free[20:60, 30:90], free[290:292, 290:292] = True, True
    regions = qualrl.segment(OccupancyGrid(free, np.zeros_like(free), 0.05))
    rows, columns = drawn_window(regions)
    assert 10 < rows.start < 20
    assert 90 < columns.stop < 100
    assert drawn_window(regions, path=[(291, 291)])[0].stop > 291


def test_short_names_tell_kinds_apart():
    regions = qualrl.segment(qualrl.read_map("maps/clinic.yaml"))
    names = short_names(regions.regions)
    assert len(set(names)) == len(names)
    assert names[regions.region_names.index("room A")] == "A"
    assert names[regions.region_names.index("corridor 1")] == "c1"
    named = regions.renamed({"room A": "the large waiting hall"})
    assert short_names(named.regions)[0] == "1"


def test_names_in_scripts_without_a_font_are_numbers_and_dollars_are_no_formula(monkeypatch):
    monkeypatch.setattr("qualrl.report.lettering._system_fonts", tuple)
    regions = qualrl.segment(grid_of(TWO_ROOMS)).renamed(
        {"room A": "\N{CJK UNIFIED IDEOGRAPH-6703}", "room B": "$x$ $"}
    )
    words = [text.get_text() for text in texts_of(overlay_figure(regions, title="\N{CJK UNIFIED IDEOGRAPH-6703}"))]
    assert "1" in words
    assert "$x$ $" in " ".join(words).replace("\n", " ")
    assert any(f"1 = {MISSING}" in word for word in words)


def test_a_font_of_the_system_helps_out(monkeypatch):
    """DejaVu Sans Mono stands for a font of another script: what the first font lacks is looked for in it."""
    file = font_manager.findfont("DejaVu Sans Mono")
    has = {file: frozenset({ord("b")})}
    monkeypatch.setattr("qualrl.report.lettering._system_fonts", lambda: (("DejaVu Sans Mono", file),))
    monkeypatch.setattr("qualrl.report.lettering._characters", lambda path: has.get(path, frozenset({ord("a")})))
    letters = Lettering(["abc"])
    assert letters.can_write("ab")
    assert not letters.can_write("c")
    assert letters.writable("abc") == f"ab{MISSING}"


@pytest.mark.parametrize("text", ["600", "600x", "x400", "600*400", "0x0", "600x99999", "-600x400", "600.5x400", ""])
def test_bad_sizes_are_told_in_one_line(text):
    with pytest.raises(SettingError, match=r"^--size: [^\n]*$"):
        parse_size(text)


def test_names_leave_the_marks_of_start_and_goal_free(tmp_path):
    """With marks at the centres of both rooms, each mark's middle shows: white for the start, blue for the goal."""
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    plan = qualrl.plan(qualrl.build(regions, "room B", start="room A"), exact=True)
    draw_overlay(regions, tmp_path / "marked.png", path=plan.path)
    marked = cv2.imread(str(tmp_path / "marked.png"))
    figure = overlay_figure(regions, path=plan.path)
    left, right, _, top = _map_extent(figure)
    scale = (right - left) / regions.label.shape[1]
    for region, colour in zip(regions.regions, ((255, 255, 255), (0x6B, 0x30, 0x08)), strict=True):
        row, column = (int((at + 0.5) * scale) for at in region.centre)
        middle = marked[int(row + top) - 2 : int(row + top) + 3, column + left - 2 : column + left + 3].reshape(-1, 3)
        assert np.median(middle, axis=0).tolist() == list(colour)
