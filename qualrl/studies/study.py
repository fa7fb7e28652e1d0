"""A study from its settings to its verdicts."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product

import numpy as np

from qualrl.io.bundled import bundled_folder
from qualrl.io.scenario import load_scenario
from qualrl.learning.rules import RULES
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.studies.budget import QUICK, Course, run_budget
from qualrl.studies.claims import (
    NOT_MEASURED,
    Claim,
    Coefficient,
    Falling,
    Finding,
    Judged,
    Less,
    Selector,
    Share,
    Unmeasured,
    judged,
)
from qualrl.studies.courses import course_of
from qualrl.studies.law.score import Fits, corridor_cells, corridor_mazes, fits
from qualrl.studies.measures import UNTIL_CONVERGED
from qualrl.studies.running import CORRIDOR, PUZZLE, Cell, Runs, cells_of, run_cells
from qualrl.studies.settings import StudySettings, load_study


@dataclass(frozen=True, eq=False)
class Study:
    """A figure of the paper, measured and judged."""

    name: str
    settings: StudySettings
    seeds: int
    episodes: int
    """Of the runs on the puzzle."""
    runs: dict[Cell, Runs]
    claims: list[Judged]
    notes: list[str]
    seconds: float
    fits: Fits = field(default_factory=dict)
    course: Course | None = None
    """Where runs on a budget of steps were made."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A study ready to run."""

    name: str
    settings: StudySettings
    cells: list[Cell]
    missing: dict[str, str]
    """Series -> learner, for those that this version has no learner for."""
    seeds: int
    course: Course | None = None
    """Where runs on a budget of steps are made."""

    @property
    def n_runs(self) -> int:
        """How many runs it takes."""
        return len(self.cells) * self.seeds


def prepared(name: str, seeds: int | None = None, settings: StudySettings | None = None) -> Prepared:
    """Make a study ready.  seeds, settings: instead of the study's own.  Raises UnknownNameError."""
    chosen = settings or load_study(name)
    law = {} if chosen.law is None else corridor_cells(chosen.law)
    wanted = [*cells_of(chosen), *law]
    missing = {cell.series: cell.algorithm for cell in wanted if cell.algorithm not in RULES}
    cells = [cell for cell in wanted if cell.series not in missing]
    course = None if chosen.budget is None else course_of(chosen.budget)
    return Prepared(name, chosen, cells, missing, seeds or chosen.seeds, course)


def run_study(
    study: Prepared,
    *,
    episodes: int | None = None,
    threads: int | None = None,
    watch: Callable[[int], None] | None = None,
) -> Study:
    """Run, measure and judge.  ``watch`` is told how many runs are done.

    episodes: instead of the study's, for a quick look; see ``budget.QUICK`` for runs on a budget of steps.
    """
    begun = time.perf_counter()
    settings = study.settings if episodes is None else _shortened(study.settings, episodes)
    if study.course is not None:
        found = run_budget(settings, study.cells, study.course, seeds=study.seeds, threads=threads, watch=watch)
    else:
        mazes = {} if settings.law is None else corridor_mazes(settings)
        if settings.series:
            mazes[PUZZLE] = puzzle(settings.gamma)
        found = run_cells(
            settings, study.cells, mazes, seeds=study.seeds, episodes=episodes, threads=threads, watch=watch
        )
    runs = dict(zip(study.cells, found, strict=True))
    fitted = {} if settings.law is None else fits(settings.law, runs)
    notes = [f"{series}: left out, {_lacking(algorithm)}" for series, algorithm in study.missing.items()]
    if study.course is not None:
        notes += study.course.notes()
    claims = [judge(claim, runs, fitted, study.missing) for claim in settings.claims]
    return Study(
        study.name, settings, study.seeds, episodes or settings.episodes, runs, claims, [*settings.notes, *notes],
        time.perf_counter() - begun, fitted, study.course,
    )  # fmt: skip


