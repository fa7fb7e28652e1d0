"""``qualrl plan``: a plan between any two places."""

from typing import TYPE_CHECKING, Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import PLACE, AsJson, Debug, Quiet, Settings

if TYPE_CHECKING:
    from qualrl.api import Training
    from qualrl.models.hybrid_mdp import HybridMDP


@guarded
def plan(
    source: Annotated[
        str, typer.Argument(metavar="SCENARIO_OR_DIR", help="A scenario, or a folder that learn or run wrote.")
    ],
    start: Annotated[str | None, typer.Option("--from", metavar="PLACE", help=f"Where to start: {PLACE}.")] = None,
    goal: Annotated[str | None, typer.Option("--to", metavar="PLACE", help=f"Where to go: {PLACE}.")] = None,
    exact: Annotated[bool, typer.Option("--exact", help="Use exact values, not what was learned.")] = False,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Plan between two places, from what was learned or exactly, and say why each step is taken."""
    from qualrl import api
    from qualrl.commands.inputs import scenario_of
    from qualrl.commands.learned import TRAINING_FILE, model_in, training_in
    from qualrl.commands.tables import print_plan
    from qualrl.errors import ScenarioError
    from qualrl.io.bundled import SCENARIO_SUFFIX, found

    console = Console(as_json, quiet)
    path = found(source, SCENARIO_SUFFIX)
    known: HybridMDP | Training
    if path.is_dir():
        if settings:
            raise ScenarioError("--set changes a scenario; a result folder stays as it is")
        known = model_in(path)
        if (path / TRAINING_FILE).is_file():
            known = training_in(path, known)
    else:
        scenario = scenario_of(source, settings)
        with console.stage(PARSING):
            known = scenario.build()
    with console.stage("solving"):
        made = api.plan(known, start, goal=goal, exact=exact)
    if not isinstance(known, api.Training) and not exact:
        console.note("nothing has been learned here yet, so the plan is the exact one; 'qualrl run' learns first")
    console.result(made.to_dict(), lambda: print_plan(made))
