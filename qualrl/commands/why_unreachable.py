"""``qualrl why-unreachable``: what is in the way of a goal that cannot be reached, and what would open it."""

import json
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, asked, told

if TYPE_CHECKING:
    from qualrl.answers.why_unreachable import WhyUnreachable
    from qualrl.io.output_folder import OutputFolder
    from qualrl.models.hybrid_mdp import HybridMDP

NO_PLAN = 1


@guarded
def why_unreachable(
    source: ScenarioFile,
    start: From = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for a picture and the JSON document.")
    ] = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Tell what is in the way of the goal, and the nearest radius, threshold or doorway that would open a way.

    Changes that the scenario makes while the robot learns are left aside.  Exit code 1 where no way leads to the goal.
    """
    from qualrl import questions
    from qualrl.commands.results import WHY_UNREACHABLE_FILES
    from qualrl.io.output_folder import OutputFolder

    console = Console(as_json, quiet)
    with OutputFolder(output, ours=WHY_UNREACHABLE_FILES) if output else nullcontext() as folder:
        as_asked = [*(settings or []), "changes=[]"]
        model, answer = asked(source, as_asked, console, lambda model: questions.why_unreachable(model, start))
        if folder is not None:
            with console.stage("drawing"):
                _write(folder, model, answer)
    told(answer, console, depth)
    if output and not as_json:
        console.result({}, lambda: print(f"The picture is {output / WHY_UNREACHABLE_FILES[0]}."))
    if not answer.is_reachable:
        raise typer.Exit(NO_PLAN)


def _write(folder: "OutputFolder", model: "HybridMDP", answer: "WhyUnreachable") -> None:
    from qualrl.commands.results import WHY_UNREACHABLE_FILES
    from qualrl.report.blocked_map import draw_blocked

    assert model.regions is not None
    picture, document = WHY_UNREACHABLE_FILES
    draw_blocked(model.regions, answer, folder.path(picture))
    folder.path(document).write_text(json.dumps(answer.to_dict(), indent=1) + "\n", encoding="utf-8")
