"""``qualrl how-sure``: what was learned, beside exact values."""

from pathlib import Path
from typing import Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet
from qualrl.commands.questions import From, told


@guarded
def how_sure(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that run or learn wrote.")],
    start: From = None,
    count: Annotated[
        bool, typer.Option("--count", help="Learn once more, to count visits, where the learner did not.")
    ] = False,
    depth: DepthOption = Depth.NUMBERS,
    seeds: Annotated[
        int, typer.Option("--seeds", metavar="N", min=0, help="Learn with N other seeds, to see whether they agree.")
    ] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare what was learned with exact values: errors, visits, and whether the two best actions are in order."""
    from qualrl.api import farthest_start
    from qualrl.commands.learned import model_in, training_in
    from qualrl.errors import ScenarioError

    console = Console(as_json, quiet)
    if not folder.is_dir():
        raise ScenarioError(f"{folder}: is no folder; name one that 'qualrl run' or 'qualrl learn' wrote")
    with console.stage("reading"):
        training = training_in(folder, model_in(folder))
    with console.stage("solving exactly, to compare"):
        begin = farthest_start(training.model) if start is None and training.model.start is None else start
        answer = training.how_sure(begin, count=count, seeds=seeds)
    told(answer, console, depth)
