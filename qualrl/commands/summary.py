"""``qualrl summary``: the best policy in a sentence a region."""

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import answered


@guarded
def summary(
    source: ScenarioFile,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Sum up the best policy: the doorway to leave each region by, exceptions, and where the choice matters most."""
    from qualrl import questions

    answered(source, settings, Console(as_json, quiet), depth, questions.summary)
