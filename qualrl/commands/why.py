"""``qualrl why``: why a plan takes this doorway and not the next best."""

from typing import Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, GammaRange, answered, span_of


@guarded
def why(
    source: ScenarioFile,
    at: Annotated[
        str | None, typer.Option("--at", metavar="REGION", help="Where to ask it; by default at the start.")
    ] = None,
    start: From = None,
    gamma: GammaRange = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare the plan's next doorway with the next best one: the difference in value by region and kind of reward."""
    from qualrl import questions

    gammas = None if gamma is None else span_of("--gamma", gamma)
    answered(
        source, settings, Console(as_json, quiet), depth, lambda model: questions.why(model, at, start, gammas=gammas)
    )
