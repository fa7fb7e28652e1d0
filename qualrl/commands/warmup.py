"""``qualrl warmup``: compile the loops once, so that nothing waits for it later."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from typing import Annotated

import typer

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet

EPISODES, STEPS = 2, 50
COMPILED = dict[str, float]
"""CPU seconds of each part."""


@guarded
def warmup(
    everything: Annotated[
        bool, typer.Option("--all", help="Also for eight directions and for learning rates that fall.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compile the loops, a minute or two once after installing: later calls load what was compiled from a cache.

    They are those for four directions and a constant learning rate; other worlds compile theirs when first used.
    """
    console = Console(as_json, quiet)
    seconds: COMPILED = {}
    _compile(console, everything, seconds)

    def for_people() -> None:
        for name, spent in seconds.items():
            print(f"{name:24s}{spent:7.2f} s")
        print(f"{'all':24s}{sum(seconds.values()):7.2f} s of CPU; a second warmup only loads")

    console.result({"cpu_seconds": seconds}, for_people)


def _compile(console: Console, everything: bool, seconds: COMPILED) -> None:
    """Go through maps, plans and every learner, in worlds as small as can be."""
    from qualrl.api import build, check, plan, train
    from qualrl.io.scenario import load_scenario
    from qualrl.learning.online import Online
    from qualrl.learning.rules import RULES
    from qualrl.planning.routes import Routes
    from qualrl.questions import envision, summary, why_unreachable
    from qualrl.spatial.segmentation import segment

    @contextmanager
    def part(name: str) -> Iterator[None]:
        begun = time.process_time()
        with console.stage(f"compiling {name}"):
            yield
        seconds[name] = round(time.process_time() - begun, 2)

    with part("map of few cells"):
        regions = load_scenario("puzzle").regions()
    with part("map of a scanner"):
        scanned = load_scenario("slam").regions()
    with part("robot's radius"):
        segment(scanned.grid, radius_m=scanned.grid.resolution_m)
    goal, far = regions.regions[0].centre, regions.regions[-1].centre
    worlds = [
        build(regions, goal, start=far, slip=slip, directions=directions)
        for directions in ((4, 8) if everything else (4,))
        for slip in (0.0, 0.1)
    ]
    rates = (0.1, "1 / (k + 1)") if everything else (0.1,)
    with part("exact values"):
        for world in worlds:
            plan(world)
            summary(world)
            envision(world)
    with part("ways on the map"):
        Routes(regions).between(far, goal)
        Routes(regions).between(far, goal, exact=True)
    with part("what is in the way"):
        why_unreachable(worlds[0].with_closed(door.name for door in regions.doorways))
    with part("relations of places"):
        here, there = regions.region_names[:2]
        check(regions, [f"{here} north of {there}", f"{here} near {there}"])
    for name in RULES:
        with part(name):
            for world, alpha in product(worlds, rates):
                train(world, name, episodes=EPISODES, max_steps=STEPS, alpha=alpha)
    with part("map not known"):
        train(worlds[0], online=Online(), episodes=EPISODES, max_steps=STEPS)
