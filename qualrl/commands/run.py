"""``qualrl run``: a scenario from the map to the explained plan."""

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
def run(
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
    """Read a scenario, parse its map, learn, and explain the plan; pictures and files go into a folder."""
    from qualrl.api import farthest_start
    from qualrl.commands.documents import file_list, learn_document, map_document
    from qualrl.commands.inputs import output_folder, scenario_of
    from qualrl.commands.progress import learn_with_progress
    from qualrl.commands.results import write_learning_files, write_map_files
    from qualrl.commands.scenario_copy import scenario_copy
    from qualrl.commands.tables import print_files, print_learning, print_map, print_plan
    from qualrl.io.output_folder import OutputFolder

    console = Console(as_json, quiet)
    scenario = scenario_of(scenario_file, settings, algorithm, episodes, seed)
    target = output_folder(output, scenario.map_path if scenario.path is None else scenario.path)
    model = scenario.build()
    assert model.regions is not None
    for warning in model.regions.grid.warnings:
        console.note(f"{model.regions.grid.source}: {warning}")
    training = learn_with_progress(scenario, model, console)
    plan = training.plan(None if model.start is not None else farthest_start(model))
    learned = learn_document(training)
    with OutputFolder(target) as folder:
        names = write_map_files(folder, model, scenario_copy(scenario, model, target), plan)
        names += write_learning_files(folder, training, json.dumps(learned))
        folder.path("plan.json").write_text(json.dumps(plan.to_dict(), indent=1) + "\n", encoding="utf-8")
    names.append("plan.json")
    document = {
        **map_document(model.regions, model.graph),
        "learn": learned,
        "plan": plan.to_dict(),
        "files": file_list(target, names),
    }

    regions = model.regions

    def for_people() -> None:
        print_map(regions)
        print_learning(training)
        print_plan(plan)
        print_files(target, names)

    console.result(document, for_people)
