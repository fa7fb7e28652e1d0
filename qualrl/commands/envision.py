"""``qualrl envision``: what may happen on the way to the goal."""

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, answered


@guarded
def envision(
    source: ScenarioFile,
    start: From = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Tell the states that may be passed, and for each how likely each way on is."""
    from qualrl import questions

    answered(source, settings, Console(as_json, quiet), depth, lambda model: questions.envision(model, start))
