"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from qualrl.answers.depth import Depth

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else there.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors (and JSON, if asked).")]
Debug = Annotated[bool, typer.Option("--debug", help="On an error, also show where in the program it arose.")]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results [default: results/NAME].")
]
ScenarioFile = Annotated[str, typer.Argument(metavar="SCENARIO", help="A scenario file, or the name of a bundled one.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change any setting of the scenario, as learn.alpha=0.05."),
]
Algorithm = Annotated[
    str | None, typer.Option("--algorithm", help="The learner, as hql, hql-replay or q-lambda; the README lists all.")
]
Episodes = Annotated[int | None, typer.Option("--episodes", help="How many episodes to learn.")]
Unknown = Annotated[bool, typer.Option("--online", help="The robot does not know the map; it sees what is near.")]
Radius = Annotated[float | None, typer.Option("--radius", metavar="METRES", help="How far it sees; implies --online.")]
Seed = Annotated[int | None, typer.Option("--seed", help="Seed of the random stream.")]
PictureSize = Annotated[
    str | None,
    typer.Option(
        "--size", metavar="WIDTHxHEIGHT", help="Pixels of overlay.png, as 600x400; without it what suits the map."
    ),
]
Resolution = Annotated[
    float | None, typer.Option("--resolution", help="Metres a pixel, for an image without a map YAML.")
]
ScenarioOrMap = Annotated[
    str, typer.Argument(metavar="SCENARIO_OR_MAP", help="A scenario, or a map: image, YAML, .map.")
]
RobotRadius = Annotated[
    float | None, typer.Option("--robot-radius", metavar="METRES", help="Only where a robot of this radius fits.")
]
DepthOption = Annotated[
    Depth,
    typer.Option("--depth", help="How much to tell: places and their order, signs of amounts too, or numbers too."),
]
PLACE = "a name, row,col in whole numbers, or x,y in metres with a decimal point"
