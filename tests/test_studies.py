"""Studies: measures against hand counts, verdicts that can come out either way, and runs that threads do not change."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from qualrl.errors import SettingError, UnknownNameError
from qualrl.learning.rules import RULES
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.studies import statistics
from qualrl.studies.claims import Claim, Coefficient, Judged, shown, verdict
from qualrl.studies.document import markdown, study_document
from qualrl.studies.measures import MEASURES, episodes_until_converged, measured, most_steps, thinned
from qualrl.studies.running import Cell, Runs, run_cells
from qualrl.studies.settings import STUDIES, StudySettings, load_study
from qualrl.studies.statistics import Spread
from qualrl.studies.study import Prepared, judge, prepared, puzzle, run_study, selected

READINGS = ("run", "pair", "episode")
N = 12


def claim(**keys) -> Claim:
    return TypeAdapter(Claim).validate_python({"says": "so it is", "measure": "converged"} | keys)


def fake(seed=0, missing=0, **medians) -> Runs:
    """N runs whose measures scatter by 1 % around what is said; the last ``missing`` never converged."""
    noise = 1 + 0.01 * np.random.default_rng(seed).standard_normal(N)
    values = {name: medians.get(name, 1.0) * noise for name in MEASURES}
    values["converges"] = np.array([1.0] * (N - missing) + [0.0] * missing)
    return Runs(values, np.ones((N, 3)))


def hql(run, pair, episode, **more) -> dict[Cell, Runs]:
    """Fake runs of HQL in its readings, and of QL."""
    numbers = dict(zip(READINGS, (run, pair, episode), strict=True))
    cells = {Cell("HQL", "hql", 0.01, 0.01, name): fake(converged=value) for name, value in numbers.items()}
    return cells | {Cell("QL", "q-learning", 0.01, 0.01): fake(1, converged=more.get("ql", 100))}


def says(asked: Claim, runs, missing=None) -> Judged:
    return judge(asked, runs, {}, missing or {})


# --- measures ---


@given(st.lists(st.integers(1, 80), min_size=1, max_size=60), st.integers(1, 10), st.integers(20, 60))
@settings(max_examples=100, deadline=None)
def test_episodes_until_converged_by_counting(steps, window, most):
    late = [end for end in range(window, len(steps) + 1) if sum(steps[end - window : end]) > most * window]
    expected = max(late, default=0) if len(steps) >= window else len(steps)
    assert episodes_until_converged(np.array(steps), most, window) == expected


@given(st.lists(st.integers(1, 900), min_size=1, max_size=50), st.integers(1, 60))
@settings(max_examples=60, deadline=None)
def test_thinned_curves_keep_the_mean_of_each_stretch(steps, points):
    size = -(-len(steps) // points)
    expected = [np.mean(steps[at : at + size]) for at in range(0, len(steps), size)]
    found = thinned(np.array(steps), points)
    assert len(found) <= points
    np.testing.assert_allclose(found, expected)


def test_the_bound_is_36_steps_at_the_papers_epsilon_and_grows_with_exploring():
    assert most_steps(32, 0.01) == 36
    assert most_steps(32, 0.1) == pytest.approx(39.6)


def test_an_optimal_explorer_keeps_the_bound_at_every_epsilon():
    """Walks of someone who knows the way, counted: their mean lies below the bound, and not far below."""
    random = np.random.default_rng(3)
    for epsilon in (0.01, 0.05, 0.1):
        steps = []
        for _ in range(400):
            at, count = 0, 0
            while at < 32:  # a corridor: of four exploring moves one goes on, one back, and two hit the wall
                move = 1 if random.random() >= epsilon else random.choice([1, -1, 0, 0])
                at, count = max(at + move, 0), count + 1
            steps.append(count)
        assert 0.85 * most_steps(32, epsilon) < np.mean(steps) < 0.93 * most_steps(32, epsilon)


def test_measures_of_a_run():
    run = train(puzzle(0.9), "q-learning", LearnSettings(episodes=800, alpha=0.2, epsilon=0.01), seed=1)
    found = measured(run, 32)
    converged = int(found["converged"])
    assert 150 < converged < 250
    assert found["converges"] == found["optimal"] == 1
    assert found["steps_until"] == sum(run.steps[:converged])
    assert found["mean_before"] == pytest.approx(sum(run.steps[:converged]) / converged)
    assert found["mean_after"] == pytest.approx(np.mean(run.steps[converged:]))
    assert found["last_steps"] == found["greedy_steps"] == 32
    short = measured(replace(run, steps=run.steps[:30]), 32)
    assert (short["converged"], short["converges"]) == (30, 0)
    assert np.isnan(short["mean_after"])


# --- statistics ---


def test_spreads_shares_and_fits():
    assert statistics.spread(np.arange(101.0)) == Spread(50, 2.5, 97.5)
    none, half, everyone = (statistics.share(np.array([1.0] * k + [0.0] * (30 - k))) for k in (0, 15, 30))
    assert (none.low, everyone.high) == (0, 1)
    assert everyone.low == pytest.approx(0.025 ** (1 / 30))  # Clopper and Pearson's bound when all agree
    assert half.low < 0.5 < half.high
    x = np.arange(12.0)
    fit = statistics.least_squares({"x": x.tolist()}, (3 - 2 * x + 0.01 * np.cos(7 * x)).tolist())
    assert fit["x"].low < -2 < fit["x"].high
    assert fit["1"].low < 3 < fit["1"].high
    assert fit["x"].high - fit["x"].low < 0.01
    with pytest.raises(ValueError, match="2 points cannot judge"):
        statistics.least_squares({"x": [1.0, 2.0]}, [1.0, 2.0])


def test_the_interval_of_a_ratio_holds_the_true_one_about_as_often_as_it_says():
    random = np.random.default_rng(5)
    hits = 0
    for _ in range(100):
        ratio = statistics.ratio_of_medians(random.exponential(2, 30), random.exponential(1, 30))
        hits += ratio.low <= 2 <= ratio.high
    assert hits >= 88


def test_few_runs_are_judged_by_their_extremes():
    ratio = statistics.ratio_of_medians(np.array([1.0, 3.0]), np.array([2.0, 4.0]))
    assert ratio == Spread(2 / 3, 0.25, 1.5)
    assert statistics.ratio_of_medians(np.array([1.0]), np.array([2.0, 4.0])) == Spread(1 / 3, 0.0, np.inf)
    assert statistics.median_interval(np.array([3.0, 1.0, 2.0])) == Spread(2.0, 1.0, 3.0)
    assert statistics.median_interval(np.array([3.0])) == Spread(3.0, -np.inf, np.inf)


def test_the_interval_of_a_median_holds_the_true_one_about_as_often_as_it_says():
    random = np.random.default_rng(6)
    found = [statistics.median_interval(random.exponential(1, 30)) for _ in range(200)]
    assert 180 <= sum(one.low <= np.log(2) <= one.high for one in found) < 200


# --- verdicts, each way ---


def test_verdicts():
    assert verdict({}) == "not measured"
    assert verdict({("run",): True, ("pair",): True}) == "reproduced"
    assert verdict({("run",): False, ("pair",): False}) == "not reproduced"
    assert verdict({("run",): False, ("episode",): True}) == "depends on a reading (episode)"
    both = {(a, b): a == "run" for a in ("run", "pair") for b in ("x", "y")}
    assert verdict(both) == "depends on a reading (run)"
    assert verdict({reading[::-1]: held for reading, held in both.items()}) == "depends on a reading (run)"
    assert verdict({("run", "x"): True, ("run", "y"): False, ("pair", "x"): False, ("pair", "y"): True}) == (
        "depends on a reading (run, x; pair, y)"
    )
    assert shown(("", "x")) == "x"


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        (hql(3400, 3300, 3500), "reproduced"),
        (hql(3400, 3300, 1000), "depends on a reading (run; pair)"),
        (hql(2700, 2700, 1000), "not reproduced"),
        (hql(4200, 4300, 6000), "not reproduced"),
    ],
)
def test_a_number_is_reproduced_within_its_margin(runs, expected):
    assert says(claim(rule="about", of="HQL", paper=3400), runs).verdict == expected


def test_an_exact_number():
    asked = claim(rule="exactly", measure="last_steps", of="QL", paper=32)
    cell = Cell("QL", "q-learning", 0.01, 0.01)
    good, bad = fake(), fake()
    good.measures["last_steps"] = np.full(N, 32.0)
    bad.measures["last_steps"] = np.array([32.0] * (N - 2) + [33.0] * 2)
    assert says(asked, {cell: good}).verdict == "reproduced"
    assert says(asked, {cell: bad}).verdict == "not reproduced"


@pytest.mark.parametrize(
    ("runs", "less", "alike"),
    [
        (hql(50, 50, 50), "reproduced", "not reproduced"),
        (hql(100, 99, 50), "depends on a reading (episode)", "depends on a reading (run; pair)"),
        (hql(101, 98, 100), "not reproduced", "reproduced"),
        (hql(150, 200, 130), "not reproduced", "not reproduced"),
    ],
)
def test_comparisons(runs, less, alike):
    assert says(claim(rule="less", of="HQL", than="QL"), runs).verdict == less
    assert says(claim(rule="alike", of="HQL", than="QL", margin=0.25), runs).verdict == alike


def test_a_trifle_is_no_difference_however_sure():
    runs = {Cell("A", "hql", 0.01, 0.01): fake(converged=98), Cell("B", "hql", 0.01, 0.01): fake(converged=100)}
    assert says(claim(rule="less", of="A", than="B"), runs).verdict == "not reproduced"
    assert says(claim(rule="less", of="A", than="B", by=0.0), runs).verdict == "reproduced"


def test_falling_along_alpha_takes_every_step():
    def runs(*numbers):
        cells = {Cell("HQL", "hql", 0.1 * at, 0.01): fake(at, converged=n) for at, n in enumerate(numbers, 1)}
        return dict(reversed(cells.items()))  # their order does not matter

    asked = claim(rule="falling", of="HQL", along="alpha")
    assert says(asked, runs(400, 200, 100)).verdict == "reproduced"
    assert says(asked, runs(400, 100, 100)).verdict == "not reproduced"
    assert says(asked, runs(100, 200, 400)).verdict == "not reproduced"


@pytest.mark.parametrize(("missing", "most", "few"), [(0, True, False), (6, False, False), (12, False, True)])
def test_shares(missing, most, few):
    runs = {Cell("QL", "q-learning", 0.2, 0.01): fake(missing=missing)}
    asked = {"rule": "share", "measure": "converges", "of": "QL"}
    assert (says(claim(**asked, at_least=0.5), runs).verdict == "reproduced") == most
    assert (says(claim(**asked, at_most=0.5), runs).verdict == "reproduced") == few


def test_a_share_is_judged_by_the_worst_of_its_cells():
    runs = {Cell("QL", "q-learning", 0.1 * at, 0.01): fake(missing=n) for at, n in enumerate((0, 11, 0), 1)}
    asked = claim(rule="share", measure="converges", of="QL", at_least=0.5)
    found = says(asked, runs)
    assert found.verdict == "not reproduced"
    assert found.measured.startswith("8%")


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(-1.1, -0.9, "reproduced"), (-0.99, None, "not reproduced"), (None, -0.9, "reproduced")],
)
def test_coefficients(low, high, expected):
    asked = Coefficient(rule="coefficient", says="", fit="f", term="x", low=low, high=high)
    assert judge(asked, {}, {"f": {"x": Spread(-1, -1.02, -0.98)}}, {}).verdict == expected


def test_runs_cut_short_are_told_and_are_no_likeness():
    runs = {Cell(name, "hql", 0.01, 0.01): fake(missing=N, converged=100) for name in "AB"}
    found = says(claim(rule="alike", of="A", than="B", margin=0.5), runs)
    assert found.verdict == "not reproduced"
    assert "no run converged in time" in found.measured


def test_lower_bounds_are_not_small():
    """Runs that were cut off at 100 may have needed any number; as what is claimed to be larger they will do."""
    ended, cut = fake(converged=150), fake(1, missing=N, converged=100)
    runs = {Cell("A", "hql", 0.01, 0.01): cut, Cell("B", "hql", 0.01, 0.01): ended}
    assert says(claim(rule="less", of="A", than="B"), runs).verdict == "not reproduced"
    ended.measures["converged"] /= 2
    assert says(claim(rule="less", of="B", than="A"), runs).verdict == "reproduced"
    assert says(claim(rule="about", of="A", paper=100), runs).verdict == "not reproduced"
    along = {Cell("A", "hql", 0.1, 0.01): fake(converged=150), Cell("A", "hql", 0.2, 0.01): cut}
    assert says(claim(rule="falling", of="A", along="alpha"), along).verdict == "not reproduced"


def test_what_a_few_runs_survived_to_show_decides_nothing():
    few, all_of_them = fake(mean_after=30), fake(mean_after=36)
    few.measures["mean_after"][1:] = np.nan
    runs = {Cell("A", "hql", 0.01, 0.01): few, Cell("B", "hql", 0.01, 0.01): all_of_them}
    found = says(claim(rule="less", measure="mean_after", of="A", than="B"), runs)
    assert found.verdict == "not reproduced"
    assert found.measured == f"to be measured in only 1 of {N} runs"


def test_scatter_does_not_make_a_number_come_out():
    random = np.random.default_rng(2)
    for median, expected in ((267, "not reproduced"), (1000, "not reproduced"), (1000, "reproduced")):
        wild = fake()
        scatter = 0.02 if expected == "reproduced" else 1.0
        wild.measures["converged"] = median * np.exp(scatter * random.standard_normal(N))
        runs = {Cell("A", "hql", 0.01, 0.01): wild}
        assert says(claim(rule="about", of="A", paper=1000), runs).verdict == expected


def test_nothing_is_left_out_silently():
    found = says(claim(rule="about", of="new", paper=3), {}, {"new": "no-such-learner"})
    assert found.verdict == "not measured"
    assert "no-such-learner" in found.measured
    lacking = load_study("fig9").model_copy(update={"claims": []})
    series = {"new": lacking.series["HQL"].model_copy(update={"algorithm": "no-such-learner"})}
    study = run_study(prepared("fig9", 2, lacking.model_copy(update={"series": series})), episodes=5)
    assert study.notes == ["new: left out, no learner 'no-such-learner' in this version"]
    nothing = fake()
    nothing.measures["mean_after"][:] = np.nan
    asked = claim(rule="about", measure="mean_after", of="QL", paper=3)
    assert says(asked, {Cell("QL", "q-learning", 0.1, 0.01): nothing}).measured == "nothing to measure in any run"


def test_readings_that_say_the_same_share_a_line():
    assert says(claim(rule="about", of="HQL", paper=10), hql(10, 10, 90)).measured.startswith("run; pair: 10 (")


# --- settings ---


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_asks_for_what_exists(name):
    study = prepared(name)
    assert not study.missing
    chosen = study.settings
    for series in chosen.series.values():
        assert series.algorithm in RULES
    runs = dict.fromkeys(study.cells, fake())
    for asked in chosen.claims:
        for selector in getattr(asked, "selectors", tuple)():
            cells = selected(selector, runs)
            assert cells, asked.says
            if asked.rule not in ("falling", "share"):
                assert len(cells) == len({cell.reading for cell in cells}), asked.says
    assert len({asked.says for asked in chosen.claims}) == len(chosen.claims)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("title:", "tilte:", "title: Field required"),
        ("seeds: 4", "sedes: 4", "sedes: Extra inputs are not permitted"),
        ("rule: about", "rule: abuot", "abuot"),
        ("paper: 9", "paper: 9, papre: 9", "papre: Extra inputs"),
        ("eta_counter: run", "eta_cuonter: run", "did you mean 'eta_counter'?"),
        ("seeds: 4", "seeds: 1", "greater than or equal to 2"),
    ],
)
def test_wrong_settings_are_refused(tmp_path: Path, old, new, said):
    text = """\
