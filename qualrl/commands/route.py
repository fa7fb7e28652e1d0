"""``qualrl route``: the shortest way between two places of a map, without a goal, a model or learning."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import PLACE, AsJson, Debug, Quiet, Resolution, RobotRadius, ScenarioOrMap
from qualrl.planning.plan import in_steps

if TYPE_CHECKING:
    from qualrl.planning.routes import Route


@guarded
def route(
    source: ScenarioOrMap,
    start: Annotated[str, typer.Option("--from", metavar="PLACE", help=f"Where to start: {PLACE}.")],
    goal: Annotated[str, typer.Option("--to", metavar="PLACE", help=f"Where to go: {PLACE}.")],
    resolution_m: Resolution = None,
    robot_radius_m: RobotRadius = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find a shortest way between two places of a map, in steps up, down, left and right."""
    from qualrl.commands.inputs import regions_of
    from qualrl.planning.routes import Routes

    console = Console(as_json, quiet)
    regions = regions_of(console, source, resolution_m, robot_radius_m)
    found = Routes(regions).between(start, goal, exact=True)
    console.result(_document(found), lambda: _print(found, (start, goal)))


def _document(found: "Route") -> dict[str, Any]:
    return {
        "regions": list(found.regions), "doors": list(found.doors), "steps": found.steps, "length_m": found.length_m,
        "path": found.path.tolist(),
    }  # fmt: skip


def _print(found: "Route", ends: tuple[str, str]) -> None:
    """The way from region to region."""
    print(f"from {ends[0]} to {ends[1]}: {in_steps(found.steps)}, {found.length_m:.2f} m")
    print(f"  in {found.regions[0]}")
    for door, region in zip(found.doors, found.regions[1:], strict=True):
        print(f"  through {door} into {region}")
