"""The ``qualrl`` command: its subcommands, each in a file of its own."""

import re
import signal
import sys
from typing import Annotated, Any

import typer

from qualrl import __version__
from qualrl.commands.check import check
from qualrl.commands.convert import convert
from qualrl.commands.describe import describe
from qualrl.commands.envision import envision
from qualrl.commands.how_sure import how_sure
from qualrl.commands.learn import learn
from qualrl.commands.learners import learners
from qualrl.commands.plan import plan
from qualrl.commands.prove import prove
from qualrl.commands.reconcile import reconcile
from qualrl.commands.reproduce import reproduce
from qualrl.commands.robust import robust
from qualrl.commands.route import route
from qualrl.commands.run import run
from qualrl.commands.schema import schema
from qualrl.commands.show import show
from qualrl.commands.signs import signs
from qualrl.commands.summary import summary
from qualrl.commands.warmup import warmup
from qualrl.commands.what_if import what_if
from qualrl.commands.which_matters import which_matters
from qualrl.commands.why import why
from qualrl.commands.why_not import why_not
from qualrl.commands.why_unreachable import why_unreachable

app = typer.Typer(
    name="qualrl",
    no_args_is_help=True,
    rich_markup_mode=None,  # rich takes longer to import than all the rest
    pretty_exceptions_enable=False,
    help="From an occupancy map to a hybrid MDP, hierarchical Q-learning, and a plan that explains itself.",
    epilog="Exit codes: 0 fine, 1 no plan exists or a check failed, 2 bad input, 3 our fault.",
)


def _version(asked: bool) -> None:
    if asked:
        print(f"qualrl {__version__}")
        raise typer.Exit


@app.callback()
def qualrl(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Hold the options that stand before a subcommand."""


for command, in_short in (
    (run, "Map, model, learning, explained plan, pictures: all of it."),
    (show, "Describe a scenario or a map: regions, doors, landmarks."),
    (describe, "How regions lie to each other, or a route as one walks it."),
    (check, "Check what a scenario claims of its map."),
    (convert, "Map to hybrid MDP, pictures, graphs, a scenario to edit."),
    (learn, "Learn a scenario, beside the exact optimum."),
    (plan, "Plan between two places, and say why each step is taken."),
    (why, "Why the plan takes this doorway and not the next best."),
    (why_not, "Why the plan does not go by a place, and when it would."),
    (what_if, "What a closed door, an opened wall or another number changes."),
    (which_matters, "Which doorways and regions the plan hangs on."),
    (why_unreachable, "What is in the way of the goal, and what would open it."),
    (reconcile, "The smallest change that would make an expected plan best."),
    (robust, "Which way is best while chances and times are uncertain."),
    (signs, "Which way the plan's value goes when something grows."),
    (envision, "What may happen on the way, each branch with its probability."),
    (summary, "The best policy in a sentence a region, and exceptions."),
    (how_sure, "What was learned beside exact values, and how firm it is."),
    (route, "The shortest way between two places of a map."),
    (learners, "List the learners and what each converges to."),
    (schema, "Print the JSON Schema of scenario files, for editors."),
    (reproduce, "Measure a figure of the paper again, and judge it."),
    (warmup, "Compile the loops once, so that nothing waits later."),
):
    app.command(command.__name__.replace("_", "-"), short_help=in_short)(command)
app.add_typer(prove, name="prove", short_help="Prove or refute what a theorem asks for.")


def main() -> None:
    """Run the command.  SIGTERM ends it as Ctrl-C does, so that nothing half-written stays behind."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        sys.exit(app(standalone_mode=False))
    except Exception as error:
        if not hasattr(error, "format_message"):  # click's kind, wherever typer keeps it, says what to print
            raise
        if error.format_message():  # else the help was shown
            print(_usage(error), file=sys.stderr)
        sys.exit(2)


def _usage(error: Any) -> str:
    """One line of what the command line has wrong."""
    what = " ".join(error.format_message().split()).rstrip(".?").replace(". Did you mean", "; did you mean")
    if re.match(r"No such option: -\d", what):
        what += "; what begins with - goes after --"
    context = getattr(error, "ctx", None)
    path = "qualrl" if context is None else context.command_path
    return f"qualrl: {what[0].lower()}{what[1:]}; '{path} --help' shows how"
