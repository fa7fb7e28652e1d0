"""The JSON documents of the commands: keys that others build on."""

from pathlib import Path
from typing import Any

from qualrl.learning.run import LearningRun
from qualrl.models.levels import wings_of
from qualrl.qualitative.graph import Graph
from qualrl.spatial.region_map import RegionMap


def map_document(regions: RegionMap, graph: Graph) -> dict[str, Any]:
    """What ``convert`` and ``show`` say of a map."""
    grid = regions.grid
    names = regions.region_names
    return {
        "map": {
            "source": grid.source,
            "sha256": grid.sha256,
            "size": list(grid.shape),
            "resolution_m": grid.resolution_m,
            "origin": list(grid.origin),
            "free_cells": int(grid.free.sum()),
            "occupied_cells": int(grid.occupied.sum()),
            "unknown_cells": grid.unknown_cells,
            "radius_m": grid.radius_m,
            "lost": list(regions.lost),
            "warnings": list(grid.warnings),
        },
        "regions": [
            {
                "name": region.name,
                "kind": region.kind,
                "area_m2": region.area_m2,
                "cells": region.cells,
                "centre": list(region.centre),
                "shape": None if region.shape is None else {**vars(region.shape), "degree": region.shape.degree},
            }
            for region in regions.regions
        ],
        "doorways": [
            {
                "name": door.name,
                "between": [names[index] for index in door.pair],
                "width_m": door.width_m,
                "ends": [list(cell) for cell in door.ends],
                "ends_m": [list(grid.to_world(*cell)) for cell in door.ends],
                "midpoint": list(door.midpoint),
                "midpoint_m": list(grid.to_world(*door.midpoint)),
                "cells": door.cells.tolist(),
                "kind": "opening" if door.is_open else "door",
            }
            for door in regions.doorways
        ],
        "landmarks": [
            {
                "name": mark.name,
                "kind": mark.kind,
                "cell": list(mark.cell),
                "regions": [names[index] for index in mark.regions],
            }
            for mark in regions.landmarks
        ],
        "wings": {name: list(inside) for name, inside in wings_of(graph).items()},
        "edges": [{"from": here, "to": there, **data} for here, there, data in graph.edges(data=True)],
    }


def learn_document(run: LearningRun) -> dict[str, Any]:
    """What ``learn`` says of a run."""
    return {
        "algorithm": run.algorithm,
        "seed": run.seed,
        "settings": vars(run.settings) | {"gamma": run.model.gamma},
        "episodes": len(run.steps),
        "total_steps": run.total_steps,
        "steps_per_episode": run.steps.tolist(),
        "returns": run.returns.tolist(),
        "optimal_steps": run.optimal_steps,
        "greedy_steps": run.greedy_steps,
        "max_error": run.max_error,
        "seconds": run.seconds,
        "changes": [vars(recovery) for recovery in run.recovery],
        **_growth(run),
    }


def _growth(run: LearningRun) -> dict[str, Any]:
    """How the map became known, and what learning would have cost had it been known."""
    if run.growth is None or run.knew_map is None:
        return {}
    stages = [vars(stage) for stage in run.growth.stages]
    knew = {
        "total_steps": run.knew_map.total_steps,
        "steps_per_episode": run.knew_map.steps.tolist(),
        "greedy_steps": run.knew_map.greedy_steps,
        "seconds": run.knew_map.seconds,
    }
    return {"growth": {"free_cells": run.growth.free_cells, "stages": stages, "knew_map": knew}}


def file_list(folder: Path, names: list[str]) -> list[str]:
    """Paths of written files."""
    return [str(folder / name) for name in names]
