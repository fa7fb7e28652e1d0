"""From what stands on the command line to a scenario, a map or a result folder."""

from pathlib import Path

from qualrl.commands.console import PARSING, Console
from qualrl.errors import QualrlError, ScenarioError, SettingError, did_you_mean
from qualrl.io.bundled import SCENARIO_SUFFIX, bundled_names, found
from qualrl.io.scenario import Scenario, load_scenario
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.region_map import RegionMap
from qualrl.spatial.relations import Relations

SCENARIO_FILE = "scenario.yaml"
"""What ``qualrl convert`` and each run call the scenario in their folder."""


def is_scenario(path: Path) -> bool:
    """Whether a file is a scenario rather than a map: by its name, or by its having no image."""
    if path.name.endswith(SCENARIO_SUFFIX) or path.name == SCENARIO_FILE:
        return True
    if path.suffix.lower() not in (".yaml", ".yml"):
        return False
    from qualrl.io.positioned_yaml import read_yaml

    data = read_yaml(path, what="scenario or map", error=ScenarioError).data
    return not (isinstance(data, dict) and "image" in data)


def scenario_of(
    argument: str,
    settings: list[str] | None = None,
    algorithm: str | None = None,
    episodes: int | None = None,
    seed: int | None = None,
) -> Scenario:
    """The scenario of a command line: the file, then --set, then the options that have a name of their own."""
    path = found(argument, SCENARIO_SUFFIX)
    if path.is_file() and not is_scenario(path):
        raise ScenarioError(f"{path}: is a map, not a scenario; 'qualrl convert {path}' makes a scenario of it")
    if not path.exists() and not path.suffix:
        raise ScenarioError(
            f"{path}: no such file, and no bundled scenario; {did_you_mean(path.name, bundled_names())}"
        )
    scenario = load_scenario(path)
    asked = {
        "--algorithm": ("learn.algorithm", algorithm),
        "--episodes": ("learn.episodes", episodes),
        "--seed": ("seed", seed),
    }
    options = {f"{key}={value}": option for option, (key, value) in asked.items() if value is not None}
    changes = [*(settings or []), *options]
    return scenario.with_settings(changes, options) if changes else scenario


def name_of(path: Path) -> str:
    """A short name for results: the file's without its suffixes, or the folder's, where ``convert`` named the file."""
    if path.name.endswith(SCENARIO_SUFFIX):
        return path.name.removesuffix(SCENARIO_SUFFIX)
    if path.name == SCENARIO_FILE:
        return path.resolve().parent.name or path.stem
    return path.stem


def output_folder(asked: Path | None, source: Path) -> Path:
    """The folder for results: as asked, or results/NAME; within it where the scenario lies there, which is kept so."""
    folder = Path("results") / name_of(source)
    if source.name == SCENARIO_FILE and folder.resolve() == source.resolve().parent:
        folder /= "run"
    return asked or folder


def regions_of(
    console: Console, argument: str, resolution_m: float | None, robot_radius_m: float | None = None
) -> RegionMap:
    """The regions of a scenario or a map, by its file or as a bundled one; the map's warnings are noted."""
    return _map_of(console, argument, resolution_m, robot_radius_m)[0]


def relations_of(
    console: Console, argument: str, resolution_m: float | None, robot_radius_m: float | None = None
) -> tuple[Relations, DistanceCuts]:
    """How the places of a map lie to each other, a scenario's zones among them; and what near and far mean there."""
    regions, scenario = _map_of(console, argument, resolution_m, robot_radius_m)
    if scenario is None:
        return regions.relations, DistanceCuts()
    return scenario.relations(regions), scenario.distance.cuts


def _map_of(
    console: Console, argument: str, resolution_m: float | None, robot_radius_m: float | None
) -> tuple[RegionMap, Scenario | None]:
    """The regions, and the scenario if it is one."""
    from qualrl.io.read_map import read_map
    from qualrl.spatial.segmentation import segment

    path = found(argument, SCENARIO_SUFFIX)
    scenario = None
    with console.stage(PARSING):
        if not is_scenario(path):
            grid = read_map(path, resolution_m=resolution_m)
            try:
                regions = segment(grid, radius_m=robot_radius_m or 0.0)
            except QualrlError as problem:
                raise type(problem)(f"--robot-radius: {problem}") from None
        elif resolution_m is not None:
            raise SettingError(f"{path}: is a scenario, whose key resolution_m says the metres; drop --resolution")
        else:
            setting = f"radius_m={robot_radius_m}"
            asked = [] if robot_radius_m is None else [setting]
            scenario = load_scenario(path).with_settings(asked, {setting: "--robot-radius"})
            regions = scenario.regions()
    console.warn_of(regions)
    return regions, scenario
