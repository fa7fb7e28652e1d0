"""From the runs of a study to its picture."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from qualrl.report.budget_figures import draw_navigation, draw_values
from qualrl.report.study_figures import (
    Curve,
    LawFigure,
    Panel,
    Surface,
    draw_curves,
    draw_law,
    draw_surfaces,
)
from qualrl.studies.budget_document import budget_curves, walks_of
from qualrl.studies.law.score import corridor_costs
from qualrl.studies.measures import stretch
from qualrl.studies.running import PUZZLE, Cell, Runs
from qualrl.studies.settings import Picture
from qualrl.studies.statistics import Floats
from qualrl.studies.study import Study, puzzle

BAND = (10, 50, 90)
LONGEST_STRETCH = 10
"""Steps from S0 to S1, and from S2 to S3, of the puzzle's landmarks."""
READINGS = {"run": "eta counted over the run", "pair": "eta by landmark and action", "episode": "eta by episode"}


def draw_study(study: Study, file: Path) -> bool:
    """Write the picture as PNG; False when the study has none."""
    picture = study.settings.picture
    if picture is None:
        return False
    title = f"{study.settings.title} ({study.seeds} runs each)"
    if picture.kind == "law":
        draw_law(_law(study), file, title=title)
    elif picture.kind == "navigation":
        model, walks = walks_of(study)
        assert model.regions is not None
        cells = {label: [[model.cell_of(state) for state in walk] for walk in found] for label, found in walks.items()}
        draw_navigation(model.regions, cells, budget_curves(study), file, title=title, optimum=_optimum(study))
    elif picture.kind == "values":
        draw_values(budget_curves(study), file, title=title, optimum=_optimum(study))
    elif picture.kind == "surface":
        draw_surfaces(_surfaces(study), file, title=title, most_steps=picture.most_steps or 400)
    else:
        model = puzzle(study.settings.gamma)
        optimum = int(model.grid.steps_to_goal[model.starts[0]])
        draw_curves(
            _panels(study, picture), file, title=title, optimum=optimum, most_steps=picture.most_steps or 1000,
            most_episodes=picture.most_episodes or study.settings.episodes,
        )  # fmt: skip
    return True


def _optimum(study: Study) -> float:
    assert study.course is not None
    return study.course.optimum


def band(runs: Runs) -> Floats:
    """(3, P) the 10, 50 and 90 % curves over the runs."""
    return np.asarray(np.percentile(runs.curve, BAND, axis=0), np.float64)


def points_of(study: Study, runs: Runs) -> Floats:
    """(P,) the last episode of each point of a curve."""
    size = stretch(study.episodes, study.settings.points)
    return np.array([min(at * size, study.episodes) for at in range(1, runs.curve.shape[1] + 1)], np.float64)


def _panels(study: Study, picture: Picture) -> list[Panel]:
    """One panel for each value of what the settings set apart; the rest tells the curves apart."""
    panels: dict[str, list[Curve]] = {}
    for cell, runs in study.runs.items():
        title = f"alpha {cell.alpha:g}" if picture.panels == "alpha" else ""
        label = cell.label
        if picture.panels == "reading":
            title = f"{cell.series}, {_reading(cell)}"
            label = _setting(study, cell)
        low, median, high = band(runs)
        panels.setdefault(title, []).append(Curve(label, points_of(study, runs), median, low, high))
    return [Panel(title, curves) for title, curves in panels.items()]


def _reading(cell: Cell) -> str:
    return READINGS.get(cell.reading or "", cell.reading or "")


def _setting(study: Study, cell: Cell) -> str:
    several = len({other.epsilon for other in study.runs}) > 1
    return f"epsilon {cell.epsilon:g}" if several else f"alpha {cell.alpha:g}"


def _surfaces(study: Study) -> list[Surface]:
    groups: dict[str | None, list[Cell]] = {}
    for cell in study.runs:
        groups.setdefault(cell.reading, []).append(cell)
    return [_surface(study, cells) for cells in groups.values()]


def _surface(study: Study, cells: Iterable[Cell]) -> Surface:
    cells = list(cells)
    by_epsilon = len({cell.epsilon for cell in cells}) > 1
    return Surface(
        f"{cells[0].series}, {_reading(cells[0])}",
        "Epsilon" if by_epsilon else "Learning rate",
        np.array([cell.epsilon if by_epsilon else cell.alpha for cell in cells]),
        points_of(study, study.runs[cells[0]]),
        np.array([band(study.runs[cell])[1] for cell in cells]),
    )


def _law(study: Study) -> LawFigure:
    law = study.settings.law
    assert law is not None
    rates: dict[str, list[tuple[float, float, float, float]]] = {}
    for cell, runs in study.runs.items():
        if cell.maze == PUZZLE:
            low, median, high = np.percentile(runs.measures["converged"], BAND) * cell.alpha
            rates.setdefault(cell.label, []).append((cell.alpha, float(low), float(median), float(high)))
    costs = corridor_costs(law, study.runs)
    layered: dict[int, list[tuple[int, float]]] = {}
    for (n, m), cost in costs["HQL"].items():
        layered.setdefault(n, []).append((m, cost))
    model = puzzle(study.settings.gamma)
    depth = int(model.grid.steps_to_goal[model.starts[0]])
    return LawFigure(rates, {n: cost for (n, _), cost in costs["QL"].items()}, layered, depth, LONGEST_STRETCH)
