"""``qualrl what-if``: what a change does to a plan."""

from collections.abc import Sequence
from typing import Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import PARSING, Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile
from qualrl.commands.questions import From, told


@guarded
def what_if(
    source: ScenarioFile,
    close: Annotated[
        list[str] | None, typer.Option("--close", metavar="DOORWAY", help="Or a region, for all of its doorways.")
    ] = None,
    opened: Annotated[
        str | None, typer.Option("--open", metavar="A,B", help="Open the thinnest wall between two regions.")
    ] = None,
    chance: Annotated[
        float | None, typer.Option("--chance", metavar="P", help="That what is closed is open after all.")
    ] = None,
    slip: Annotated[float | None, typer.Option("--slip", metavar="P", help="Change motion.slip.")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change any setting, as learn.gamma=0.9.")
    ] = None,
    start: From = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Change something: the plan before and after, what that costs, and where it begins to matter."""
    from qualrl import questions
    from qualrl.answers.changed_model import set_to
    from qualrl.commands.inputs import scenario_of
    from qualrl.errors import ScenarioError

    console = Console(as_json, quiet)
    scenario, asked = scenario_of(source), list(settings or [])
    option = f"motion.slip={slip}"
    if slip is not None:
        if any(setting.partition("=")[0].strip() == "motion.slip" for setting in asked):
            raise ScenarioError(f"--slip {slip:g}: --set gives motion.slip, too; give it once")
        asked.append(option)
    changed = scenario.with_settings(asked, {option: "--slip"}) if asked else scenario
    with console.stage(PARSING):
        before = scenario.build()
        after = before if changed == scenario else changed.build(before.regions if _on_same_map(asked) else None)
    with console.stage("solving"):
        pair = None if opened is None else _pair(opened, before.region_names)
        changes = tuple(set_to(setting.partition("=")[0].strip(), setting) for setting in asked)
        answer = questions.compared(before, after, start, changes, close=close or (), open=pair, chance=chance)
    told(answer, console, depth)


def _on_same_map(settings: list[str]) -> bool:
    """Whether settings change nothing that the map is cut by, or what its places are called."""
    keys = ("start", "goal", "seed", "motion.", "reward.", "learn.", "changes", "online")
    return all(setting.strip().startswith(keys) for setting in settings)


def _pair(text: str, known: Sequence[str]) -> tuple[str, str]:
    """Two regions' names around a comma."""
    from qualrl.errors import ScenarioError
    from qualrl.spatial.place import names_between_commas

    names = names_between_commas(text, known)
    if len(names) != 2:
        raise ScenarioError(f"--open {text!r}: name two regions with a comma between, as 'room A, corridor 1'")
    return names[0], names[1]