def _shortened(settings: StudySettings, episodes: int) -> StudySettings:
    """Settings with a smaller budget, if they have one."""
    if settings.budget is None:
        return settings
    budget = settings.budget.model_copy(update={"steps": min(settings.budget.steps, episodes * QUICK)})
    return settings.model_copy(update={"budget": budget})


@cache
def puzzle(gamma: float) -> HybridMDP:
    """The paper's puzzle with the paper's landmarks."""
    scenario = load_scenario(bundled_folder() / "puzzle.scenario.yaml")
    return scenario.with_settings([f"learn.gamma={gamma}"]).build()


def judge(claim: Claim, runs: Mapping[Cell, Runs], fitted: Fits, missing: Mapping[str, str]) -> Judged:
    """What the runs say of a claim, for each reading that they were made in."""
    if isinstance(claim, Unmeasured):
        return Judged(claim.says, {}, NOT_MEASURED, claim.why)
    if isinstance(claim, Coefficient):
        return judged(claim.says, {("",): claim.judge(fitted)})
    absent = [missing[selector.series] for selector in claim.selectors() if selector.series in missing]
    if absent:
        return Judged(claim.says, {}, NOT_MEASURED, _lacking(absent[0]))
    groups = [selected(selector, runs) for selector in claim.selectors()]
    findings = {}
    for readings in _readings(groups):
        cells = [
            [cell for cell in group if cell.reading == reading] for group, reading in zip(groups, readings, strict=True)
        ]
        if isinstance(claim, Falling | Share):
            along = claim.along if isinstance(claim, Falling) else "alpha"
            picked = sorted(cells[0], key=lambda cell: float(getattr(cell, along)))
        else:
            picked = [one for (one,) in cells]
        findings[tuple(reading or "" for reading in readings)] = _found(claim, [runs[cell] for cell in picked])
    return judged(claim.says, findings)


def _readings(groups: list[list[Cell]]) -> list[tuple[str | None, ...]]:
    """Readings to judge by, one for each group: the same for groups of one series, else every combination."""
    names = [list(dict.fromkeys(cell.reading for cell in group)) for group in groups]
    alike = len({cell.series for group in groups for cell in group}) == 1
    return list(zip(*names, strict=True)) if alike else list(product(*names))


def selected(selector: Selector, runs: Mapping[Cell, Runs]) -> list[Cell]:
    """The cells that a selector means, but for the law's corridors."""
    return [
        cell
        for cell in runs
        if not cell.maze.startswith(CORRIDOR)
        and cell.series == selector.series
        and (selector.readings is None or cell.reading in selector.readings)
        and selector.alpha in (None, cell.alpha)
        and selector.epsilon in (None, cell.epsilon)
    ]


def _found(claim: Claim, picked: list[Runs]) -> Finding:
    """A finding, with a warning where runs ended before they converged: their numbers are lower bounds.

    Lower bounds of most runs say nothing of what is claimed to be small, or alike, or a certain number.
    """
    assert not isinstance(claim, Coefficient | Unmeasured)
    samples = [runs.measures[claim.measure] for runs in picked]
    there = [sample[~np.isnan(sample)] for sample in samples]
    if not all(len(sample) for sample in there):
        return Finding(False, "nothing to measure in any run")
    kept, of = min(
        ((len(kept), len(sample)) for kept, sample in zip(there, samples, strict=True)), key=lambda n: n[0] / n[1]
    )
    if 2 * kept < of:
        return Finding(False, f"to be measured in only {kept} of {of} runs")
    found = claim.judge(there)
    short = [int((runs.measures["converges"] == 0).sum()) for runs in picked]
    if claim.measure not in UNTIL_CONVERGED or not any(short):
        return found
    bounds = {Less: short[:1], Falling: short[1:]}.get(type(claim), short)
    holds = found.holds and max(bounds) <= len(samples[0]) / 2
    missed = "no run" if max(short) == len(samples[0]) else f"all but {max(short)} runs"
    return replace(found, holds=holds, text=f"{found.text}; {missed} converged in time")


def _lacking(algorithm: str) -> str:
    return f"no learner {algorithm!r} in this version"
