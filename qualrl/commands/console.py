"""What the command prints: results on stdout, everything else on stderr."""

import contextlib
import functools
import json
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ParamSpec

import typer

from qualrl.errors import QualrlError

if TYPE_CHECKING:
    from qualrl.spatial.region_map import RegionMap

Parameters = ParamSpec("Parameters")

OUR_FAULT = 3
READER_GONE = 141
"""As for any program that SIGPIPE ends."""
PARSING = "finding regions (the first time also compiling, about 10 s)"


@dataclass(frozen=True)
class Console:
    """How one call of the command was asked to speak."""

    as_json: bool
    quiet: bool

    def result(self, document: dict[str, Any], show: Callable[[], None]) -> None:
        """The result: the JSON document alone, or for people (unless quiet)."""
        if self.as_json:
            print(json.dumps(document, ensure_ascii=False))
        elif not self.quiet:
            show()

    @contextlib.contextmanager
    def stage(self, what: str) -> Iterator[None]:
        """Say on stderr what is being done, as long as it lasts, to someone who watches."""
        if self.quiet or not sys.stderr.isatty():
            yield
            return
        from rich.console import Console as RichConsole

        with RichConsole(stderr=True).status(what):
            yield

    def warn_of(self, regions: "RegionMap") -> None:
        """What the reader of a map found odd."""
        for warning in regions.grid.warnings:
            self.note(f"{regions.grid.source}: {warning}")

    def note(self, text: str) -> None:
        """A remark on stderr."""
        if not self.quiet:
            print(f"qualrl: {text}", file=sys.stderr)


def guarded(command: Callable[Parameters, None]) -> Callable[Parameters, None]:
    """Turn errors into one clear line and an exit code; with --debug show where they arose."""

    @functools.wraps(command)
    def run(*args: Parameters.args, **kwargs: Parameters.kwargs) -> None:
        try:
            command(*args, **kwargs)
        except QualrlError as error:
            _report(f"qualrl: {error}", kwargs)
            raise typer.Exit(error.exit_code) from None
        except BrokenPipeError:
            sys.stderr.close()  # whoever read us has gone; nothing is left to say
            raise typer.Exit(READER_GONE) from None
        except OSError as error:
            _report(f"qualrl: cannot read or write: {error}; check space and permissions", kwargs)
            raise typer.Exit(2) from None
        except MemoryError:
            _report("qualrl: this does not fit into memory; use a smaller map or a coarser one", kwargs)
            raise typer.Exit(2) from None
        except (typer.Exit, typer.Abort, KeyboardInterrupt):
            raise
        except Exception as error:
            if type(error).__module__.startswith(("click", "typer")):
                raise
            _report(
                f"qualrl: our fault: {type(error).__name__}: {error}; please report it, with --debug's output", kwargs
            )
            raise typer.Exit(OUR_FAULT) from None

    return run


def _report(line: str, options: dict[str, Any]) -> None:
    if options.get("debug"):
        traceback.print_exc()
    print(line, file=sys.stderr)
