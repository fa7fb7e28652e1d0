"""The files of a result folder."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from qualrl.api import Training
from qualrl.commands.inputs import SCENARIO_FILE
from qualrl.commands.learned import MODEL_FILE, TRAINING_FILE
from qualrl.io.graph_file import write_graph_json, write_graphml
from qualrl.io.label_image import write_label_image
from qualrl.io.model_file import write_model
from qualrl.io.output_folder import OutputFolder
from qualrl.io.scenario import Scenario, dump_scenario
from qualrl.io.training_file import write_run
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.plan import Plan, in_steps

if TYPE_CHECKING:
    from qualrl.report.sheet import Size

MAP_FILES = ("regions.png", "overlay.png", "graph.json", "graph.graphml", MODEL_FILE, SCENARIO_FILE)
LEARNING_FILES = (TRAINING_FILE, "learn.json", "learning_curve.png")
GROWTH_FILE = "growth.png"
PLAN_FILE = "plan.json"
WHY_UNREACHABLE_FILES = ("why_unreachable.png", "why_unreachable.json")


def result_folder(path: Path) -> OutputFolder:
    """A folder for results; what an earlier command left there of ours goes when the new results come."""
    return OutputFolder(path, ours=(*MAP_FILES, *LEARNING_FILES, GROWTH_FILE, PLAN_FILE, *WHY_UNREACHABLE_FILES))


def write_map_files(
    folder: OutputFolder, model: HybridMDP, scenario: Scenario, plan: Plan | None = None, size: "Size | None" = None
) -> list[str]:
    """Write what ``convert`` writes; the overlay shows the plan's path if there is one.  Returns the names.

    size: (width, height) of the overlay in pixels.
    """
    from qualrl.report.overlay import draw_overlay  # matplotlib takes memory that learning can use before

    assert model.regions is not None
    write_label_image(model.regions.label, folder.path("regions.png"))
    path = plan.path if plan else ()
    draw_overlay(model.regions, folder.path("overlay.png"), path=path, title=_title(plan), size=size)
    write_graph_json(model.graph, folder.path("graph.json"))
    write_graphml(model.graph, folder.path("graph.graphml"))
    write_model(model, folder.path(MODEL_FILE))
    folder.path(SCENARIO_FILE).write_text(dump_scenario(scenario), encoding="utf-8")
    return list(MAP_FILES)


def write_learning_files(folder: OutputFolder, training: Training, document: str) -> list[str]:
    """Write what was learned.  document: the JSON text of the run."""
    from qualrl.report.growth import draw_growth
    from qualrl.report.learning_curve import draw_learning_curve

    write_run(training, folder.path(TRAINING_FILE))
    folder.path("learn.json").write_text(document + "\n", encoding="utf-8")
    draw_learning_curve(training, folder.path("learning_curve.png"))
    if training.growth is None:
        return list(LEARNING_FILES)
    draw_growth(training.growth, folder.path(GROWTH_FILE))
    return [*LEARNING_FILES, GROWTH_FILE]


def write_plan(folder: OutputFolder, plan: Plan) -> str:
    """Write the plan as JSON.  Returns the name."""
    folder.path(PLAN_FILE).write_text(json.dumps(plan.to_dict(), indent=1) + "\n", encoding="utf-8")
    return PLAN_FILE


def _title(plan: Plan | None) -> str:
    if plan is None:
        return ""
    length = in_steps(plan.length_steps) + ("" if plan.length_m is None else f", {plan.length_m:.2f} m")
    return f"{' → '.join(plan.places)}   ({length})"
