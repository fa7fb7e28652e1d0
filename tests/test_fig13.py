"""Figure 13: looks, what counts as converged, and a small run of the study."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from qualrl.io.scenario import load_scenario
from qualrl.kernels import stepping
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.policy import greedy_walk
from qualrl.studies.budget import Look, _measured, _watched, looks_at
from qualrl.studies.document import criterion, measured_table, report, study_document
from qualrl.studies.fig13.score import Navigation, indistinct
from qualrl.studies.pictures import draw_study
from qualrl.studies.running import cells_of
from qualrl.studies.settings import Budget, StudySettings, load_study
from qualrl.studies.study import prepared, run_study, selected


def small(**budget) -> StudySettings:
    """The study on the puzzle, with little of everything."""
    asked = {"world": "map", "scenario": "puzzle.scenario.yaml", "steps": 60_000, "first": 1000, "even_looks": 10}
    chosen = load_study("fig13")
    return chosen.model_copy(update={"budget": Budget(**(asked | {"within": 0.05} | budget))})


# --- looks ---


@pytest.mark.parametrize(("steps", "first"), [(1, 10_000), (10_000, 10_000), (12_345, 10), (240_000_000, 10_000)])
def test_looks_grow_apart_and_end_with_the_budget(steps, first):
    looks = looks_at(Budget(world="map", steps=steps, first=first, within=0.1))
    assert looks[-1] == steps
    assert looks[0] == min(first, steps)
    assert (np.diff(looks) > 0).all()
    assert len(looks) < 130
    late = looks[1:][looks[1:] > steps / 2]
    assert (np.diff(late) <= steps / 50 + 1).all()


class Counter:
    """A learner that counts its steps, and has only so many to make."""

    def __init__(self, most):
        self.made, self.most = 0, most

    def advance(self, n_steps):
        done = min(n_steps, self.most - self.made)
        self.made += done
        return done


def look(good, value=1.0):
    return Look(value, good, {"arrives": float(good)})


def test_a_learner_is_looked_at_exactly_where_it_was_asked():
    learner, looks = Counter(10**9), np.array([10, 25, 12_000_001])
    seen, seconds = _watched(learner, looks, lambda: look(True, learner.made))
    assert [each.value for each in seen] == looks.tolist()
    assert seconds == sorted(seconds)
    short = Counter(12)
    seen, _ = _watched(short, looks, lambda: look(True, short.made))
    assert [each.value for each in seen] == [10, 12, 12]


@pytest.mark.parametrize(
    ("good", "converges", "steps"),
    [("111", 1, 10), ("011", 1, 20), ("101", 1, 30), ("001", 1, 30), ("110", 0, 30), ("000", 0, 30)],
)
def test_converged_is_from_when_it_stays_good(good, converges, steps):
    seen = [look(each == "1") for each in good]
    found, curve, _ = _measured(seen, [0.1, 0.2, 0.3], np.array([10, 20, 30]))
    assert (found["converges"], found["env_steps"]) == (converges, steps)
    assert found["cpu_seconds"] == pytest.approx(steps / 100)
    assert len(curve) == 3


# --- settings ---


def test_readings_may_set_the_discount_and_rates():
    cells = {cell.label: cell for cell in cells_of(load_study("fig13"))}
    theirs = cells["HQL (the paper's gamma 0.9)"]
    assert (theirs.gamma, theirs.alpha, theirs.epsilon) == (0.9, 0.01, 0.1)
    assert theirs.chosen == (("eta_counter", "episode"),)
    assert cells["option QL (options only)"].gamma is None
    with pytest.raises(ValueError, match="did you mean 'eta_counter'"):
        StudySettings.model_validate(
            {"title": "t", "source": "s", "claims": [],
             "series": {"A": {"algorithm": "hql", "alpha": [1], "readings": {"x": {"eta_cuonter": "run"}}}}}
        )  # fmt: skip


def test_selectors_may_name_readings():
    study = prepared("fig13", settings=small())
    runs = dict.fromkeys(study.cells)
    for asked in study.settings.claims:
        for selector in asked.selectors():
            found = selected(selector, runs)
            assert found, asked.says
            assert selector.readings is None or [cell.reading for cell in found] == list(selector.readings)


def test_the_papers_map_leads_through_two_doors_and_a_corridor():
    course = Navigation(load_study("fig13").budget)
    model = course.model(0.999)
    assert model.grid.free.shape == (400, 600)
    toward = -model.grid.steps_to_goal[model.grid.successor]
    walk, arrived = greedy_walk(model.world, toward.__getitem__, model.start)
    assert arrived
    assert len(walk) - 1 == course.optimum == 596
    names = [model.region_names[model.region_of[state]] for state in walk]
    assert list(dict.fromkeys(names)) == ["room A", "corridor 1", "room D"]


# --- what float64 can tell apart ---


def corridor(length: int, gamma: float, tmp_path: Path) -> HybridMDP:
    """A straight corridor as a map file."""
    picture = np.zeros((3, length + 3), np.uint8)
    picture[1, 1:-1] = 254
    cv2.imwrite(str(tmp_path / "c.png"), picture)
    (tmp_path / "c.yaml").write_text(
        "image: c.png\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (tmp_path / "c.scenario.yaml").write_text(f"map: c.yaml\nstart: [1, 1]\ngoal: [1, {length + 1}]\n")
    scenario = load_scenario(tmp_path / "c.scenario.yaml")
    return scenario.with_settings([f"learn.gamma={gamma}"]).build()


def test_far_from_the_goal_plain_values_run_out_of_digits_and_shifted_ones_do_not(tmp_path: Path):
    near, far, wide = (corridor(n, gamma, tmp_path) for n, gamma in ((300, 0.9), (500, 0.9), (500, 0.999)))
    assert indistinct(near) == (0, None)
    assert indistinct(wide) == (0, None)
    lost, first = indistinct(far)
    assert first is not None
    assert 330 < first < 380
    assert 0.9 * (500 - first) < lost <= 501 - first  # roundings leave a cell here and there


def test_replay_learns_at_gamma_09_where_one_step_learners_cannot(tmp_path: Path):
    """500 steps: HQL with replay has digits left, Q-learning has not, whatever it is given to learn from."""
    model = corridor(500, 0.9, tmp_path)
    settings = LearnSettings(episodes=2000, alpha=1.0, epsilon=0.1)
    arrived = {}
    for name, steps in (("hql-replay", 20_000), ("q-learning", 3_000_000)):
        learner = start_learner(model, name, settings, seed=1)
        learner.advance(steps)
        learned = learner.learned()
        values = learned.q if learned.shifted_q is None else learned.shifted_q
        walk, there = greedy_walk(model.world, values.__getitem__, model.start)
        arrived[name] = there
        assert learner.progress.whole[stepping.EPISODE] > 0
        if there:
            assert len(walk) - 1 == 500
            continue
        plain = values[model.start]
        assert (learned.q < 0).any()
        assert plain.max() == pytest.approx(-10)
    assert arrived == {"hql-replay": True, "q-learning": False}


# --- the study ---


@pytest.fixture(scope="module")
def study():
    return run_study(prepared("fig13", 2, small()))


def test_every_learner_is_measured(study):
    assert study.course.optimum == 32
    for cell, runs in study.runs.items():
        assert runs.curve.shape == (2, len(looks_at(study.settings.budget)))
        for walk, arrives, ratio in zip(runs.walks, runs.measures["arrives"], runs.measures["path_ratio"], strict=True):
            assert np.isnan(ratio) if not arrives else ratio == (len(walk) - 1) / 32, cell
    replay = next(runs for cell, runs in study.runs.items() if cell.series == "HQL with replay")
    assert replay.measures["converges"].all()
    assert (replay.measures["env_steps"] <= 3000).all()


def test_runs_depend_on_their_seed_only(study):
    again = run_study(prepared("fig13", 2, small()), threads=1)
    for one, two in zip(study.runs.values(), again.runs.values(), strict=True):
        np.testing.assert_array_equal(one.curve, two.curve)
        assert one.walks == two.walks


def test_documents_tables_and_pictures(study, tmp_path: Path):
    document = study_document(study)
    text = json.dumps(document, allow_nan=False)
    assert "environment_steps" in text
    assert document["criterion"] == criterion(study)
    assert "at most 5% longer than the shortest" in document["criterion"]
    assert {curve["gamma"] for curve in document["curves"] if "gamma" in curve} == {0.9, 0.999}
    headings, rows = measured_table(study)
    assert {"arrives", "path / shortest", "converged", "steps", "CPU s"} <= set(headings)
    assert len(rows) == len(study.runs)
    for claim in study.claims:
        assert claim.says in report([study])
    assert draw_study(study, tmp_path / "fig13.png")
    assert min(cv2.imread(str(tmp_path / "fig13.png")).shape[:2]) > 400


def test_a_look_at_a_learner_of_nothing_is_bad():
    course = Navigation(small().budget)
    model = course.model(0.9)
    found = course.look(model, start_learner(model, "q-learning", LearnSettings(episodes=1), 0))
    assert not found.good
    assert found.value == np.inf


def test_a_quick_look_has_a_smaller_budget():
    study = prepared("fig13", 2, small().model_copy(update={"claims": []}))
    few = replace(study, cells=[cell for cell in study.cells if cell.series == "QL"])
    quick = run_study(few, episodes=5)
    assert quick.settings.budget.steps == 5000
    for curve in study_document(quick)["curves"]:
        assert curve["environment_steps"][-1] == 5000
        assert len(curve["median"]) == len(curve["environment_steps"])
