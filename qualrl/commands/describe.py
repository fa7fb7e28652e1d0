"""``qualrl describe``: a map in relations between its places."""

from typing import Annotated

import typer

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import PLACE, AsJson, Debug, Quiet, Resolution, RobotRadius, ScenarioOrMap


@guarded
def describe(
    source: ScenarioOrMap,
    of: Annotated[str | None, typer.Option("--of", metavar="NAME", help="What lies where from a region.")] = None,
    start: Annotated[str | None, typer.Option("--from", metavar="PLACE", help=f"Tell a route from: {PLACE}.")] = None,
    goal: Annotated[str | None, typer.Option("--to", metavar="PLACE", help="And to where.")] = None,
    resolution_m: Resolution = None,
    robot_radius_m: RobotRadius = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Say how the regions of a map lie to each other, or how a walker gets from one place to another."""
    from qualrl.commands.inputs import relations_of
    from qualrl.errors import SettingError
    from qualrl.planning import describe as questions

    if (start is None) != (goal is None) or (of is not None and goal is not None):
        raise SettingError("say either --of NAME, or both --from PLACE and --to PLACE, or none of them")
    console = Console(as_json, quiet)
    relations, cuts = relations_of(console, source, resolution_m, robot_radius_m)
    ends = None if start is None or goal is None else (start, goal)
    answer = questions.describe(relations, cuts, of, ends)
    console.result(answer.to_dict(), lambda: print(answer.explain()))
