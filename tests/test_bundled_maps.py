"""The bundled maps are what ``maps/draw.py`` draws, and they are sound: sizes, doors, one piece."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

MAPS = Path(__file__).resolve().parent.parent / "maps"
SHAPE = {"puzzle": (13, 13), "office": (400, 600), "clinic": (800, 1200), "slam": (360, 480)}
RESOLUTION_M = {"puzzle": 1.0, "office": 0.05, "clinic": 0.05, "slam": 0.05}
OCCUPIED, UNKNOWN, FREE = 0, 205, 254
# A cell in the hallway and one in each of the six rooms of the scanned building.
SLAM_ROOMS = ((175, 154), (127, 114), (116, 227), (142, 313), (212, 106), (225, 225), (237, 382))


def pixels(path: Path) -> NDArray[np.uint8]:
    """The decoded grey image: other OpenCV versions may pack the same pixels into other bytes."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None, path
    return image.astype(np.uint8)


def components(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int32], list[int]]:
    """Labels of the 4-connected pieces (0 is the background) and their sizes, largest first."""
    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    return labels.astype(np.int32), sorted(np.bincount(labels.ravel())[1:].tolist(), reverse=True)


def eroded(image: NDArray[np.uint8], radius_m: float) -> NDArray[np.bool_]:
    """Cells on which the centre of a round robot of that radius can stand."""
    reach = round(radius_m / 0.05)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return cv2.erode((image == FREE).astype(np.uint8), disc) > 0


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder the script has just drawn into."""
    folder = tmp_path_factory.mktemp("drawn") / "maps"
    subprocess.run([sys.executable, str(MAPS / "draw.py"), str(folder)], check=True, timeout=120)
    return folder


@pytest.mark.parametrize("name", SHAPE)
def test_the_script_draws_the_bundled_map(drawn: Path, name: str) -> None:
    np.testing.assert_array_equal(pixels(drawn / f"{name}.png"), pixels(MAPS / f"{name}.png"))
    assert (drawn / f"{name}.yaml").read_bytes() == (MAPS / f"{name}.yaml").read_bytes()


def test_the_script_writes_nothing_else(drawn: Path) -> None:
    assert {path.name for path in drawn.iterdir()} == {
        f"{name}.{ending}" for name in SHAPE for ending in ("png", "yaml")
    }


@pytest.mark.parametrize("name", SHAPE)
def test_image_is_grey_of_the_three_ros_values(name: str) -> None:
    image = pixels(MAPS / f"{name}.png")
    assert image.shape == SHAPE[name]
    assert set(np.unique(image)) <= {OCCUPIED, UNKNOWN, FREE}


@pytest.mark.parametrize("name", SHAPE)
def test_yaml_is_a_ros_map(name: str) -> None:
    settings = yaml.safe_load((MAPS / f"{name}.yaml").read_text(encoding="utf-8"))
    order = ["image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"]
    assert list(settings) == order
    assert settings["image"] == f"{name}.png"
    assert settings["mode"] == "trinary"
    assert settings["resolution"] == RESOLUTION_M[name]
    assert len(settings["origin"]) == 3
    assert settings["origin"][2] == 0.0
    assert (settings["negate"], settings["occupied_thresh"], settings["free_thresh"]) == (0, 0.65, 0.196)


@pytest.mark.parametrize("name", ["puzzle", "office", "clinic"])
def test_free_space_is_one_piece(name: str) -> None:
    assert len(components(pixels(MAPS / f"{name}.png") == FREE)[1]) == 1


@pytest.mark.parametrize("name", ["office", "clinic"])
def test_free_space_stays_one_piece_for_a_robot(name: str) -> None:
    assert len(components(eroded(pixels(MAPS / f"{name}.png"), 0.25))[1]) == 1


@pytest.mark.parametrize(("name", "rooms"), [("office", 9), ("clinic", 30)])
def test_a_disc_wider_than_the_doors_finds_the_rooms_one_by_one(name: str, rooms: int) -> None:
    """Doors are at most 1.2 m wide, but for the gates of the clinic's hall and its emergency room."""
    sizes = components(eroded(pixels(MAPS / f"{name}.png"), 0.65))[1]
    assert sum(size > 200 for size in sizes) >= rooms + 1  # and the corridors


def test_office_rooms_lie_along_the_narrow_corridor() -> None:
    image = pixels(MAPS / "office.png")
    assert (image[188:216, 24:576] == FREE).all()  # 1.4 m wide
    for wall in (image[184:188, 24:576], image[216:220, 24:576]):
        opening = (wall == FREE).all(axis=0)
        assert set(wall[:, ~opening].ravel().tolist()) == {OCCUPIED}
        edges = np.flatnonzero(np.diff(np.concatenate([[0], opening.astype(np.int8), [0]])))
        assert set(np.diff(edges)[::2].tolist()) == {18}  # every door is 0.9 m wide
        assert edges.size // 2 in (4, 5)


def test_slam_rooms_hang_together_and_specks_do_not() -> None:
    image = pixels(MAPS / "slam.png")
    labels, sizes = components(image == FREE)
    main = int(np.bincount(labels.ravel())[1:].argmax()) + 1
    assert {int(labels[cell]) for cell in SLAM_ROOMS} == {main}
    assert sizes[0] > 0.98 * sum(sizes)
    assert len(sizes) > 10
    for_a_robot = components(eroded(image, 0.25))[0]
    inside = {int(for_a_robot[cell]) for cell in SLAM_ROOMS}
    assert len(inside) == 1
    assert 0 not in inside


def test_puzzle_takes_the_papers_32_steps() -> None:
    free = pixels(MAPS / "puzzle.png") == FREE
    number = np.arange(free.size).reshape(free.shape)
    across, down = free[:, :-1] & free[:, 1:], free[:-1] & free[1:]
    start = np.concatenate([number[:, :-1][across], number[:-1][down]])
    end = np.concatenate([number[:, 1:][across], number[1:][down]])
    maze = csr_array((np.ones(start.size), (start, end)), shape=(free.size, free.size))
    steps = shortest_path(maze, directed=False, unweighted=True, indices=int(number[11, 1]))
    assert steps[number[6, 6]] == 32
