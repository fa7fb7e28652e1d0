"""``qualrl warmup``: compile all loops once, so that nothing waits for it later."""

from collections.abc import Callable, Iterator

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet

MAPS = ("puzzle", "slam")
"""A drawing of few cells, and a scan: their regions are found in different ways."""
EPISODES, STEPS = 2, 50


@guarded
def warmup(as_json: AsJson = False, quiet: Quiet = False, debug: Debug = False) -> None:
    """Compile every loop, about a minute once after installing: later calls load what was compiled from a cache."""
    import time

    console = Console(as_json, quiet)
    seconds = {}
    for name, step in _steps():
        begun = time.process_time()
        with console.stage(f"compiling {name}"):
            step()
        seconds[name] = round(time.process_time() - begun, 2)

    def for_people() -> None:
        for name, spent in seconds.items():
            print(f"{name:24s}{spent:7.2f} s")
        print(f"{'all':24s}{sum(seconds.values()):7.2f} s of CPU; a second warmup only loads")

    console.result({"cpu_seconds": seconds}, for_people)


def _steps() -> Iterator[tuple[str, Callable[[], object]]]:
    """What compiles: maps, models and plans first, then each learner."""
    from qualrl.api import build, plan, train
    from qualrl.io.scenario import load_scenario
    from qualrl.learning.online import Online
    from qualrl.learning.rules import RULES
    from qualrl.planning.routes import Routes
    from qualrl.spatial.region_map import RegionMap
    from qualrl.spatial.segmentation import segment

    found: list[RegionMap] = []
    for name in MAPS:
        scenario = load_scenario(name)
        yield f"map {name}", lambda scenario=scenario: found.append(scenario.regions())  # type: ignore[misc]
    yield "robot's radius", lambda: segment(found[1].grid, radius_m=found[1].grid.resolution_m)
    regions = found[0]
    goal = regions.regions[0].centre
    models = [build(regions, goal, slip=slip) for slip in (0.0, 0.1)]
    far = regions.regions[-1].centre
    for model, name in zip(models, ("exact values", "exact values under slip"), strict=True):
        yield name, lambda model=model: plan(model, far)  # type: ignore[misc]
    yield "ways on the map", lambda: [Routes(regions).between(goal, far, exact=exact) for exact in (False, True)]
    for name in RULES:
        yield (
            name,
            lambda name=name: [  # type: ignore[misc]
                train(model, name, episodes=EPISODES, max_steps=STEPS) for model in models
            ],
        )
    fixed = build(regions, goal, start=far)
    yield "map not known", lambda: train(fixed, online=Online(), episodes=EPISODES, max_steps=STEPS)
