"""``qualrl learn``: learn a scenario."""

import json

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import (
    Algorithm,
    AsJson,
    Debug,
    Episodes,
    Output,
    Quiet,
    ScenarioFile,
    Seed,
    Settings,
)


@guarded
def learn(
    scenario_file: ScenarioFile,
    output: Output = None,
    algorithm: Algorithm = None,
    episodes: Episodes = None,
    seed: Seed = None,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Learn a scenario, beside the exact optimum."""
    from qualrl.commands.documents import file_list, learn_document
    from qualrl.commands.inputs import output_folder, scenario_of
    from qualrl.commands.progress import learn_with_progress
    from qualrl.commands.results import write_learning_files, write_map_files
    from qualrl.commands.scenario_copy import scenario_copy
    from qualrl.commands.tables import print_files, print_learning
    from qualrl.io.output_folder import OutputFolder

    console = Console(as_json, quiet)
    scenario = scenario_of(scenario_file, settings, algorithm, episodes, seed)
    target = output_folder(output, scenario.map_path if scenario.path is None else scenario.path)
    model = scenario.build()
    training = learn_with_progress(scenario, model, console)
    document = learn_document(training)
    with OutputFolder(target) as folder:
        names = write_map_files(folder, model, scenario_copy(scenario, model, target))
        names += write_learning_files(folder, training, json.dumps(document))
    document["files"] = file_list(target, names)

    def for_people() -> None:
        print_learning(training)
        print_files(target, names)

    console.result(document, for_people)
