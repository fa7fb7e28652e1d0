"""``qualrl signs``: which way a plan's value goes when something about it grows."""

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, answered


@guarded
def signs(
    source: ScenarioFile,
    start: From = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Tell the sign of the change of the plan's value with rewards, length, doorways' chances and gamma."""
    from qualrl import questions

    answered(source, settings, Console(as_json, quiet), depth, lambda model: questions.signs(model, start))
