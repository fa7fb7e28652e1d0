"""Learning without a map: what becomes known, what keeps its name and its values, and what it costs."""

import itertools
import json
from functools import cache

import numpy as np
import pytest

from qualrl.api import build
from qualrl.api import train as train_verb
from qualrl.errors import NoPlanError, SettingError
from qualrl.kernels import replay
from qualrl.learning.changes import Change
from qualrl.learning.levels_anew import regions_anew, same_landmarks, upper_anew
from qualrl.learning.one_step import OneStepLearner
from qualrl.learning.online import UNKNOWN, Online, known_model, train_online
from qualrl.learning.planners import PlanningLearner, relevant_regions
from qualrl.learning.rules import RULES, Loop, rule_named
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.models.landmarks import landmark_level
from qualrl.spatial.growing import KeptNames
from qualrl.spatial.segmentation import segment
from qualrl.spatial.sensing import KnownMap
from tests.command_here import qualrl
from tests.learning_worlds import from_python
from tests.test_commands import draw
from tests.worlds import grid_of

FIVE_ROOMS = """
###############################
#.........#.........#.........#
#.........#.........#.........#
#.........#.........#.........#
#...................#.........#
#.........#.........#.........#
#.........#.........#.........#
#.........#.........#.........#
####.##########.#########.#####
####.##########.#########.#####
#.............................#
#.............................#
##############.################
##############.################
#.............................#
#.............................#
#.............................#
#.............................#
#.............................#
###############################
"""
EXPLORING = [name for name, rule in RULES.items() if rule.loop is not Loop.TASKS]
EVERY_HUNDRED = Online(radius_m=6.0, every=100)


@cache
def rooms():
    return segment(grid_of(FIVE_ROOMS))


def five_rooms(start=(4, 2), goal=(4, 28), **settings):
    return build(rooms(), goal, start=start, **({"gamma": 0.95} | settings))


def known_after(model, places, radius_m=6.0):
    """What is known after looking around at some cells, and the model made of it."""
    known = KnownMap(model.regions.grid, radius_m)
    at = np.zeros(model.regions.grid.shape, bool)
    at[tuple(np.transpose(places))] = True
    known.look_from(at)
    found = segment(known.grid())
    return known, found, known_model(model, found, known)


def test_what_is_not_known_is_a_region_of_its_own_beside_every_way_on():
    truth = five_rooms()
    known, found, model = known_after(truth, [(4, 2), (4, 8)])
    assert len(model) == len(truth)
    assert model.world is truth.world
    assert model.region_names == (*found.region_names, UNKNOWN)
    unknown = model.region_of == len(found.regions)
    np.testing.assert_array_equal(unknown, ~known.free[truth.grid.free])
    assert model.graph.has_edge(found.region_names[0], UNKNOWN)
    assert model.landmarks.names[-1] == "goal"
    assert model.landmarks.regions[-1] == ()
    assert (model.landmarks.landmark_of != len(model.landmarks.names) - 1).all()
    assert relevant_regions(model).all()


def test_once_all_is_known_it_is_the_map():
    truth = five_rooms()
    _, found, model = known_after(truth, np.argwhere(truth.grid.free))
    assert [region.cells for region in found.regions] == [region.cells for region in truth.regions.regions]
    np.testing.assert_array_equal(model.region_of, truth.region_of)
    np.testing.assert_array_equal(model.landmarks.landmark_of, truth.landmarks.landmark_of)
    assert model.landmarks.arcs == truth.landmarks.arcs
    assert list(model.graph.neighbors(UNKNOWN)) == []
    np.testing.assert_array_equal(relevant_regions(model)[:-1], relevant_regions(truth))
    assert not relevant_regions(model)[-1]


def test_names_stay_with_their_places():
    """Even where a place looks like another kind for a while; what is new gets a name that was never used."""
    truth = five_rooms()
    names, seen = KeptNames(), []
    views = [[(4, 2)], [(4, 2), (4, 8)], [(4, 2), (4, 8), (4, 15)], [(4, 2), (4, 8), (4, 15), (9, 4), (11, 12)]]
    for places in views:
        seen.append(names.apply(known_after(truth, places)[1]))
    assert len({name for regions in seen for name in regions.all_names}) >= len(seen[-1].all_names)
    first = seen[0].region_names[0]
    assert all(regions.region_names[regions.label[4, 2]] == first for regions in seen)
    again = names.apply(known_after(truth, views[-1])[1])
    assert again.all_names == seen[-1].all_names
    back = names.apply(known_after(truth, views[0])[1])
    assert back.region_names[back.label[4, 2]] == first


