"""``qualrl convert``: a map becomes regions, a graph, a hybrid MDP and a scenario to edit."""

import os
from pathlib import Path
from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, Output, PictureSize, Quiet, Resolution

GUESSED = "start and goal are only the centres of two regions far apart"


@guarded
def convert(
    source: Annotated[str, typer.Argument(metavar="MAP", help="A map: image, ROS map YAML, or MovingAI .map.")],
    output: Output = None,
    resolution_m: Resolution = None,
    size: PictureSize = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Turn a map into a hybrid MDP, with pictures, graph files and a scenario ready to edit and run."""
    from qualrl.commands.documents import file_list, map_document
    from qualrl.commands.inputs import SCENARIO_FILE, is_scenario, output_folder
    from qualrl.commands.results import result_folder, write_map_files
    from qualrl.commands.tables import print_files, print_map
    from qualrl.errors import MapError
    from qualrl.io.bundled import found
    from qualrl.io.read_map import read_map
    from qualrl.io.suggestion import suggested_scenario
    from qualrl.report.sheet import parse_size
    from qualrl.spatial.segmentation import segment

    console = Console(as_json, quiet)
    pixels = None if size is None else parse_size(size)
    path = found(source, ".yaml")
    if path.is_file() and is_scenario(path):
        raise MapError(f"{path}: is a scenario, not a map; 'qualrl run {path}' runs it")
    with console.stage(PARSING):
        regions = segment(read_map(path, resolution_m=resolution_m))
    console.warn_of(regions)
    target = output_folder(output, path)
    scenario = suggested_scenario(regions, _map_from(path, target), resolution_m)
    model = scenario.build(regions)
    with result_folder(target) as folder:
        names = write_map_files(folder, model, scenario, size=pixels)
    document = {**map_document(regions, model.graph), "files": file_list(target, names)}

    def for_people() -> None:
        print_map(regions)
        print_files(target, names)

    console.result(document, for_people)
    console.note(f"{GUESSED}; edit {target / SCENARIO_FILE} to change them")


def _map_from(path: Path, folder: Path) -> str:
    """The map's path as seen from the folder that the scenario will lie in."""
    return os.path.relpath(path.resolve(), folder.resolve())
