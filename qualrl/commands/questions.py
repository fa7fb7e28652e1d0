"""What all questions to a plan share: a scenario's model, an answer in sentences, and its JSON twin."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from qualrl.answers.depth import Depth
from qualrl.commands.console import PARSING, Console
from qualrl.commands.options import PLACE

if TYPE_CHECKING:
    from qualrl.answers.answer import Answer
    from qualrl.models.hybrid_mdp import HybridMDP

From = Annotated[str | None, typer.Option("--from", metavar="PLACE", help=f"Where to start: {PLACE}.")]


GammaRange = Annotated[
    str | None,
    typer.Option(
        "--gamma", metavar="LOW..HIGH", help="Where moves slip: which way is better at which gamma, as 0.9..0.9999."
    ),
]
Span = tuple[float, float]

Kind = TypeVar("Kind", bound="Answer")


def asked(
    source: str, settings: list[str] | None, console: Console, ask: "Callable[[HybridMDP], Kind]"
) -> "tuple[HybridMDP, Kind]":
    """Build a scenario's model and ask it: both."""
    from qualrl.commands.inputs import scenario_of

    scenario = scenario_of(source, settings)
    with console.stage(PARSING):
        model = scenario.build()
    with console.stage("solving"):
        return model, ask(model)


def told(answer: "Answer", console: Console, depth: Depth) -> None:
    """Print an answer."""
    console.result(answer.to_dict(depth) if console.as_json else {}, lambda: print(answer.explain(depth)))


def answered(
    source: str, settings: list[str] | None, console: Console, depth: Depth, ask: "Callable[[HybridMDP], Answer]"
) -> None:
    """Build a scenario's model, ask it, and print the answer."""
    told(asked(source, settings, console, ask)[1], console, depth)


def span_of(option: str, text: str) -> Span:
    """An interval as it is written for an option, "0.6..0.9", or one number."""
    low, dots, high = text.partition("..")
    number = number_of(option, low)
    return number, number_of(option, high) if dots else number


def number_of(option: str, text: str) -> float:
    """A number as it is written for an option."""
    from qualrl.errors import ScenarioError

    try:
        return float(text)
    except ValueError:
        raise ScenarioError(f"{option}: {text.strip()!r} is no number; write 0.8, or an interval as 0.6..0.9") from None