def test_arcs_between_landmarks_that_stayed_keep_their_values():
    before = landmark_level(["a", "b", "c"], np.array([0, 1, 1, -1, 2], np.int32), [(0,), (0,), (0,)])
    now = landmark_level(["new", "c", "b", "a"], np.array([3, 2, 2, 0, 1], np.int32), [(0,)] * 4)
    kept = same_landmarks(now, before)
    assert kept.tolist() == [-1, 2, 1, 0]
    moved = landmark_level(["a", "b"], np.array([0, 1, -1, -1, -1], np.int32), [(0,), (0,)])
    assert same_landmarks(moved, before).tolist() == [0, -1]
    model = five_rooms()
    learner = OneStepLearner(model, rule_named("hql"), LearnSettings()).with_seed(0)
    upper = learner._upper._replace(
        arc_start=before.arc_start, arc_target=before.arc_target, arc_q=np.arange(6.0), arc_visits=np.arange(6),
        pair_count=np.arange(12),
    )  # fmt: skip
    anew = upper_anew(upper, now, kept, 4)
    value = dict(zip(before.arcs, np.arange(6.0), strict=True))
    assert anew.arc_q.tolist() == [value.get(arc, 0.0) for arc in now.arcs]
    assert anew.arc_visits.tolist() == [value.get(arc, 0) for arc in now.arcs]
    assert anew.pair_count.reshape(4, 4).tolist() == [[0] * 4, [8, 9, 10, 11], [4, 5, 6, 7], [0, 1, 2, 3]]


def test_states_that_wait_for_a_replay_wait_on_in_their_new_regions():
    model = five_rooms()
    levels = PlanningLearner(model, rule_named("hql-replay"), LearnSettings()).with_seed(0)._levels
    wait = from_python(replay.wait)
    waiting = [5, 90, 33, 200, 34]
    for state in waiting:
        wait(levels, np.uint64(state), 1.0)
    region_of = (np.arange(len(model)) % 3).astype(np.int32)
    change = np.arange(len(model)) / 1000
    anew = regions_anew(levels, region_of, model.landmarks.landmark_of, np.ones(3, bool), change)
    for region in range(3):
        mine = sorted(state for state in waiting if region_of[state] == region)
        start = anew.ring_start[region]
        assert anew.ring[start : start + anew.length[region]].tolist() == mine
        assert anew.due[region] == max((change[state] for state in mine), default=0.0)
    assert anew.notes is levels.notes
    assert anew.notes[replay.WAITING] == len(waiting)


def test_finding_the_same_levels_anew_changes_nothing_for_hql():
    model, chosen = five_rooms(), LearnSettings(episodes=40, alpha=0.5, eta_counter="episode")
    plain, disturbed = (OneStepLearner(model, rule_named("hql"), chosen).with_seed(5) for _ in range(2))
    plain.advance(10**9)
    while disturbed.advance(97):
        disturbed.change_levels(model)
    np.testing.assert_array_equal(plain.learned().q, disturbed.learned().q)
    np.testing.assert_array_equal(plain.learned().arc_q, disturbed.learned().arc_q)
    np.testing.assert_array_equal(plain.progress.steps, disturbed.progress.steps)


@pytest.mark.parametrize("algorithm", ["q-learning", "sarsa", "q-lambda", "dyna-q"])
def test_learners_without_levels_learn_as_if_they_knew_the_map(algorithm):
    model, chosen = five_rooms(), LearnSettings(episodes=60, alpha=0.5)
    run = train_online(model, algorithm, chosen, EVERY_HUNDRED, seed=2)
    np.testing.assert_array_equal(run.steps, train(model, algorithm, chosen, seed=2).steps)
    assert run.growth.stages[-1].known_cells > run.growth.stages[0].known_cells


@pytest.mark.parametrize("algorithm", ["hql", "hql-replay"])
@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_without_a_map_it_learns_the_optimum_all_the_same(algorithm, slip):
    model = five_rooms(slip=slip)
    run = train_online(model, algorithm, LearnSettings(episodes=800, alpha=0.3), EVERY_HUNDRED, seed=1)
    assert run.greedy_steps == run.optimal_steps
    assert run.model is model
    assert run.knew_map.growth is None
    assert run.knew_map.greedy_steps == run.optimal_steps
    stages = run.growth.stages
    assert [stage.known_cells for stage in stages] == sorted({stage.known_cells for stage in stages})
    assert not stages[0].knows_goal
    assert stages[-1].knows_goal
    assert stages[0].regions < stages[-1].regions
    for at, later in itertools.pairwise(stages[:-1]):
        assert later.known_cells >= 1.1 * at.known_cells or later.knows_goal != at.knows_goal
    assert run.growth.regions.grid.free.sum() == stages[-1].known_cells <= run.growth.free_cells == len(model)


