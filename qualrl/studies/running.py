"""Running a study: every cell (learner, setting, reading) with every seed, over threads."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qualrl.learning.many import Watch, over_threads
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.studies.measures import Measure, measured, thinned
from qualrl.studies.settings import Chosen, Series, StudySettings
from qualrl.studies.statistics import Floats

PUZZLE = "puzzle"
CORRIDOR = "corridor"
"""How the names of the law's own mazes begin."""


@dataclass(frozen=True)
class Cell:
    """What is run alike with every seed."""

    series: str
    algorithm: str
    alpha: float
    epsilon: float
    reading: str | None = None
    """Name of the reading, where the paper leaves something open."""
    chosen: tuple[tuple[str, bool | float | str], ...] = ()
    """Settings of the learner that make the reading."""
    maze: str = PUZZLE
    episodes: int | None = None
    """Episodes, where they differ from the study's."""
    gamma: float | None = None
    """Discount, where it differs from the study's."""

    @property
    def label(self) -> str:
        """The learner and its reading."""
        return self.series if self.reading is None else f"{self.series} ({self.reading})"


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of a cell; N seeds, P points."""

    measures: dict[Measure, Floats]
    """(N,) each."""
    curve: Floats
    """(N, P) mean steps of each stretch of episodes; on a budget of steps, what was seen at each look."""
    walks: tuple[tuple[int, ...], ...] = ()
    """(N,) states of each run's greedy path at the end, where there is one."""


def cells_of(settings: StudySettings) -> list[Cell]:
    """Every combination that the settings ask for, but the law's own."""
    maze = PUZZLE if settings.budget is None else settings.budget.world
    return [
        _cell(Cell(name, series.algorithm, alpha, epsilon, reading, maze=maze), chosen)
        for name, series in settings.series.items()
        for reading, chosen in _readings(series)
        for alpha in series.alpha
        for epsilon in series.epsilon
    ]


def _cell(plain: Cell, chosen: Chosen) -> Cell:
    """A cell with a reading's settings; those that cells have fields for go there."""
    own: Chosen = {name: chosen[name] for name in ("alpha", "epsilon", "gamma") if name in chosen}
    rest = tuple((name, value) for name, value in chosen.items() if name not in own)
    return replace(plain, chosen=rest, **dict[str, Any](own))


def _readings(series: Series) -> list[tuple[str | None, Chosen]]:
    named: list[tuple[str | None, Chosen]] = [*series.readings.items()]
    return named or [(None, {})]


def learn_settings(settings: StudySettings, cell: Cell, episodes: int) -> LearnSettings:
    """The settings of a cell's learner."""
    return LearnSettings(
        episodes=episodes, alpha=cell.alpha, epsilon=cell.epsilon, eta0=settings.eta0, eta_power=settings.eta_power,
        **dict[str, Any](cell.chosen),
    )  # fmt: skip


def run_cells(
    settings: StudySettings,
    cells: Sequence[Cell],
    mazes: dict[str, HybridMDP],
    *,
    seeds: int,
    episodes: int | None = None,
    threads: int | None = None,
    watch: Callable[[int], None] | None = None,
) -> list[Runs]:
    """Run every cell with seeds 0, 1, ...; ``watch`` is told how many runs are done.

    episodes: instead of those in the settings, for a quick look.
    """
    optimum = {name: _optimum(model) for name, model in mazes.items()}

    def one(cell: Cell, seed: int, stops: Watch) -> Measured:
        chosen = learn_settings(settings, cell, episodes or cell.episodes or settings.episodes)
        run = train(mazes[cell.maze], cell.algorithm, chosen, seed, stops)
        return measured(run, optimum[cell.maze]), thinned(run.steps, settings.points), ()

    return run_all(one, cells, seeds, threads, watch)


Measured = tuple[dict[Measure, float], Floats, tuple[int, ...]]
"""A run's measures, its curve, and the states of its greedy path."""


def run_all(
    one: Callable[[Cell, int, Watch], Measured],
    cells: Sequence[Cell],
    seeds: int,
    threads: int | None,
    watch: Callable[[int], None] | None,
) -> list[Runs]:
    """Make every run, a function of its cell, its seed and what watches it."""
    pairs = [(cell, seed) for cell in cells for seed in range(seeds)]
    found = over_threads(lambda pair, stops: one(*pair, stops), pairs, threads, watch)
    return [_gathered(found[at : at + seeds]) for at in range(0, len(found), seeds)]


def _gathered(results: list[Measured]) -> Runs:
    values = {name: np.array([found[name] for found, _, _ in results]) for name in results[0][0]}
    return Runs(values, np.array([curve for _, curve, _ in results]), tuple(walk for _, _, walk in results))


def _optimum(model: HybridMDP) -> int:
    """Steps of the shortest way; also readies what the threads share."""
    start = int(model.starts[0])
    return int(model.grid.steps_to_goal[start])
