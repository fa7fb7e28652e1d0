"""``qualrl prove``: what the theorems ask for, proved or refuted, with the certificate."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet
from qualrl.commands.prove_theorem1 import theorem1

if TYPE_CHECKING:
    from qualrl.io.scenario import Scenario
    from qualrl.qualitative.convergence import ScheduleProof
    from qualrl.qualitative.formula import Formula
    from qualrl.qualitative.landmark_weights import LandmarkWeights

MOST_PARAMETERS = 2
SHOWN_FOR = {"proved": "holds", "refuted": "FAILS", "undecided": "cannot decide"}
CONSTANT = (
    "alpha {text} is constant: the sum of its squares diverges, so Theorem 2 does not apply. Q-learning with it never "
    "forgets to move: where outcomes are random its values keep hovering about the right ones, within a band that "
    "shrinks with alpha; only where nothing is random do they settle. The paper's own experiments are of this kind "
    "(alpha 0.01 to 0.20). A rate that meets both conditions is 1/(1+k)**0.85"
)
COUNTERS = {
    "run": "one counter for the whole run: each weight is used once, so the total above is all there is",
    "pair": "one counter for each landmark and action: the total above holds for each of them",
    "episode": (
        "eta starts again at eta0 in every episode, so over all episodes the weights have no finite total: "
        "the landmark step may disturb the values for ever, and Theorem 2 does not cover it"
    ),
}

AVERAGING = "1/(1+k)"
"""The learning rate by which a mean is kept up to date."""

prove = typer.Typer(
    name="prove",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="Prove or refute what a theorem asks for, and show the certificate.",
)


@guarded
def schedule(
    source: Annotated[
        str, typer.Argument(metavar="FORMULA_OR_SCENARIO", help='As "1/(1+k)**0.6", or a scenario with its alpha.')
    ],
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Theorem 2: does the learning rate's sum diverge, and the sum of its squares converge?

    k counts from 0. Up to two further lower-case names are positive parameters: "1/(1+k)**w" asks for which w.
    Exit code 0: both are proved, for every parameter (and a scenario's landmark weights have a finite total);
    1: one is refuted or cannot be decided.
    """
    from qualrl.commands.inputs import scenario_of
    from qualrl.qualitative.convergence import Verdict, robbins_monro
    from qualrl.qualitative.landmark_weights import landmark_weights

    console = Console(as_json, quiet)
    scenario = scenario_of(source) if _names_a_file(source) else None
    formula = _formula(source) if scenario is None else _alpha_of(scenario)
    with console.stage("proving (20 s at most)"):
        proof = robbins_monro(formula)
    weights = None
    if scenario is not None and scenario.learn.algorithm == "hql":
        weights = landmark_weights(scenario.learn.eta0, scenario.learn.eta_power)
    counter = None if scenario is None or weights is None or weights.eta0 == 0 else scenario.learn.eta_counter
    document = _document(source, formula, proof, weights, counter)
    if scenario is not None and formula.text == AVERAGING != scenario.learn.alpha:
        document["notes"].append(
            f"{scenario.learn.algorithm} keeps means of what it has seen, which is this rate; learn.alpha is not used"
        )
    console.result(document, lambda: _show(document))
    if not (proof.holds is Verdict.PROVED and counter != "episode"):
        raise typer.Exit(1)


for command, in_short in (
    (schedule, "Theorem 2's conditions on a learning rate."),
    (theorem1, "Theorem 1 on a map: is each region folded exactly?"),
):
    prove.command(short_help=in_short)(command)


def _names_a_file(source: str) -> bool:
    """Whether this names a scenario rather than being a formula."""
    from qualrl.io.bundled import SCENARIO_SUFFIX, found

    try:
        return source.endswith((".yaml", ".yml")) or found(source, SCENARIO_SUFFIX).is_file()
    except (OSError, ValueError):  # too long for a file's name, or with characters that none can have
        return False


