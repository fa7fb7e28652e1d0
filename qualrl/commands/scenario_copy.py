"""The copy of a scenario that goes with results: it names what they were made with."""

import os
from dataclasses import replace
from pathlib import Path

from qualrl import __version__
from qualrl.io.scenario import MadeWith, Scenario
from qualrl.io.scenario_zones import MaskImage
from qualrl.spatial.region_map import RegionMap


def scenario_copy(scenario: Scenario, regions: RegionMap, folder: Path) -> Scenario:
    """The scenario as run, with version and the map's SHA-256, its files seen from the result folder."""
    made_with = MadeWith(qualrl=__version__, map_sha256=regions.grid.sha256)

    def seen(file: Path) -> str:
        return os.path.relpath(file.resolve(), folder.resolve())

    zones = {
        name: replace(zone, image=seen(scenario.folder / zone.image)) if isinstance(zone, MaskImage) else zone
        for name, zone in scenario.zones.items()
    }
    return scenario.model_copy(update={"map": seen(scenario.map_path), "zones": zones, "made_with": made_with})
