"""The one table of the benchmarks: verdicts, lines, and parts that break off."""

import dataclasses
import json
import sys

import numpy as np
import pytest

from qualrl.models.landmark_ways import NONE, LandmarkWays
from tests.benchmarks import __main__ as command
from tests.benchmarks import peers
from tests.benchmarks.effort import Effort
from tests.benchmarks.exact_values import ERROR, GAMMA, sparse_table, value_iteration, world
from tests.benchmarks.peers import Environments, Peer, PeerError
from tests.benchmarks.processes import ProcessError, apart, peak_mb, run, run_python
from tests.benchmarks.table import HEADINGS, Row, at_least, at_most, bounded, line, short, spread, summary
from tests.benchmarks.worlds_for_peers import maze_data, option_moves
from tests.learning_worlds import rooms


@pytest.mark.parametrize(
    ("target", "ratios", "verdict"),
    [
        (at_least(0.85), [0.5, 0.85, 0.9], "yes"),
        (at_least(0.85), [0.9, 0.84, 0.5], "NO"),
        (at_least(0.85, each=True), [0.5, 0.85, 0.9], "NO"),
        (at_most(1), [0.9, 1.0, 7.0], "yes"),
        (at_most(1), [0.9, 1.01, 7.0], "NO"),
        (at_most(1, each=True), [0.9, 1.0, 1.01], "NO"),
        (at_most(1, each=True), [0.9, 1.0], "yes"),
        (None, [0.1], "-"),
    ],
)
def test_verdicts_go_by_the_median_or_by_each(target, ratios, verdict):
    assert Row(1, "", ratios=ratios, target=target).verdict == verdict
    assert Row(1, "", ratios=np.array(ratios), target=target).verdict == verdict


def test_what_was_not_measured_is_neither_reached_nor_silent():
    row = Row(2, "options", beside="Peer", target=at_least(500), missing="Peer cannot be installed: no wheel")
    assert row.verdict == "?"
    assert "Peer cannot be installed: no wheel" in line(row.cells)


def test_a_bound_is_divided_by():
    row = bounded(3, "solving", "CPU s", [0.5, 2.0, 0.25], 1.0)
    assert (row.ratios, row.verdict, row.ours, row.beside) == ([0.5, 2.0, 0.25], "yes", "0.5 CPU s", "bound 1 CPU s")
    assert bounded(3, "solving", "CPU s", [1.1], 1.0).verdict == "NO"


def test_numbers_are_short():
    assert [short(value) for value in (0.00123456, 0.5, 12.345, 99.99, 1234.5)] == [
        "0.00123",
        "0.5",
        "12.3",
        "100",
        "1,234",
    ]
    assert spread([3.0, 1.0, 2.0]) == "2 (1 to 3)"
    assert spread([0.5]) == "0.5"


def test_lines_stand_in_columns():
    row = Row(1, "learning", "2 M steps/s", "C 4 M steps/s", [0.5], at_least(0.3))
    heading, found = line(HEADINGS), line(row.cells)
    for name, cell in zip(HEADINGS, row.cells, strict=True):
        assert found[heading.index(name) :].startswith(cell)
    assert summary([row, dataclasses.replace(row, target=at_least(1)), Row(1, "", missing="lost")]) == (
        "1 reached, 1 not, 1 not measured"
    )


def test_a_part_that_breaks_off_keeps_its_rows_and_says_so(monkeypatch, tmp_path):
    def part(effort):
        yield Row(1, "first", ratios=[1.0])
        raise RuntimeError("out of luck")

    monkeypatch.setitem(command.PARTS, 1, (part, lambda effort: iter([Row(1, "other", ratios=[1.0])])))
    found = list(command.all_rows([1], Effort(True, Environments(tmp_path))))
    assert [row.what for row in found] == ["first", "test_benchmark_table", "other"]
    assert "out of luck" in found[1].missing


def test_targets_are_chosen_by_number():
    assert command.subjects_of("1,3") == [1, 3]
    with pytest.raises(Exception, match="targets 1 to 8"):
        command.subjects_of("9")


