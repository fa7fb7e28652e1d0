"""Hybrid MDPs as one .npz file: plain arrays and one JSON text; nothing in it can run code.

Arrays of a model with a map: ``label`` and ``occupied`` (H, W), ``door_cells`` and ``mark_cells`` (N, 2) with
``door_ends`` and ``mark_ends`` saying where each one's cells end; for a robot with a radius also ``tight`` (H, W).
Without a map: the fields of TabularMDP and ``region_of``.  ``about`` is the JSON text with names and numbers, and with
the groupings of levels above the regions.
"""

import hashlib
import json
import zipfile
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import MapError, QualrlError
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP, hybrid_mdp
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.qualitative.graph import crossings_of
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.place import PlaceCell
from qualrl.spatial.region_map import Doorway, Landmark, Region, RegionMap, Shape

FORMAT = "qualrl-hybrid-mdp/1"
MOST_BYTES = 8 * 2**30
"""A file that would unpack to more than this is refused."""

Arrays = dict[str, NDArray[Any]]


def write_model(model: HybridMDP, file: Path) -> None:
    """Write a model to .npz."""
    about, arrays = _pack(model)
    about |= {"format": FORMAT, "gamma": model.gamma, "start": model.start}
    write_arrays(file, about, arrays)


def fingerprint(model: HybridMDP) -> str:
    """SHA-256 of all that makes a model what it is: two models of the same map and goal have the same."""
    about, arrays = _pack(model)
    about.get("map", {}).pop("source", None)
    digest = hashlib.sha256(json.dumps([about, model.gamma, model.start]).encode())
    for name in sorted(arrays):
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()


def read_model(file: Path) -> HybridMDP:
    """Read a model that ``write_model`` wrote.  Raises MapError for anything else."""
    about, arrays = read_arrays(file, FORMAT)
    try:
        model = _unpack_map(about, arrays) if "map" in about else _unpack_table(about, arrays)
        return _with_levels(model, about["coarser"]) if "coarser" in about else model
    except (KeyError, IndexError, TypeError, ValueError, QualrlError) as error:
        raise MapError(f"{file}: not a whole model file ({type(error).__name__}: {error})") from None


def write_arrays(file: Path, about: dict[str, Any], arrays: Arrays) -> None:
    """Write named arrays and one JSON text, compressed, with the same bytes each time."""
    with open(file, "wb") as stream:
        np.savez_compressed(stream, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]


def read_arrays(file: Path, expected: str) -> tuple[dict[str, Any], Arrays]:
    """(about, arrays) of a file that ``write_arrays`` wrote.  Raises MapError for anything else."""
    try:
        with zipfile.ZipFile(file) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_BYTES:
            raise MapError(f"{file}: would unpack to {size / 2**30:.1f} GiB; at most {MOST_BYTES // 2**30} are read")
        with np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        about = json.loads(str(arrays.pop("about")))
        if about["format"] != expected:
            raise MapError(f"{file}: format {about['format']!r}, but this version reads {expected!r}")
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise MapError(f"{file}: not a file of qualrl ({error})") from None
    return about, arrays


def _with_levels(model: HybridMDP, stored: list[Any]) -> HybridMDP:
    from qualrl.models.levels import Grouping  # networkx loads slowly, for few files

    coarser = tuple(Grouping(tuple(names), tuple(of)) for names, of in stored)
    restored = replace(model, coarser=coarser)
    if len(restored.levels) != 1 + len(coarser):  # built here: groups that do not fit are noticed here
        raise ValueError("levels")
    return restored


def _pack(model: HybridMDP) -> tuple[dict[str, Any], Arrays]:
    about, arrays = _pack_map(model) if model.regions is not None else _pack_table(model)
    if model.coarser:  # left out where there are none: older files and fingerprints stay valid
        about["coarser"] = [[list(grouping.names), list(grouping.of)] for grouping in model.coarser]
    if isinstance(model.world, GridWorld) and model.world.closed:
        about["world"]["closed"] = [[list(here), list(there)] for here, there in model.world.closed]
    return about, arrays


