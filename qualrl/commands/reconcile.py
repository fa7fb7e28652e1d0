"""``qualrl reconcile``: what would have to change for an expected plan to be best."""

from typing import Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, answered


@guarded
def reconcile(
    source: ScenarioFile,
    expect: Annotated[
        str, typer.Option("--expect", metavar="PLACES", help="Regions in their order, as 'room A, corridor 1, room C'.")
    ],
    start: From = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the smallest change of the map under which the plan that you expect would be best."""
    from qualrl import questions

    answered(source, settings, Console(as_json, quiet), depth, lambda model: questions.reconcile(model, expect, start))