def _formula(text: str) -> "Formula":
    from qualrl.errors import FormulaError, did_you_mean
    from qualrl.io.bundled import bundled_names
    from qualrl.qualitative.formula import parse_formula

    formula = parse_formula(text, most_parameters=MOST_PARAMETERS)
    if formula.names and "k" not in formula.names:
        tail = did_you_mean(text, bundled_names()) if text.isidentifier() else "write it with k = 0, 1, 2, ..."
        raise FormulaError(f"{text}: neither a formula in k nor a scenario that exists; {tail}")
    return formula


def _alpha_of(scenario: "Scenario") -> "Formula":
    """The scenario's alpha, or what averaging comes to for a learner that keeps counts."""
    from qualrl.learning.rules import rule_named
    from qualrl.learning.schedule import schedule_of

    return schedule_of(AVERAGING if rule_named(scenario.learn.algorithm).averages else scenario.learn.alpha).formula


def _document(
    source: str, formula: "Formula", proof: "ScheduleProof", weights: "LandmarkWeights | None", counter: str | None
) -> dict[str, Any]:
    """All that was found, for JSON and for people."""
    landmark = None
    if weights is not None:
        landmark = {
            "eta0": weights.eta0,
            "eta_power": weights.m,
            "eta_counter": counter,
            "total": list(weights.total),
            "kept": list(weights.kept),
            "lines": [*weights.lines, *([COUNTERS[counter]] if counter else [])],
            "verdict": "refuted" if counter == "episode" else "proved",
        }
    return {
        "source": source,
        "alpha": proof.text,
        "sum_diverges": proof.sum_diverges.value,
        "squares_converge": proof.squares_converge.value,
        "holds": proof.holds.value,
        "range": proof.range,
        "sum_lines": list(proof.sum_lines),
        "squares_lines": list(proof.squares_lines),
        "landmark_weights": landmark,
        "notes": _notes(formula),
    }


def _notes(formula: "Formula") -> list[str]:
    """What a proof about infinitely many k does not say: whether this can be used, and what a constant means."""
    from qualrl.errors import FormulaError, SettingError
    from qualrl.learning.schedule import schedule_of

    if not formula.names:
        return [CONSTANT.format(text=formula.text)]
    if formula.names != ("k",):
        return []
    try:
        schedule_of(formula.text)
    except (FormulaError, SettingError) as problem:
        return [f"finitely many k do not matter to the sums, but a learner would refuse this: {problem}"]
    return []


def _show(document: dict[str, Any]) -> None:
    print(f"alpha_k = {document['alpha']}, k = 0, 1, 2, ... updates of a state and action")
    for claim, verdict, lines in (
        ("sum of alpha_k = infinity", "sum_diverges", "sum_lines"),
        ("sum of alpha_k**2 < infinity", "squares_converge", "squares_lines"),
    ):
        depends = document["range"] and document[verdict] == "undecided"
        _show_claim(claim, "for some values" if depends else SHOWN_FOR[document[verdict]], document[lines])
    landmark = document["landmark_weights"]
    if landmark:
        name = f"sum of eta_n < infinity, eta_n = {landmark['eta0']:g}**({landmark['eta_power']:g}**n)"
        _show_claim(name, SHOWN_FOR[landmark["verdict"]], landmark["lines"])
    print(_conclusion(document))
    for note in document["notes"]:
        print(f"note: {note}")


def _show_claim(claim: str, verdict: str, lines: list[str]) -> None:
    print(f"{claim}: {verdict}")
    for line in lines:
        print(f"  {line}")


def _conclusion(document: dict[str, Any]) -> str:
    if document["range"]:
        return f"Theorem 2 applies for {document['range']}, and for no other positive value"
    if document["holds"] == "proved":
        landmark = document["landmark_weights"]
        if landmark and landmark["verdict"] == "refuted":
            return "Theorem 2's conditions on alpha hold; the landmark step's does not"
        return "Theorem 2's conditions on the learning rate hold"
    return {
        "refuted": "Theorem 2 does not apply: not both conditions hold",
        "undecided": "whether Theorem 2 applies is not decided",
    }[document["holds"]]