def _pack_map(model: HybridMDP) -> tuple[dict[str, Any], Arrays]:
    regions, world = model.regions, model.grid
    assert regions is not None
    grid = regions.grid
    doors, marks = regions.doorways, regions.landmarks
    about: dict[str, Any] = {
        "map": {
            "resolution_m": grid.resolution_m, "origin": grid.origin, "source": grid.source, "sha256": grid.sha256,
        },
        "world": {
            "goal": world.goal_cell, "slip": world.slip, "directions": world.directions,
            "step_reward": world.step_reward, "goal_reward": world.goal_reward,
        },
        "regions": [_pack_region(region) for region in regions.regions],
        "doorways": [[d.name, d.pair, d.width_m, d.is_open] for d in doors],
        "landmarks": [[m.name, m.kind, m.cell, m.regions] for m in marks],
    }  # fmt: skip
    arrays: Arrays = {
        "label": regions.label,
        "occupied": grid.occupied,
        "door_cells": _stacked([door.cells for door in doors]),
        "door_ends": np.cumsum([len(door.cells) for door in doors], dtype=np.int64),
        "mark_cells": _stacked([mark.cells for mark in marks]),
        "mark_ends": np.cumsum([len(mark.cells) for mark in marks], dtype=np.int64),
    }
    if grid.tight is not None:
        about |= {"lost": list(regions.lost)}
        about["map"]["radius_m"], arrays["tight"] = grid.radius_m, grid.tight
    return about, arrays


def _pack_region(region: Region) -> list[Any]:
    """Without a shape, as older files hold it, when it has none."""
    packed = [region.name, region.kind, region.cells, region.area_m2, region.centroid, region.centre]
    return packed if region.shape is None else [*packed, list(astuple(region.shape))]


def _unpack_region(
    name: str, kind: str, cells: int, area_m2: float, centroid: list[float], centre: list[int],
    shape: list[Any] | None = None,
) -> Region:  # fmt: skip
    (y, x), (row, column) = centroid, centre
    found = None
    if shape is not None:
        half_width_m, stretch, (longer_m, shorter_m), *rest = shape
        found = Shape(half_width_m, stretch, (longer_m, shorter_m), *rest)
    return Region(name, kind, cells, area_m2, (y, x), (row, column), found)


def _stacked(cells: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    return np.concatenate([np.zeros((0, 2), np.int32), *cells]).astype(np.int32)


def _unpack_map(about: dict[str, Any], arrays: Arrays) -> HybridMDP:
    label = arrays["label"]
    place, world = about["map"], about["world"]
    x_m, y_m, yaw = place["origin"]
    grid = OccupancyGrid(
        label >= 0, arrays["occupied"], place["resolution_m"], (x_m, y_m, yaw), place["source"], place["sha256"],
        radius_m=place.get("radius_m", 0.0), tight=arrays.get("tight"),
    )  # fmt: skip
    regions = RegionMap(
        grid,
        label,
        tuple(_unpack_region(*packed) for packed in about["regions"]),
        tuple(
            Doorway(name, (first, second), cells, width, is_open)
            for (name, (first, second), width, is_open), cells in zip(
                about["doorways"], _split(arrays["door_cells"], arrays["door_ends"]), strict=True
            )
        ),
        tuple(
            Landmark(name, kind, (row, column), cells, tuple(joined))
            for (name, kind, (row, column), joined), cells in zip(
                about["landmarks"], _split(arrays["mark_cells"], arrays["mark_ends"]), strict=True
            )
        ),
        tuple(about.get("lost", ())),
    )  # fmt: skip
    if not all(crossings_of(regions, door) for door in regions.doorways):
        raise ValueError("a doorway that no step leads through")
    model = hybrid_mdp(
        regions, PlaceCell(*world["goal"]), gamma=about["gamma"], slip=world["slip"],
        directions=world["directions"], step_reward=world["step_reward"], goal_reward=world["goal_reward"],
        start=None if about["start"] is None else PlaceCell(*np.argwhere(grid.free)[about["start"]].tolist()),
    )  # fmt: skip
    closed = tuple(((int(a), int(b)), (int(c), int(d))) for (a, b), (c, d) in world.get("closed", []))
    return replace(model, world=replace(model.grid, closed=closed)) if closed else model


def _split(cells: NDArray[Any], ends: NDArray[Any]) -> list[NDArray[Any]]:
    return np.split(cells, ends[:-1]) if len(ends) else []


def _pack_table(model: HybridMDP) -> tuple[dict[str, Any], Arrays]:
    table = model.world
    assert isinstance(table, TabularMDP)
    about = {
        "actions": table.action_names,
        "states": table.state_names,
        "regions": model.region_names,
    }
    names = ("row_start", "target", "probability", "reward", "terminal")
    return about, {name: getattr(table, name) for name in names} | {"region_of": model.region_of}


def _unpack_table(about: dict[str, Any], arrays: Arrays) -> HybridMDP:
    region_of = arrays.pop("region_of")
    table = TabularMDP(
        gamma=about["gamma"], action_names=tuple(about["actions"]), state_names=tuple(about["states"]), **arrays
    )
    return HybridMDP.from_table(table, [about["regions"][index] for index in region_of], about["start"])
