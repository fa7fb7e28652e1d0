"""``qualrl show``: a short description of a scenario or a map."""

from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet, Resolution


@guarded
def show(
    source: Annotated[str, typer.Argument(metavar="SCENARIO_OR_MAP", help="A scenario, or a map: image, YAML, .map.")],
    resolution_m: Resolution = None,
    robot_radius_m: Annotated[
        float | None, typer.Option("--robot-radius", metavar="METRES", help="Only where a robot of this radius fits.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Describe a scenario or a map: size, regions with areas, doors, landmarks, wings."""
    from qualrl.commands.documents import map_document
    from qualrl.commands.inputs import is_scenario
    from qualrl.commands.tables import print_map_and_wings
    from qualrl.errors import QualrlError, SettingError
    from qualrl.io.bundled import SCENARIO_SUFFIX, found
    from qualrl.io.read_map import read_map
    from qualrl.io.scenario import load_scenario
    from qualrl.qualitative.graph import graph_of_regions
    from qualrl.spatial.segmentation import segment

    console = Console(as_json, quiet)
    path = found(source, SCENARIO_SUFFIX)
    with console.stage(PARSING):
        if resolution_m is not None and is_scenario(path):
            raise SettingError(f"{path}: is a scenario, whose key resolution_m says the metres; drop --resolution")
        scenario = load_scenario(path) if is_scenario(path) else None
        if scenario is None:
            grid = read_map(path, resolution_m=resolution_m)
            try:
                regions = segment(grid, radius_m=robot_radius_m or 0.0)
            except QualrlError as problem:
                raise type(problem)(f"--robot-radius: {problem}") from None
        else:
            setting = f"radius_m={robot_radius_m}"
            asked = [] if robot_radius_m is None else [setting]
            regions = scenario.with_settings(asked, {setting: "--robot-radius"}).regions()
    console.warn_of(regions)
    graph = graph_of_regions(regions)
    document = {**map_document(regions, graph), "files": []}
    console.result(document, lambda: print_map_and_wings(regions, document["wings"]))
