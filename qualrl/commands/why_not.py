"""``qualrl why-not``: why a plan does not go by a given place."""

from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import PLACE, AsJson, Debug, Quiet, ScenarioFile, Settings


@guarded
def why_not(
    source: ScenarioFile,
    via: Annotated[
        list[str], typer.Option("--via", metavar="PLACE", help="A region, doorway or landmark; more for an order.")
    ],
    start: Annotated[str | None, typer.Option("--from", metavar="PLACE", help=f"Where to start: {PLACE}.")] = None,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare the best way with the best one by some places: what that costs, and for which gamma it would win."""
    from qualrl import api
    from qualrl.commands.inputs import scenario_of

    console = Console(as_json, quiet)
    scenario = scenario_of(source, settings)
    with console.stage(PARSING):
        model = scenario.build()
    with console.stage("solving"):
        answer = api.why_not(model, via, start=start)
    console.result(answer.to_dict(), lambda: print(answer.explain()))