def test_a_robot_that_sees_everything_at_once_knows_the_map():
    model = build(
        segment(grid_of("#########\n#.......#\n#.......#\n#.......#\n#########")), (3, 7), start=(1, 1), gamma=0.9
    )
    chosen = LearnSettings(episodes=50)
    run = train_online(model, "hql-replay", chosen, Online(radius_m=20.0), seed=3)
    assert len(run.growth.stages) == 1
    assert run.growth.stages[0].known_cells == run.growth.free_cells
    np.testing.assert_array_equal(run.steps, train(model, "hql-replay", chosen, seed=3).steps)


def test_the_same_seed_gives_the_same_growth():
    chosen = LearnSettings(episodes=30)
    first, again = (train_online(five_rooms(), "hql-replay", chosen, EVERY_HUNDRED, seed=4) for _ in range(2))
    assert first.growth.stages == again.growth.stages
    np.testing.assert_array_equal(first.q, again.q)


@pytest.mark.parametrize("algorithm", EXPLORING)
def test_what_a_learner_has_visited(algorithm):
    """All of it lies on its way, and little is missed."""
    from qualrl.learning.trainer import start_learner

    model = five_rooms()
    learner = start_learner(model, algorithm, LearnSettings(alpha=0.5, policy="random"), seed=1)
    learner.advance(400)
    visited = learner.visited()
    assert visited[model.start]
    assert 20 < visited.sum() <= 400
    reached = model.grid.cells[visited]
    assert (np.abs(reached - np.array([4, 2])).sum(axis=1) <= 400).all()


@pytest.mark.parametrize("algorithm", [name for name in RULES if name not in EXPLORING])
def test_learners_that_walk_by_the_map_cannot_do_without(algorithm):
    with pytest.raises(SettingError, match=f"{algorithm} walks by ways"):
        train_online(five_rooms(), algorithm, LearnSettings(episodes=5), Online())


def test_what_cannot_be_is_told_before_learning():
    with pytest.raises(SettingError, match="needs a start"):
        train_online(five_rooms(None), "hql", LearnSettings(episodes=5), Online())
    with pytest.raises(SettingError, match="radius must be from 1 m"):
        train_online(five_rooms(), "hql", LearnSettings(episodes=5), Online(radius_m=0.5))
    for wrong in ({"growth": 0}, {"every": 0}):
        with pytest.raises(SettingError, match=next(iter(wrong))):
            Online(**wrong)
    with pytest.raises(SettingError, match="drop one of the two"):
        train_verb(five_rooms(), "hql", online=Online(), changes=[Change(5, "door 1")])
    apart = segment(grid_of("...#...\n...#...\n...#..."))
    with pytest.raises(NoPlanError, match="no way leads"):
        train_online(build(apart, (1, 6), start=(1, 1)), "hql", LearnSettings(episodes=5), Online())


def test_the_command_explores_and_compares(tmp_path):
    draw(tmp_path, "rooms", FIVE_ROOMS)
    (tmp_path / "rooms.scenario.yaml").write_text(
        "map: rooms.yaml\nstart: [4, 2]\ngoal: [4, 28]\nlearn: {episodes: 60, gamma: 0.95}\n"
    )
    out, _ = qualrl("learn", "rooms.scenario.yaml", "--radius", "6", "-o", "out", "--json", cwd=tmp_path)
    document = json.loads(out)
    growth = document["growth"]
    assert set(growth) == {"free_cells", "stages", "knew_map"}
    assert set(growth["stages"][0]) == {
        "steps", "episode", "known_cells", "regions", "doorways", "landmarks", "knows_goal"
    }  # fmt: skip
    assert growth["stages"][0]["known_cells"] < growth["stages"][-1]["known_cells"] <= growth["free_cells"]
    assert growth["knew_map"]["greedy_steps"] == document["greedy_steps"] == document["optimal_steps"]
    assert (tmp_path / "out/growth.png").stat().st_size > 5000
    assert "radius_m: 6.0" in (tmp_path / "out/scenario.yaml").read_text()
    out, _ = qualrl("plan", "out", cwd=tmp_path)
    assert "room" in out
    out, _ = qualrl("run", "out/scenario.yaml", "-o", "again", cwd=tmp_path)
    assert "the map as it became known" in out
    assert "without the map: first episode" in out
    assert "knowing the map: first episode" in out
    assert json.loads((tmp_path / "again/learn.json").read_text())["growth"]["stages"] == growth["stages"]
    _, err = qualrl("learn", "rooms.scenario.yaml", "--radius", "-1", cwd=tmp_path, expect=2)
    assert "--radius: must be greater than 0" in err
