"""``qualrl check``: a scenario's claims against its map and against each other."""

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet, ScenarioFile, Settings

FAILED = 1


@guarded
def check(
    source: ScenarioFile,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Check a scenario's claims against its map and against each other; exit code 1 if one is false or some clash."""
    from qualrl.commands.inputs import scenario_of
    from qualrl.errors import ScenarioError

    console = Console(as_json, quiet)
    scenario = scenario_of(source, settings)
    if not scenario.claims:
        raise ScenarioError(f"{source}: has no claims to check; add a line 'claims: [\"room A north of room B\"]'")
    with console.stage(PARSING):
        regions = scenario.regions()
    console.warn_of(regions)
    answer = scenario.check(regions)
    console.result(answer.to_dict(), lambda: print(answer.explain()))
    if not answer.holds:
        raise typer.Exit(FAILED)
