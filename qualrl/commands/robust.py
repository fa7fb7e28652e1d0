"""``qualrl robust``: which way is best while chances and times are known as intervals only."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, DepthOption, Quiet, ScenarioFile, Settings
from qualrl.commands.questions import From, Span, answered, number_of, span_of

if TYPE_CHECKING:
    from qualrl.qualitative.from_counts import Counts, Samples


@guarded
def robust(
    source: ScenarioFile,
    chance: Annotated[
        list[str] | None,
        typer.Option("--chance", metavar="DOORWAY=P", help="That it is open: an interval 0.6..0.9, or a count 7/10."),
    ] = None,
    time: Annotated[
        list[str] | None,
        typer.Option(
            "--time",
            metavar="REGION=F",
            help="How many times as long as on the map it takes: 1..1.5, or as measured 1.1,1.4,0.9; * for all others.",
        ),
    ] = None,
    slip: Annotated[
        str | None,
        typer.Option(
            "--slip", metavar="P", help="That a move slips, instead: an interval 0.05..0.2, or a count 37/400."
        ),
    ] = None,
    confidence: Annotated[
        float, typer.Option("--confidence", metavar="P", help="With which all that is counted holds at once.")
    ] = 0.95,
    ways: Annotated[int, typer.Option("--ways", metavar="N", min=1, help="How many ways to compare at most.")] = 6,
    start: From = None,
    settings: Settings = None,
    depth: DepthOption = Depth.NUMBERS,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare ways while doorways and times are uncertain: which is better for all numbers, and which for some."""
    from qualrl import questions

    doors, times = _named("--chance", chance or ()), _named("--time", time or ())
    answered(
        source, settings, Console(as_json, quiet), depth,
        lambda model: questions.robust(
            model, start, doors={name: _chance("--chance", text) for name, text in doors.items()},
            times={name: _time(text) for name, text in times.items()},
            slip=None if slip is None else _chance("--slip", slip), confidence=confidence, most=ways,
        ),
    )  # fmt: skip


def _named(option: str, texts: Iterable[str]) -> dict[str, str]:
    from qualrl.errors import ScenarioError

    found = dict[str, str]()
    for text in texts:
        name, equals, value = (part.strip() for part in text.rpartition("="))
        if not equals or not name:
            raise ScenarioError(f"{option} {text!r}: write a name, = and what is known, as 'door 2=0.6..0.9'")
        if name in found:
            raise ScenarioError(f"{option} {text!r}: {name} was given before, as {found[name]}")
        found[name] = value
    return found


def _chance(option: str, text: str) -> "Span | Counts":
    from qualrl.errors import ScenarioError
    from qualrl.qualitative.from_counts import Counts

    hits, slash, trials = text.partition("/")
    if not slash:
        return span_of(option, text)
    if not (hits.strip().isdecimal() and trials.strip().isdecimal()):
        raise ScenarioError(f"{option} {text!r}: write a count in whole numbers, as 7/10")
    return Counts(int(hits), int(trials))


def _time(text: str) -> "Span | Samples":
    from qualrl.qualitative.from_counts import Samples

    if "," in text:
        return Samples(tuple(number_of("--time", part) for part in text.split(",")))
    return span_of("--time", text)
