"""What ``learn`` and ``run`` do alike: from the command line to a model that is ready to learn."""

from dataclasses import dataclass, replace
from pathlib import Path

from qualrl.commands.console import PARSING, Console
from qualrl.commands.inputs import output_folder, scenario_of
from qualrl.io.scenario import Scenario
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.spatial.region_map import RegionMap


@dataclass(frozen=True, eq=False)
class Session:
    """A scenario, its map and model, and the folder that results go to."""

    scenario: Scenario
    regions: RegionMap
    model: HybridMDP
    target: Path


def open_session(
    console: Console,
    scenario_file: str,
    output: Path | None,
    settings: list[str] | None,
    algorithm: str | None,
    episodes: int | None,
    seed: int | None,
) -> Session:
    """Read the scenario and its map, and build the model; the map's warnings are noted."""
    scenario = scenario_of(scenario_file, settings, algorithm, episodes, seed)
    target = output_folder(output, scenario.path or scenario.map_path)
    with console.stage(PARSING):
        regions = scenario.regions()
    console.warn_of(regions)
    return Session(scenario, regions, scenario.build(regions), target)


def without_map(session: Session, online: bool, radius_m: float | None) -> Session:
    """The session of a robot that does not know the map, if asked for; its scenario says the rest."""
    scenario = session.scenario
    if scenario.online is None and (online or radius_m is not None):
        scenario = scenario.with_settings(["online={}"])
    if radius_m is not None:
        scenario = scenario.with_settings([setting := f"online.radius_m={radius_m}"], {setting: "--radius"})
    return replace(session, scenario=scenario)
