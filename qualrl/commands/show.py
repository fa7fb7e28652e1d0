"""``qualrl show``: a short description of a scenario or a map."""

from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet


@guarded
def show(
    source: Annotated[str, typer.Argument(metavar="SCENARIO_OR_MAP", help="A scenario, or a map: image, YAML, .map.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Describe a scenario or a map: size, regions with areas, doors, graph."""
    from qualrl.commands.documents import map_document
    from qualrl.commands.inputs import SCENARIO_SUFFIX, found, is_scenario
    from qualrl.commands.tables import print_map
    from qualrl.io.read_map import read_map
    from qualrl.io.scenario import load_scenario
    from qualrl.qualitative.graph import graph_of_regions
    from qualrl.spatial.segmentation import segment

    console = Console(as_json, quiet)
    path = found(source, SCENARIO_SUFFIX)
    with console.stage(PARSING):
        regions = load_scenario(path).regions() if is_scenario(path) else segment(read_map(path))
    console.warn_of(regions)
    graph = graph_of_regions(regions)
    document = {**map_document(regions, graph), "files": []}
    console.result(document, lambda: print_map(regions))
