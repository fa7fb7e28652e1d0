"""``qualrl run``: a scenario from the map to the explained plan."""

import json

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import (
    Algorithm,
    AsJson,
    Debug,
    Episodes,
    Output,
    PictureSize,
    Quiet,
    ScenarioFile,
    Seed,
    Settings,
)


@guarded
def run(
    scenario_file: ScenarioFile,
    output: Output = None,
    algorithm: Algorithm = None,
    episodes: Episodes = None,
    seed: Seed = None,
    settings: Settings = None,
    size: PictureSize = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Read a scenario, parse its map, learn, and explain the plan; pictures and files go into a folder."""
    from qualrl.api import farthest_start
    from qualrl.commands.documents import file_list, learn_document, map_document
    from qualrl.commands.progress import learn_with_progress
    from qualrl.commands.results import result_folder, write_learning_files, write_map_files, write_plan
    from qualrl.commands.scenario_copy import scenario_copy
    from qualrl.commands.session import open_session
    from qualrl.commands.tables import print_files, print_learning, print_map, print_plan
    from qualrl.report.sheet import parse_size

    console = Console(as_json, quiet)
    pixels = None if size is None else parse_size(size)
    opened = open_session(console, scenario_file, output, settings, algorithm, episodes, seed)
    with result_folder(opened.target) as folder:
        training = learn_with_progress(opened.scenario, opened.model, console)
        model = training.model
        with console.stage("solving exactly, to compare"):
            plan = training.plan(farthest_start(model) if model.start is None else None)
        learned = learn_document(training)
        copy = scenario_copy(opened.scenario, opened.regions, opened.target)
        names = write_map_files(folder, model, copy, plan, pixels)
        names += write_learning_files(folder, training, json.dumps(learned))
        names.append(write_plan(folder, plan))
    document = {
        **map_document(opened.regions, opened.model.graph),
        "learn": learned,
        "plan": plan.to_dict(),
        "files": file_list(opened.target, names),
    }

    def for_people() -> None:
        print_map(opened.regions)
        print_learning(training)
        print_plan(plan)
        print_files(opened.target, names)

    console.result(document, for_people)
