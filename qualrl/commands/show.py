"""``qualrl show``: a short description of a scenario or a map."""

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet, Resolution, RobotRadius, ScenarioOrMap


@guarded
def show(
    source: ScenarioOrMap,
    resolution_m: Resolution = None,
    robot_radius_m: RobotRadius = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Describe a scenario or a map: size, regions with areas, doors, landmarks, wings."""
    from qualrl.commands.documents import map_document
    from qualrl.commands.inputs import regions_of
    from qualrl.commands.tables import print_map_and_wings
    from qualrl.qualitative.graph import graph_of_regions

    console = Console(as_json, quiet)
    regions = regions_of(console, source, resolution_m, robot_radius_m)
    document = {**map_document(regions, graph_of_regions(regions)), "files": []}
    console.result(document, lambda: print_map_and_wings(regions, document["wings"]))
