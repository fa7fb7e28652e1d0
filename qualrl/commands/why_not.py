"""``qualrl why-not``: why a plan does not go by a given place."""

from typing import Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, GammaRange, answered, span_of


@guarded
def why_not(
    source: ScenarioFile,
    via: Annotated[
        list[str], typer.Option("--via", metavar="PLACE", help="A region, doorway or landmark; more for an order.")
    ],
    start: From = None,
    gamma: GammaRange = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare the best way with the best one by some places: what that costs, and for which gamma it would win."""
    from qualrl import questions

    gammas = None if gamma is None else span_of("--gamma", gamma)
    answered(
        source,
        settings,
        Console(as_json, quiet),
        depth,
        lambda model: questions.why_not(model, via, start=start, gammas=gammas),
    )