class Here(Environments):
    """Runs scripts of peers with our own interpreter."""

    def _python(self, peer):
        return sys.executable


def test_a_script_gets_its_data_and_its_answer_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "SCRIPTS", tmp_path)
    script = """
import json, sys, numpy
data = numpy.load(sys.argv[1])
print("talk")
print(json.dumps({"sum": int(data["a"].sum())}))
"""
    (tmp_path / "with_tester.py").write_text(script)
    assert Here(tmp_path).run(Peer("tester", "Tester", ()), {"a": np.arange(4)}) == {"sum": 6}
    (tmp_path / "with_tester.py").write_text("raise SystemExit('no licence')")
    with pytest.raises(PeerError, match="Tester failed: no licence"):
        Here(tmp_path).run(Peer("tester", "Tester", ()), {})


def test_a_peer_is_installed_once_and_a_failure_is_remembered(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(peers.venv, "create", lambda home, **_: (home.mkdir(exist_ok=True), made.append(home)))

    def no_such_package(command, seconds, trouble):
        raise PeerError(f"{trouble}: no such package")

    environments = Environments(tmp_path)
    peer = Peer("tester", "Tester", (("tester==1",),))
    monkeypatch.setattr(peers, "_run", no_such_package)
    for _ in range(2):
        with pytest.raises(PeerError, match="Tester cannot be installed: no such package"):
            environments.run(peer, {})
    assert made == [tmp_path / "tester"]
    calls = []

    def works(command, seconds, trouble):
        calls.append(command[1:3])
        return json.dumps({"calls": len(calls)})

    monkeypatch.setattr(peers, "_run", works)
    assert [Environments(tmp_path).run(peer, {}) for _ in range(2)] == [{"calls": 2}, {"calls": 3}]
    newer = dataclasses.replace(peer, installs=(("tester==2",),))
    assert Environments(tmp_path).run(newer, {}) == {"calls": 5}


def test_options_are_handed_over_as_the_learner_takes_them():
    model = rooms()
    ways = LandmarkWays.of(model)
    moves, goal = option_moves(ways, len(model)), model.grid.goal
    assert moves.shape == (len(ways), len(model))
    for option, of_state in enumerate(moves):
        at = np.flatnonzero(of_state != NONE)
        assert len(at)
        for state in at.tolist():
            steps = 0
            while of_state[state] != NONE:
                state, steps = int(model.grid.successor[state, of_state[state]]), steps + 1
                assert steps < len(model)
            assert model.landmarks.landmark_of[state] == ways.landmark[option] or state == goal
    assert maze_data(model, 0.1, 0.2)["goal"] == goal


def test_the_sparse_table_keeps_the_goal_and_has_our_values():
    grid = world(21, 0.2)
    step, reward = sparse_table(grid)
    goal = slice(grid.goal * 4, grid.goal * 4 + 4)
    assert step[goal].tocoo().col.tolist() == [grid.goal] * 4
    assert not reward[goal].any()
    np.testing.assert_allclose(step.sum(axis=1), 1)
    value = value_iteration(grid, step, reward)
    backup = (reward + GAMMA * (step @ value)).reshape(-1, 4).max(axis=1)
    assert np.abs(backup - value).max() < ERROR * (1 - GAMMA)


def test_processes_are_measured_on_their_own():
    block = np.ones(30_000_000)  # ours, which the others have no part in
    busy = "import time\nwhile time.process_time() < 0.5: pass"
    assert 0.4 < run_python(busy).cpu_s < 2
    assert apart(peak_mb) < block.nbytes / 2**20
    with pytest.raises(ProcessError, match="no luck"):
        run_python("raise SystemExit('no luck')")
    with pytest.raises(ProcessError, match="exit code 3"):
        run_python("raise SystemExit(3)")
    with pytest.raises(ProcessError, match="not done after"):
        run([sys.executable, "-c", "import time; time.sleep(9)"], most_s=0.2)
