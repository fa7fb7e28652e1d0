"""The ``qualrl`` command: its subcommands, each in a file of its own that is loaded when it is called."""

import gc
import re
import signal
import sys
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from qualrl import __version__

PYDANTIC = {
    "Value error, ": "", "Input should be a valid number, unable to parse string as a number": "write a number",
    "Input should be a valid integer, unable to parse string as an integer": "write a whole number",
    "Input should be a valid integer, got a number with a fractional part": "write a whole number",
    "Input should be": "it must be",
}  # fmt: skip
"""What its messages begin with, in plain words."""
IN_SHORT = {
    "run": "Map, model, learning, explained plan, pictures: all of it.",
    "show": "Describe a scenario or a map: regions, doors, landmarks.",
    "describe": "How regions lie to each other, or a route as one walks it.",
    "check": "Check what a scenario claims of its map.",
    "convert": "Map to hybrid MDP, pictures, graphs, a scenario to edit.",
    "learn": "Learn a scenario, beside the exact optimum.",
    "plan": "Plan between two places, and say why each step is taken.",
    "why": "Why the plan takes this doorway and not the next best.",
    "why-not": "Why the plan does not go by a place, and when it would.",
    "what-if": "What a closed door, an opened wall or another number changes.",
    "which-matters": "Which doorways and regions the plan hangs on.",
    "why-unreachable": "What is in the way of the goal, and what would open it.",
    "reconcile": "The smallest change that would make an expected plan best.",
    "robust": "Which way is best while chances and times are uncertain.",
    "signs": "Which way the plan's value goes when something grows.",
    "envision": "What may happen on the way, each branch with its probability.",
    "summary": "The best policy in a sentence a region, and exceptions.",
    "how-sure": "What was learned beside exact values, and how firm it is.",
    "route": "The shortest way between two places of a map.",
    "learners": "List the learners and what each converges to.",
    "schema": "Print the JSON Schema of scenario files, for editors.",
    "reproduce": "Measure a figure of the paper again, and judge it.",
    "warmup": "Compile the loops once, so that nothing waits later.",
    "prove": "Prove or refute what a theorem asks for.",
}
"""What the help says of each subcommand, in its order."""


class Subcommands(TyperGroup):
    """The subcommands; the help knows them by name only, and what is called is loaded first."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name, in_short in IN_SHORT.items():
            self.add_command(TyperCommand(name, short_help=in_short, rich_markup_mode=None))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The subcommand that the words of a command line call, and the words left to it."""
        if args[0] in IN_SHORT:
            self.commands[args[0]] = loaded(args[0])
        return super().resolve_command(ctx, args)


def loaded(name: str) -> Any:
    """A subcommand with its options, from the file that has its name."""
    here = name.replace("-", "_")
    command = getattr(import_module(f"qualrl.commands.{here}"), here)
    if not isinstance(command, typer.Typer):
        holder = typer.Typer(add_completion=False, rich_markup_mode=None)
        holder.command(name)(command)
        command = holder
    return typer.main.get_command(command)


app = typer.Typer(
    name="qualrl",
    cls=Subcommands,
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


def main() -> None:
    """Run the command.  SIGTERM ends it as Ctrl-C does, so that nothing half-written stays behind."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    gc.set_threshold(20_000)  # hardly anything that a module makes when it is loaded is garbage
    try:
        sys.exit(app(standalone_mode=False))
    except Exception as error:
        if not hasattr(error, "format_message"):  # click's kind, wherever typer keeps it, says what to print
            raise
        told = error.format_message()  # the help where nothing was asked, and nothing once that was shown
        if told:
            print(told if told.startswith("Usage:") else _usage(error), file=sys.stderr)
        sys.exit(2)
    finally:
        gc.freeze()  # what is left goes with the process, and need not be taken apart first


def _usage(error: Any) -> str:
    """One line of what the command line has wrong."""
    what = " ".join(error.format_message().split()).rstrip(".?").replace(". Did you mean", "; did you mean")
    for begun, plain in PYDANTIC.items():
        what = what.replace(begun, plain)
    if re.match(r"No such option: -\d", what):
        what += "; what begins with - goes after --"
    context = getattr(error, "ctx", None)
    path = "qualrl" if context is None else context.command_path
    return f"qualrl: {what[0].lower()}{what[1:]}; '{path} --help' shows how"
