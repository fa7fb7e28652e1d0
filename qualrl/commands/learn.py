"""``qualrl learn``: learn a scenario."""

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
    Radius,
    ScenarioFile,
    Seed,
    Settings,
    Unknown,
)


@guarded
def learn(
    scenario_file: ScenarioFile,
    output: Output = None,
    algorithm: Algorithm = None,
    episodes: Episodes = None,
    seed: Seed = None,
    settings: Settings = None,
    online: Unknown = False,
    radius: Radius = None,
    size: PictureSize = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Learn a scenario, beside the exact optimum."""
    from qualrl.commands.documents import file_list, learn_document
    from qualrl.commands.progress import learn_with_progress
    from qualrl.commands.results import result_folder, write_learning_files, write_map_files
    from qualrl.commands.scenario_copy import scenario_copy
    from qualrl.commands.session import open_session, without_map
    from qualrl.commands.tables import print_files, print_learning
    from qualrl.report.sheet import parse_size

    console = Console(as_json, quiet)
    pixels = None if size is None else parse_size(size)
    opened = without_map(
        open_session(console, scenario_file, output, settings, algorithm, episodes, seed), online, radius
    )
    with result_folder(opened.target) as folder:
        training = learn_with_progress(opened.scenario, opened.model, console)
        with console.stage("solving exactly, and learning otherwise, to compare"):
            document = learn_document(training)
        copy = scenario_copy(opened.scenario, opened.regions, opened.target)
        names = write_map_files(folder, training.model, copy, size=pixels)
        names += write_learning_files(folder, training, json.dumps(document))
    document["files"] = file_list(opened.target, names)

    def for_people() -> None:
        print_learning(training)
        print_files(opened.target, names)

    console.result(document, for_people)
