"""``qualrl prove theorem1``: is the qualitative level of a map a semi-MDP with the values of the flat MDP?"""

from dataclasses import replace
from typing import Annotated

import typer

from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet, ScenarioFile, Settings

CHECK_FAILED = 1


@guarded
def theorem1(
    scenario_file: ScenarioFile,
    start: Annotated[
        str | None, typer.Option("--from", metavar="PLACE", help="Another start than the scenario's.")
    ] = None,
    level: Annotated[int, typer.Option(help="Which level to check: 2 = regions, 3 = wings.")] = 2,
    settings: Settings = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Fold each region exactly and compare with the flat MDP: equal, or a counterexample (exit code 1)."""
    from qualrl.commands.inputs import scenario_of
    from qualrl.models.levels import groupings
    from qualrl.solving.theorem1 import audit_theorem1
    from qualrl.solving.theorem1_words import explained
    from qualrl.spatial.place import read_place

    console = Console(as_json, quiet)
    scenario = scenario_of(scenario_file, settings)
    with console.stage(PARSING):
        model = scenario.build()
    model = replace(model, coarser=groupings(model.graph, level))
    state = None if start is None else model.state_at(read_place(start))
    with console.stage("folding regions and solving"):
        audit = audit_theorem1(model, level, state)
    console.result(audit.to_dict(), lambda: print(explained(audit)))
    if not audit.holds:
        raise typer.Exit(CHECK_FAILED)
