"""A study as JSON and as tables: keys that others build on."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from qualrl import __version__
from qualrl.studies.budget_document import budget_criterion, budget_curve, budget_row
from qualrl.studies.claims import Judged, shown
from qualrl.studies.measures import SLACK, WINDOW, WORDS
from qualrl.studies.pictures import band, points_of
from qualrl.studies.running import CORRIDOR, Cell, Runs
from qualrl.studies.statistics import Floats, Spread, number, spread
from qualrl.studies.study import Study

HEADINGS = ("figure", "paper says", "measured: median (95 % interval)", "verdict")
CRITERION = (
    f"Converged: after the last episode at which the mean steps of {WINDOW} episodes were above {SLACK:g} times the "
    "optimum (36 steps on the puzzle); the paper gives no criterion."
)
RULES = (
    "A number is reproduced when the 95 % interval of the median lies within 15 % of the paper's; a difference, when"
    " that of the ratio of medians shows at least 5 %; a law, when the coefficient's interval lies within the bounds "
    "named.  Where most runs ended before they converged, nothing is taken to be small, or alike."
)
READINGS = (
    "Readings of HQL are what the weight eta_n counts with n: landmark steps of the run, of the pair, of the episode."
)


def study_document(study: Study) -> dict[str, Any]:
    """All of a study but single runs: what was asked, measured and found."""
    return {
        "figure": study.name,
        "title": study.settings.title,
        "source": study.settings.source,
        "qualrl": __version__,
        "seeds": list(range(study.seeds)),
        "episodes": study.episodes,
        "criterion": criterion(study),
        "settings": study.settings.model_dump(mode="json"),
        "measures": dict(WORDS),
        "claims": [_claim(claim) for claim in study.claims],
        "measured": [_measured(cell, runs) for cell, runs in study.runs.items()],
        "fits": {name: {term: asdict(found) for term, found in fit.items()} for name, fit in study.fits.items()},
        "curves": [_curve(study, cell, runs) for cell, runs in study.runs.items() if _drawn(cell)],
        "notes": study.notes,
        "seconds": round(study.seconds, 3),
    }


def criterion(study: Study) -> str:
    """When a run counts as converged."""
    return CRITERION if study.course is None else budget_criterion(study)


def _drawn(cell: Cell) -> bool:
    return not cell.maze.startswith(CORRIDOR)


def _claim(claim: Judged) -> dict[str, Any]:
    findings = {
        shown(reading): {"holds": found.holds, "text": found.text, "value": found.value and asdict(found.value)}
        for reading, found in claim.findings.items()
    }
    return {"says": claim.says, "verdict": claim.verdict, "readings": findings, "why": claim.why or None}


def _key(cell: Cell) -> dict[str, Any]:
    return {
        "series": cell.series, "algorithm": cell.algorithm, "alpha": cell.alpha, "epsilon": cell.epsilon,
        "reading": cell.reading, "maze": cell.maze,
    } | ({} if cell.gamma is None else {"gamma": cell.gamma})  # fmt: skip


def _measured(cell: Cell, runs: Runs) -> dict[str, Any]:
    found = {name: _spread(sample) for name, sample in runs.measures.items()}
    return _key(cell) | {name: None if value is None else asdict(value) for name, value in found.items()}


def _spread(sample: Floats) -> Spread | None:
    there = sample[~np.isnan(sample)]
    return spread(there) if len(there) else None


def _curve(study: Study, cell: Cell, runs: Runs) -> dict[str, Any]:
    if study.course is not None:
        return _key(cell) | budget_curve(study, runs)
    low, median, high = np.round(band(runs), 1).tolist()
    episodes = points_of(study, runs).astype(int).tolist()
    return _key(cell) | {"episodes": episodes, "median": median, "low": low, "high": high}


def claim_rows(study: Study) -> list[tuple[str, str, str, str]]:
    """A row of HEADINGS for each claim."""
    name = study.name.removeprefix("fig")
    return [(name, claim.says, claim.measured, claim.verdict) for claim in study.claims]


def measured_table(study: Study) -> tuple[list[str], list[list[str]]]:
    """Headings, and a row for each cell; a maze or epsilon that all share is left out.

    episodes, steps: until convergence.  before, after: mean steps of an episode before and after it.
    """
    row_of = _measured_row if study.course is None else budget_row
    rows = [row_of(cell, runs) for cell, runs in study.runs.items()]
    several = {name for name in ("maze", "epsilon") if len({row.get(name) for row in rows}) > 1}
    headings = [name for name in (rows[0] if rows else ()) if name in several or name not in ("maze", "epsilon")]
    return headings, [[row[name] for name in headings] for row in rows]


def _measured_row(cell: Cell, runs: Runs) -> dict[str, str]:
    found = {name: _spread(sample) for name, sample in runs.measures.items()}
    converged = found["converged"]
    assert converged is not None
    return {
        "learner": cell.label,
        "maze": cell.maze,
        "alpha": f"{cell.alpha:g}",
        "epsilon": f"{cell.epsilon:g}",
        "episodes": _reached(converged, runs),
        "x alpha": number(converged.median * cell.alpha),
        "steps": _median(found["steps_until"]),
        "before": _median(found["mean_before"]),
        "after": _median(found["mean_after"]),
    }


def _reached(converged: Spread, runs: Runs) -> str:
    """Episodes until convergence, and how many runs did not get there."""
    short = int((runs.measures["converges"] == 0).sum())
    if short == len(runs.measures["converges"]):
        return f"over {number(converged.median)}"
    return f"{converged}" + (f", {short} not yet" if short else "")


def _median(found: Spread | None) -> str:
    return "-" if found is None else number(found.median)


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    cells = [list(headings), *([text.replace("|", "/").replace("\n", "<br>") for text in row] for row in rows)]
    lines = ["| " + " | ".join(row) + " |" for row in cells]
    return "\n".join([lines[0], "|---" * len(headings) + "|", *lines[1:]]) + "\n"


def remarks(studies: Sequence[Study]) -> str:
    """How it was measured and judged, and what to know of each study."""
    notes = [f"- {study.name}: {note}" for study in studies for note in study.notes]
    seeds = max(study.seeds for study in studies)
    fewer = [f"{study.name}: {study.seeds}" for study in studies if study.seeds != seeds]
    made = f"{seeds} runs of each kind{''.join(f' ({each})' for each in fewer)}, seeds 0, 1, ...; qualrl {__version__}."
    criteria = dict.fromkeys(criterion(study) for study in studies)
    return "\n".join([*criteria, RULES, READINGS, made, *([""] if notes else []), *notes])


def report(studies: Sequence[Study]) -> str:
    """The Markdown page of one or all studies."""
    rows = [row for study in studies for row in claim_rows(study)]
    return f"{markdown(HEADINGS, rows)}\n{remarks(studies)}\n"
