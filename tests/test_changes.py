"""Doors that close and open while a robot learns: the changed world, its validation, and who recovers."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.api import build, plan
from qualrl.api import train as train_verb
from qualrl.errors import NoPlanError, ScenarioError, SettingError, UnknownNameError
from qualrl.io.model_file import read_model, write_model
from qualrl.io.scenario import dump_scenario, load_scenario
from qualrl.learning.changes import Change
from qualrl.learning.recovery import attainable_steps, until_recovered
from qualrl.learning.rules import RULES, Loop
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner, train
from qualrl.models.grid_world import GridWorld
from qualrl.spatial.segmentation import segment
from tests.command_here import qualrl
from tests.test_commands import draw
from tests.worlds import free_masks, grid_of

TWO_WAYS = """
#####################
#.......#...........#
#.......#...........#
#.......#...........#
#...................#
#.......#...........#
#.......#...........#
#.......#...........#
####.########.#######
####.########.#######
#...................#
#...................#
#####################
"""
ADAPTIVE = [name for name, rule in RULES.items() if rule.loop is not Loop.TASKS]


def two_ways(start=(1, 1), **settings):
    """Door 1 is the short way from start to goal (24 steps), doors 3 and 2 with the corridor the long one (36)."""
    return build(segment(grid_of(TWO_WAYS)), (1, 19), start=start, **({"gamma": 0.95} | settings))


def leads(world, cell, move):
    """The cell a move leads to."""
    state = world.successor[world.state_of[cell], world.action_names.index(move)]
    return tuple(world.cells[state].tolist())


@pytest.mark.parametrize("directions", [4, 8])
def test_a_closed_door_is_a_wall_and_all_states_stay(directions):
    model = two_ways(directions=directions)
    closed = model.with_closed(["door 1"])
    assert len(closed) == len(model)
    np.testing.assert_array_equal(closed.grid.cells, model.grid.cells)
    changed = np.argwhere(closed.grid.successor != model.grid.successor)
    assert {tuple(model.grid.cells[state].tolist()) for state, _ in changed} <= {(4, 8), (4, 9), (4, 7)}
    assert model.grid.steps_to_goal[model.start] == (24 if directions == 4 else 18)
    assert closed.grid.steps_to_goal[model.start] == (36 if directions == 4 else 27)
    (wall,) = closed.grid.closed
    assert leads(closed.grid, wall[0], "left" if wall[0][1] > wall[1][1] else "right") == wall[0]
    assert "door 1" not in [key for *_, key in closed.graph.edges(keys=True)]
    assert plan(closed).places == ("room B", "corridor 1", "room A")
    assert plan(closed, (4, 7), goal=(4, 9)).places == ("room B", "corridor 1", "room A")


def lands(free, walls, cell, down, right):
    """The twin: where a move leads, a diagonal one only if all four steps round its corner are open."""

    def step(a, b):
        return (a, b) not in walls and (b, a) not in walls and is_free(a) and is_free(b)

    def is_free(at):
        return 0 <= at[0] < free.shape[0] and 0 <= at[1] < free.shape[1] and free[at]

    end = (cell[0] + down, cell[1] + right)
    by = [(cell[0] + down, cell[1]), (cell[0], cell[1] + right)]
    way = [(cell, end)] if 0 in (down, right) else [pair for at in by for pair in ((cell, at), (at, end))]
    return end if all(step(*pair) for pair in way) else cell


@given(st.data(), free_masks(side=5, connected=False), st.sampled_from([4, 8]))
@settings(deadline=None)
def test_walls_between_cells_block_what_the_twin_says(data, free, directions):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    pairs = [(a, b) for a in cells for b in cells if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1]
    walls = tuple(data.draw(st.lists(st.sampled_from(pairs), max_size=4))) if pairs else ()
    world = GridWorld(free, cells[0], 0.9, directions=directions, closed=walls)
    moves = {"up": (-1, 0), "down": (1, 0), "left": (0, -1), "right": (0, 1)}
    for name in world.action_names:
        down, right = (sum(moves[part][axis] for part in name.split("-")) for axis in (0, 1))
        for cell in cells:
            assert leads(world, cell, name) == lands(free, set(walls), cell, down, right)


def test_a_closed_model_survives_its_file(tmp_path):
    closed = two_ways().with_closed(["door 1"])
    write_model(closed, tmp_path / "model.npz")
    again = read_model(tmp_path / "model.npz")
    np.testing.assert_array_equal(again.grid.successor, closed.grid.successor)
    assert sorted(again.graph.edges(keys=True)) == sorted(closed.graph.edges(keys=True))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ([Change(5, "dor 1")], UnknownNameError, r"changes\[0\]: no doorway is called 'dor 1'; did you mean 'door 1'"),
        ([Change(100, "door 1")], SettingError, r"changes\[0\]: after must be from 1 to 99"),
        ([Change(0, "door 1")], SettingError, "after must be from 1 to 99"),
        ([Change(5, "door 1"), Change(4, "door 1", True)], SettingError, r"changes\[1\].* in order, but 4 follows 5"),
        ([Change(5, "door 1"), Change(6, "door 1")], SettingError, r"changes\[1\]: door 1 is closed already"),
        ([Change(5, "door 1", True)], SettingError, "door 1 is open already"),
        ([Change(5, "door 1"), Change(6, "door 2")], NoPlanError, r"changes\[1\]: after episode 6 door 2 closes"),
    ],
)  # fmt: skip
def test_changes_that_cannot_be_are_told_before_learning(changes, error, words):
    with pytest.raises(error, match=words):
        train(two_ways(), "hql", LearnSettings(episodes=100), changes=changes)


def test_a_way_must_stay_open_between_episodes_only():
    swap = [Change(5, "door 1"), Change(9, "door 2"), Change(9, "door 1", True)]
    run = train(two_ways(), "hql", LearnSettings(episodes=100), changes=swap)
    assert [event.what for event in run.changes] == ["door 1 closes", "door 2 closes and door 1 opens"]
    with pytest.raises(NoPlanError, match="leave a way open"):
        train(two_ways(None), "hql", LearnSettings(episodes=9), changes=[Change(5, "door 1"), Change(6, "door 2")])


@pytest.mark.parametrize("algorithm", [name for name in RULES if name not in ADAPTIVE])
def test_learners_that_walk_by_the_map_refuse_changes(algorithm):
    with pytest.raises(SettingError, match=f"{algorithm} walks by ways"):
        train(two_ways(), algorithm, LearnSettings(episodes=20), changes=[Change(5, "door 1")])


@pytest.mark.parametrize("algorithm", ADAPTIVE)
def test_the_world_changes_exactly_between_two_episodes(algorithm):
    """Until then nothing differs from a run without; from then on no episode is shorter than the new optimum."""
    chosen = LearnSettings(episodes=80, alpha=0.5, epsilon=0.1, max_steps=5000)
    still = train(two_ways(), algorithm, chosen, seed=3)
    changed = train(two_ways(), algorithm, chosen, seed=3, changes=[Change(60, "door 1")])
    np.testing.assert_array_equal(still.steps[:60], changed.steps[:60])
    assert changed.steps[60:].min() >= 36
    assert changed.optimal_steps == 36
    assert still.optimal_steps == 24


def test_a_learner_changes_its_own_world_only_and_slices_change_nothing(monkeypatch):
    model = two_ways()
    before = model.grid.successor.copy()
    chosen = LearnSettings(episodes=60, alpha=0.5, epsilon=0.1)
    first = train(model, "hql-replay", chosen, seed=1, changes=[Change(30, "door 1")])
    np.testing.assert_array_equal(model.grid.successor, before)
    monkeypatch.setattr("qualrl.learning.trainer.SLICE_S", 1e-7)
    again = train(model, "hql-replay", chosen, seed=1, changes=[Change(30, "door 1")])
    np.testing.assert_array_equal(first.q, again.q)


def test_a_planner_is_not_told_of_a_closed_door():
    """It keeps what it has seen until it bumps into the door."""
    model = two_ways()
    learner = start_learner(model, "hql-replay", LearnSettings(episodes=100, epsilon=0.0))
    while learner.progress.whole[2] < 20:
        learner.advance(100)
    before = learner.learned().q
    learner.change_world(model.with_closed(["door 1"]).grid)
    np.testing.assert_array_equal(learner.learned().q, before)
    learner.advance(2000)
    assert learner.learned().q[model.start].max() < before[model.start].max()


@pytest.mark.parametrize(
    ("algorithm", "slip", "most"),
    [("q-learning", 0.0, 100), ("hql", 0.0, 100), ("dyna-q", 0.0, 60), ("prioritized-sweeping", 0.0, 15),
     ("hql-replay", 0.0, 3), ("hql-replay", 0.1, 60)],
)  # fmt: skip
def test_learners_get_over_a_door_that_closes(algorithm, slip, most):
    for seed in range(3):
        chosen = LearnSettings(episodes=800, alpha=0.5, epsilon=0.1)
        run = train(two_ways(slip=slip), algorithm, chosen, seed, changes=[Change(400, "door 1")])
        (recovery,) = run.recovery
        assert (recovery.what, recovery.optimum_before, recovery.optimum_after) == ("door 1 closes", 24, 36)
        assert recovery.episodes is not None
        assert recovery.episodes <= most
        assert recovery.steps == run.steps[400 : 400 + recovery.episodes].sum()
        if slip == 0:
            assert run.greedy_steps == run.optimal_steps == 36


def test_after_a_change_replay_ends_at_the_values_of_the_changed_world():
    """Its values start over from what was seen; but for what nobody tried again, they are those of the new world."""
    run = train(two_ways(), "hql-replay", LearnSettings(episodes=600), changes=[Change(300, "door 1")])
    on_way = run.model.grid.state_of[[1, 4, 8, 10, 10, 9, 1], [1, 4, 4, 4, 13, 13, 19]]
    np.testing.assert_allclose(run.q[on_way].max(axis=1), run.exact_values[on_way], atol=1e-6)


def test_a_door_that_opens_again_is_found_by_those_who_happen_to_try_it():
    """From a start beside the door exploring moves find it; from one far away it is as if it stayed closed."""
    chosen = LearnSettings(episodes=1600, alpha=0.5, epsilon=0.1)
    changes = [Change(300, "door 1"), Change(600, "door 1", True)]
    for algorithm in ("q-learning", "dyna-q", "hql-replay"):
        beside = train(two_ways((4, 7)), algorithm, chosen, 1, changes=changes)
        assert beside.optimal_steps == 15
        assert beside.greedy_steps <= 17
        assert np.median(beside.steps[500:600]) > 30
        assert np.median(beside.steps[-100:]) < 20
        far = train(two_ways(), algorithm, dataclasses.replace(chosen, epsilon=0.0), 1, changes=changes)
        assert (far.greedy_steps, far.optimal_steps) == (36, 24)
        assert far.recovery[1].episodes is None
        assert far.recovery[1].fresh_episodes is not None


def test_a_run_without_changes_has_nothing_to_recover_from():
    assert train(two_ways(), "hql", LearnSettings(episodes=5)).recovery == ()


def test_recovered_is_when_the_next_fifty_are_good_on_average():
    steps = np.array([1000, 500, 200] + [40] * 60)
    assert until_recovered(steps, 40.0) == (3, 1700)
    assert until_recovered(steps, 38.0) == (None, None)
    assert until_recovered(steps[:52], 40.0) == (None, None)
    assert until_recovered(np.full(60, 41), 40.0) == (0, 0)


def test_attainable_steps_are_the_optimum_when_nothing_is_left_to_chance():
    assert attainable_steps(two_ways(), LearnSettings(epsilon=0.0)) == 24
    assert 25 < attainable_steps(two_ways(), LearnSettings(epsilon=0.1)) < 30


SCENARIO = "map: ways.yaml\nstart: [1, 1]\ngoal: [1, 19]\nlearn: {episodes: 50}\nchanges:\n  - "


def test_a_scenario_says_what_changes(tmp_path):
    file = tmp_path / "ways.scenario.yaml"
    file.write_text(SCENARIO + "{after: 10, close: door 1}\n  - {after: 20, open: door 1}\n")
    scenario = load_scenario(file)
    assert scenario.door_changes() == (Change(10, "door 1"), Change(20, "door 1", True))
    file.write_text(dump_scenario(scenario))
    assert load_scenario(file) == scenario
    assert scenario.with_settings(["changes=[]"]).door_changes() == ()
    model = scenario.build(segment(grid_of(TWO_WAYS)))
    assert train_verb(model, "hql", changes=scenario.door_changes(), episodes=30).optimal_steps == 24
    with pytest.raises(UnknownNameError, match=r"scenario.yaml: changes\[0\]: .*did you mean 'door 1'"):
        scenario.with_settings(["changes=[{after: 9, close: dor 1}]"]).build(segment(grid_of(TWO_WAYS)))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{after: 10}", "6:5: changes.0: must say either 'close: DOORWAY' or 'open: DOORWAY'"),
        ("{after: 10, close: a, open: b}", "must say either"),
        ("{after: 0, close: door 1}", "changes.0.after: must be at least 1, got 0"),
        ("{aftr: 10, close: door 1}", "changes.0.aftr: unknown key; did you mean 'after'"),
        ("door 1", r"changes.0: must hold keys \(after, close, open\), got 'door 1'"),
    ],
)
def test_a_wrong_change_is_told_with_its_place(tmp_path, line, words):
    file = tmp_path / "s.yaml"
    file.write_text(SCENARIO + line + "\n")
    with pytest.raises(ScenarioError, match=words):
        load_scenario(file)


def test_the_command_tells_how_a_change_was_got_over(tmp_path):
    draw(tmp_path, "ways", TWO_WAYS)
    (tmp_path / "ways.scenario.yaml").write_text(SCENARIO.replace("50", "200") + "{after: 100, close: door 1}\n")
    out, _ = qualrl("run", "ways.scenario.yaml", "-o", "out", cwd=tmp_path)
    assert "after episode 100 door 1 closes (optimum 24 -> 36 steps): recovered after 0 episodes, 0 steps;" in out
    assert "learned policy: 36 steps; optimum: 36 steps" in out
    assert "go through door 3 to corridor 1" in out
    (change,) = json.loads((tmp_path / "out/learn.json").read_text())["changes"]
    assert set(change) == {
        "after", "what", "optimum_before", "optimum_after", "attainable", "episodes", "steps", "fresh_episodes",
        "fresh_steps",
    }  # fmt: skip
    assert (change["after"], change["what"], change["episodes"]) == (100, "door 1 closes", 0)
    out, _ = qualrl("plan", "out", "--from", "4,7", "--to", "4,9", cwd=tmp_path)
    assert "room B -> corridor 1 -> room A" in out
    _, err = qualrl("learn", "ways.scenario.yaml", "--episodes", "90", cwd=tmp_path, expect=2)
    assert err == (
        "qualrl: ways.scenario.yaml: changes[0]: after must be from 1 to 89, as there are 90 episodes, got 100\n"
    )


@pytest.mark.parametrize("algorithm", ["q-learning", "sarsa", "hql-replay"])
def test_doors_that_close_for_one_run_are_open_for_the_next(algorithm):
    model = two_ways()
    before = train_verb(model, algorithm, episodes=30)
    changed = train_verb(model, algorithm, episodes=30, changes=[Change(2, "door 1")])
    after = train_verb(model, algorithm, episodes=30)
    assert (changed.steps != before.steps).any()
    np.testing.assert_array_equal(before.steps, after.steps)
    np.testing.assert_array_equal(before.q, after.q)