title: t
source: s
seeds: 4
series: {A: {algorithm: hql, alpha: [0.1], readings: {run: {eta_counter: run}}}}
claims:
  - {rule: about, says: x, measure: converged, of: A, paper: 9}
"""
    (tmp_path / "fig7").mkdir()
    file = tmp_path / "fig7" / "settings.yaml"
    file.write_text(text)
    assert load_study("fig7", tmp_path).seeds == 4
    file.write_text(text.replace(old, new))
    with pytest.raises(SettingError) as caught:
        load_study("fig7", tmp_path)
    assert said in str(caught.value)


def test_unknown_studies_and_selectors_are_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'fig7'"):
        load_study("fgi7")
    with pytest.raises(ValidationError, match="gamma"):
        claim(rule="about", of={"series": "QL", "gamma": 0.9}, paper=1)


# --- running ---


def small(name: str) -> Prepared:
    """A study with 3 seeds and little of everything."""
    chosen = load_study(name)
    return prepared(name, 3, chosen.model_copy(update={"points": 7}))


def test_threads_change_nothing():
    study = small("fig8")
    mazes = {"puzzle": puzzle(0.9)}
    told: list[int] = []
    one, three = (
        run_cells(study.settings, study.cells, mazes, seeds=3, episodes=40, threads=threads, watch=told.append)
        for threads in (1, 3)
    )
    for a, b in zip(one, three, strict=True):
        for name in MEASURES:
            np.testing.assert_array_equal(a.measures[name], b.measures[name])
        np.testing.assert_array_equal(a.curve, b.curve)
    assert told == [*range(1, study.n_runs + 1)] * 2
    run = train(mazes["puzzle"], "q-learning", LearnSettings(episodes=40, alpha=0.01, epsilon=0.01), seed=2)
    np.testing.assert_array_equal(one[0].curve[2], thinned(run.steps, 7))


def test_an_error_in_a_run_ends_the_study():
    study = small("fig8")
    with pytest.raises(KeyError):
        run_cells(study.settings, [replace(study.cells[0], maze="none")], {"puzzle": puzzle(0.9)}, seeds=3, episodes=9)


def test_documents_hold_seeds_spread_and_version():
    study = run_study(small("fig9"), episodes=60)
    document = study_document(study)
    assert document["seeds"] == [0, 1, 2]
    assert document["episodes"] == 60
    assert document["qualrl"]
    assert document["measured"][0]["converged"] == {"median": 60, "low": 60, "high": 60}
    assert document["measured"][0]["mean_after"] is None
    curve = document["curves"][0]
    assert curve["episodes"] == [9, 18, 27, 36, 45, 54, 60]
    assert all(low <= mid <= high for low, mid, high in zip(curve["low"], curve["median"], curve["high"], strict=True))


def test_tables_in_markdown():
    table = markdown(("a", "b"), [("x|y", "1\n2")])
    assert table == "| a | b |\n|---|---|\n| x/y | 1<br>2 |\n"


def test_study_settings_do_not_change():
    chosen: StudySettings = load_study("fig7")
    with pytest.raises(ValidationError, match="frozen"):
        chosen.seeds = 3  # type: ignore[misc]
