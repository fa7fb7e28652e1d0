"""``qualrl which-matters``: which doorways and regions a plan hangs on."""

from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import PLACE, AsJson, Debug, Quiet, ScenarioFile, Settings


@guarded
def which_matters(
    source: ScenarioFile,
    start: Annotated[str | None, typer.Option("--from", metavar="PLACE", help=f"Where to start: {PLACE}.")] = None,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Close each doorway and region in turn: what is lost without it, and the fewest that cut the goal off."""
    from qualrl import api
    from qualrl.commands.inputs import scenario_of

    console = Console(as_json, quiet)
    scenario = scenario_of(source, settings)
    with console.stage(PARSING):
        model = scenario.build()
    with console.stage("solving"):
        answer = api.which_matters(model, start=start)
    console.result(answer.to_dict(), lambda: print(answer.explain()))
