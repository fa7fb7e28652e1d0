"""Fits of episodes x alpha: over learning rates on the puzzle, and over corridors.

The value of the goal travels back one state for each 1 / alpha visits, so that the episodes a learner needs are
(length of its cascade) / alpha.  For Q-learning the cascade is the whole way; with landmarks it should be the
longest stretch between two of them.

n: steps of a corridor.  m: steps from landmark to landmark, so n / m stretches.
"""

from collections.abc import Mapping
from itertools import product

import numpy as np

from qualrl.api import build
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.segmentation import segment
from qualrl.studies.running import CORRIDOR, PUZZLE, Cell, Runs
from qualrl.studies.settings import Law, StudySettings
from qualrl.studies.statistics import Spread, least_squares

Corridor = tuple[int, int]
"""(n, m); m = n without landmarks on the way."""


def corridors(law: Law) -> list[Corridor]:
    """The corridors with landmarks."""
    return [(n, m) for n, m in product(law.lengths, law.spacings) if n % m == 0 and n // m >= 2]


def corridor_cells(law: Law) -> dict[Cell, Corridor]:
    """What is run in corridors: the flat learner in each length, the layered one in each corridor."""
    flat = {_cell("QL", law.flat, law, None, (n, n)): (n, n) for n in law.lengths}
    layered = {_cell("HQL", law.layered, law, law.eta_counter, corridor): corridor for corridor in corridors(law)}
    return flat | layered


def _cell(series: str, algorithm: str, law: Law, reading: str | None, corridor: Corridor) -> Cell:
    chosen = () if reading is None else (("eta_counter", reading),)
    return Cell(series, algorithm, law.alpha, law.epsilon, reading, chosen, maze_name(corridor), law.episodes)


def maze_name(corridor: Corridor) -> str:
    """A corridor's name."""
    return f"{CORRIDOR} of {corridor[0]}, landmarks every {corridor[1]}"


def corridor_mazes(settings: StudySettings) -> dict[str, HybridMDP]:
    """Models of all corridors, by name."""
    assert settings.law is not None
    return {maze_name(which): corridor_model(which, settings.gamma) for which in corridor_cells(settings.law).values()}


def corridor_model(corridor: Corridor, gamma: float) -> HybridMDP:
    """A corridor one cell wide, from its west end to its east end."""
    n, m = corridor
    regions = segment(OccupancyGrid.from_free(np.ones((1, n + 1), np.bool_), 1.0))
    marks = {f"S{column // m}": f"0,{column}" for column in range(0, n, m)}
    return build(regions, goal=f"0,{n}", start="0,0", gamma=gamma, landmarks=marks)


Fits = dict[str, dict[str, Spread]]


def fits(law: Law, runs: Mapping[Cell, Runs]) -> Fits:
    """The fits, by name: coefficient by term."""
    found: Fits = {}
    for name in dict.fromkeys(cell.label for cell in runs if cell.maze == PUZZLE):
        fitted = {
            cell.alpha: float(np.median(run.measures["converged"]))
            for cell, run in runs.items()
            if (cell.label, cell.maze) == (name, PUZZLE) and cell.alpha <= law.most_alpha
        }
        alphas, episodes = list(fitted), list(fitted.values())
        found[f"{name}: log episodes"] = least_squares(
            {"log alpha": np.log(alphas).tolist()}, np.log(episodes).tolist()
        )
        found[f"{name}: episodes"] = least_squares({"1 / alpha": [1 / alpha for alpha in alphas]}, episodes)
    return found | corridor_fits(corridor_costs(law, runs), law.most_stretches)


def corridor_costs(law: Law, runs: Mapping[Cell, Runs]) -> dict[str, dict[Corridor, float]]:
    """Median of episodes x alpha in each corridor, by series."""
    costs: dict[str, dict[Corridor, float]] = {}
    for cell, corridor in corridor_cells(law).items():
        if cell in runs:
            cost = cell.alpha * float(np.median(runs[cell].measures["converged"]))
            costs.setdefault(cell.series, {})[corridor] = cost
    return costs


def corridor_fits(costs: Mapping[str, Mapping[Corridor, float]], most: int) -> Fits:
    """The flat learner's cost over n; the layered one's over n and m.

    "short" are corridors of at most ``most`` stretches; "beyond" counts the cells after so many stretches.
    """
    flat, layered = costs["QL"], costs["HQL"]
    short = {(n, m): cost for (n, m), cost in layered.items() if n <= most * m}
    return {
        "QL: corridors": least_squares({"length": [n for n, _ in flat]}, list(flat.values())),
        "HQL: short corridors": least_squares(
            {"length": [n for n, _ in short], "stretch": [m for _, m in short]}, list(short.values())
        ),
        "HQL: all corridors": least_squares(
            {
                "length": [n for n, _ in layered],
                "stretch": [m for _, m in layered],
                "beyond": [max(n - most * m, 0) for n, m in layered],
            },
            list(layered.values()),
        ),
    }
