"""The copy of a scenario that goes with results: it names what they were made with."""

import os
from pathlib import Path

from qualrl import __version__
from qualrl.io.scenario import MadeWith, Scenario
from qualrl.spatial.region_map import RegionMap


def scenario_copy(scenario: Scenario, regions: RegionMap, folder: Path) -> Scenario:
    """The scenario as run, with version and the map's SHA-256, its map seen from the result folder."""
    made_with = MadeWith(qualrl=__version__, map_sha256=regions.grid.sha256)
    map_file = os.path.relpath(scenario.map_path.resolve(), folder.resolve())
    return scenario.model_copy(update={"map": map_file, "made_with": made_with})
