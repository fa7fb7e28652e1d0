"""Learning with a progress bar on stderr: episode, steps, return, time left."""

import sys

from rich.console import Console as RichConsole
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from qualrl.api import Training, train
from qualrl.commands.console import Console
from qualrl.io.scenario import Scenario
from qualrl.learning.online import Online
from qualrl.learning.trainer import Milestone
from qualrl.models.hybrid_mdp import HybridMDP


def learn_with_progress(scenario: Scenario, model: HybridMDP, console: Console) -> Training:
    """Train as the scenario says."""
    settings = scenario.learn.model_dump(exclude={"algorithm", "gamma"})
    settings |= {"changes": scenario.door_changes(), "online": None}
    if scenario.online is not None:
        settings["online"] = Online(**scenario.online.model_dump())
    if console.quiet or not sys.stderr.isatty():
        return train(model, scenario.learn.algorithm, seed=scenario.seed, **settings)
    with Progress(
        TextColumn(f"learning ({scenario.learn.algorithm})"),
        BarColumn(),
        TextColumn("episode"),
        MofNCompleteColumn(),
        TextColumn("{task.fields[steps]} steps, return {task.fields[gain]}, left"),
        TimeRemainingColumn(),
        console=RichConsole(file=sys.stderr),
        transient=True,
    ) as bar:
        task = bar.add_task("", total=scenario.learn.episodes, steps=0, gain="-")

        def watch(stand: Milestone) -> None:
            gain = "-" if stand.last_return is None else f"{stand.last_return:.6g}"
            bar.update(task, completed=stand.episode, steps=f"{stand.total_steps:,}", gain=gain)

        return train(model, scenario.learn.algorithm, seed=scenario.seed, watch=watch, **settings)
