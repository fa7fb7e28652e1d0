"""The ``qualrl`` command: its subcommands, each in a file of its own."""

import signal
import sys
from typing import Annotated

import typer

from qualrl import __version__
from qualrl.commands.convert import convert
from qualrl.commands.learn import learn
from qualrl.commands.learners import learners
from qualrl.commands.plan import plan
from qualrl.commands.prove import prove
from qualrl.commands.reproduce import reproduce
from qualrl.commands.run import run
from qualrl.commands.schema import schema
from qualrl.commands.show import show

app = typer.Typer(
    name="qualrl",
    no_args_is_help=True,
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


for command in (run, show, convert, learn, plan, learners, schema, reproduce):
    app.command()(command)
app.add_typer(prove, name="prove")


def main() -> None:
    """Run the command.  SIGTERM ends it as Ctrl-C does, so that nothing half-written stays behind."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    app()
