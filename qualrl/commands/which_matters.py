"""``qualrl which-matters``: which doorways and regions a plan hangs on."""

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, answered


@guarded
def which_matters(
    source: ScenarioFile,
    start: From = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Close each doorway and region in turn: what is lost without it, and the fewest that cut the goal off."""
    from qualrl import questions

    answered(source, settings, Console(as_json, quiet), depth, lambda model: questions.which_matters(model, start))
