"""Studies on a budget of environment steps, as rows, curves and words."""

from typing import TYPE_CHECKING, Any

import numpy as np

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.report.budget_figures import BudgetCurve
from qualrl.studies.budget import looks_at
from qualrl.studies.running import Cell, Runs
from qualrl.studies.settings import Budget
from qualrl.studies.statistics import Floats, number, spread

if TYPE_CHECKING:
    from qualrl.studies.study import Study

BAND = (10, 50, 90)


def _budget(study: "Study") -> Budget:
    assert study.settings.budget is not None
    return study.settings.budget


def budget_criterion(study: "Study") -> str:
    """When a run counts as converged."""
    budget = _budget(study)
    good = "path is at most" if budget.world == "map" else "policy's mean value over all starts is at most"
    worse = "longer than the shortest" if budget.world == "map" else "below the optimum"
    return (
        f"Converged ({study.name}): from the first look on after which the greedy {good} {budget.within:.0%} {worse}, "
        f"at every later look until the end of {budget.steps:,} environment steps."
    )


def budget_band(runs: Runs) -> Floats:
    """(3, P) the 10, 50 and 90 % curves over the runs; each number is one that some run had."""
    return np.asarray(np.percentile(runs.curve, BAND, axis=0, method="nearest"), np.float64)


def budget_curve(study: "Study", runs: Runs) -> dict[str, Any]:
    """A curve as JSON; null where the greedy path does not arrive."""
    rows = [[float(f"{v:.6g}") if np.isfinite(v) else None for v in row] for row in budget_band(runs).tolist()]
    names = ("low", "median", "high")
    return {"environment_steps": looks_at(_budget(study)).tolist(), **dict(zip(names, rows, strict=True))}


def budget_curves(study: "Study") -> list[BudgetCurve]:
    """The curves to be drawn."""
    looks = looks_at(_budget(study)).astype(np.float64)
    several = {cell.series for cell in study.runs if any(_twins(cell, other) for other in study.runs)}
    return [
        BudgetCurve(_label(cell, cell.series in several), looks, *budget_band(runs)[[1, 0, 2]])
        for cell, runs in study.runs.items()
    ]


def _twins(cell: Cell, other: Cell) -> bool:
    return cell.label == other.label and cell.alpha != other.alpha


def _label(cell: Cell, with_alpha: bool) -> str:
    return f"{cell.label}, alpha {cell.alpha:g}" if with_alpha else cell.label


def walks_of(study: "Study") -> tuple[HybridMDP, dict[str, list[tuple[int, ...]]]]:
    """The map, and by label the paths at the end that reach the goal."""
    assert study.course is not None
    model = study.course.model(study.settings.gamma)
    return model, {
        cell.label: [walk for walk, there in zip(runs.walks, runs.measures["arrives"], strict=True) if there]
        for cell, runs in study.runs.items()
    }


def budget_row(cell: Cell, runs: Runs) -> dict[str, str]:
    """A row of the table of what was measured; steps and seconds are those until convergence."""
    found = runs.measures
    row = {"learner": cell.label, "alpha": f"{cell.alpha:g}", "epsilon": f"{cell.epsilon:g}"}
    count = len(found["converges"])
    if "arrives" in found:
        row["arrives"] = f"{found['arrives'].sum():.0f} of {count}"
        row["path / shortest"] = _spread(found["path_ratio"])
    else:
        row["mean value"] = _spread(found["mean_value"])
        row["mean return"] = _spread(found["mean_return"])
    good = found["converges"] == 1
    row["converged"] = f"{good.sum():.0f} of {count}"
    row["steps"] = _until(found["env_steps"], good)
    row["CPU s"] = _until(found["cpu_seconds"], good)
    return row


def _spread(sample: Floats) -> str:
    there = sample[~np.isnan(sample)]
    return str(spread(there)) if len(there) else "-"


def _until(sample: Floats, good: np.ndarray[Any, np.dtype[np.bool_]]) -> str:
    """A measure until convergence; a lower bound where no run got there."""
    return str(spread(sample[good])) if good.any() else f"over {number(float(np.median(sample)))}"
