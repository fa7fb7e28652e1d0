"""Why a plan takes a doorway: against sweeps over the region alone, simulated walks, and sums of rewards."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.account import account_of_policy, account_of_walk
from qualrl.answers.slope import Slope
from qualrl.answers.through import way_through
from qualrl.answers.ways import course
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.qualitative.graph import crossings_of
from qualrl.solving.exact import exact_values
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
PROBLEMS = st.tuples(st.sampled_from(CELLS), st.sampled_from(CELLS)).filter(lambda ends: ends[0] != ends[1])
MOTIONS = st.tuples(st.sampled_from([4, 8]), st.sampled_from([0.0, 0.2]))


def model_of(ends, motion, gamma=0.95):
    directions, slip = motion
    return qualrl.build(
        REGIONS, list(ends[1]), start=list(ends[0]), gamma=gamma, directions=directions, slip=slip
    )  # fmt: skip


def chances(world):
    found = np.full((world.n_actions, world.n_actions), world.slip / (world.n_actions - 1))
    np.fill_diagonal(found, 1 - world.slip)
    return found


def value_through(model, door):
    """(S,) values in the start's region when one doorway alone is open and what is beyond is worth as ever."""
    world, region = model.grid, int(model.region_of[model.start])
    everywhere = exact_values(world).value
    others = [of for of in REGIONS.doorways if region in of.pair and of.name != door.name]
    shut = model.with_closed(of.name for of in others).grid
    ends = shut.successor.astype(int)
    at_goal = ends == world.goal
    paid = np.where(at_goal, world.goal_reward, world.move_reward)
    values = np.where(model.region_of == region, 0.0, everywhere)
    for _ in range(600):
        after = np.where(at_goal, 0.0, values[ends])
        swept = ((paid + world.gamma * after) @ chances(world).T).max(axis=1)
        values = np.where(model.region_of == region, swept, everywhere)
    return values


@settings(deadline=None, max_examples=40)
@given(PROBLEMS, MOTIONS)
def test_ways_through_a_doorway_are_worth_what_sweeps_over_the_region_find(ends, motion):
    model = model_of(ends, motion)
    region = int(model.region_of[model.start])
    assume(region != model.region_of[model.grid.goal])
    exact = exact_values(model.world)
    for door in [door for door in REGIONS.doorways if region in door.pair]:
        found = way_through(model, exact, model.start, door)
        assert found.shifted - exact.shift == pytest.approx(value_through(model, door)[model.start], abs=1e-6)
        out, there = found.parts[0][-2:]
        side = door.pair.index(region)
        steps = {tuple(model.grid.state_of[cell] for cell in pair) for pair in crossings_of(REGIONS, door)}
        assert all(model.region_of[state] == region for state in found.parts[0][:-1])
        if motion[0] == 4:
            assert (out, there) in {pair if side == 0 else pair[::-1] for pair in steps}
        assert found.walk[-1] == model.grid.goal
        assert all(b in model.grid.successor[a] for a, b in zip(found.walk[:-1], found.walk[1:], strict=True))


@settings(deadline=None, max_examples=40)
@given(PROBLEMS, MOTIONS)
def test_entries_add_up_to_the_values(ends, motion):
    model = model_of(ends, motion)
    answer = qualrl.questions.why(model)
    assert answer.best.value == pytest.approx(exact_values(model.world).value[model.start])
    if answer.other is None:
        assert answer.entries == ()
        assert "nothing to choose" in answer.explain()
        return
    assert answer.other.value <= answer.best.value + 1e-9 * abs(answer.best.value)
    assert sum(entry.best for entry in answer.entries) == pytest.approx(answer.best.value, abs=1e-6)
    assert sum(entry.other for entry in answer.entries) == pytest.approx(answer.other.value, abs=1e-6)
    assert (answer.contrast is None) == (motion[1] > 0)
    goals = [entry for entry in answer.entries if entry.kind == "the goal"]
    assert goals
    assert all(entry.best >= 0 and entry.other >= 0 for entry in goals)
    assert {entry.kind for entry in answer.entries} <= {"steps", "the goal", *(["diagonal steps"] * (motion[0] == 8))}


@settings(deadline=None, max_examples=25)
@given(PROBLEMS, st.sampled_from([4, 8]))
def test_a_walks_account_is_its_rewards_by_place(ends, directions):
    model = model_of(ends, (directions, 0.0))
    path = [int(model.grid.state_of[cell]) for cell in qualrl.plan(model).path]
    account = account_of_walk(model, path)
    assert sum(account.values()) == pytest.approx(course(model, path).value(model.gamma))
    expected: dict[str, float] = {}
    for t, (a, b) in enumerate(pairwise(path)):
        far = np.hypot(*(model.grid.cells[b] - model.grid.cells[a]))
        reward = 100.0 if b == model.grid.goal else -far
        name = model.region_names[model.region_of[b if b == model.grid.goal else a]]
        expected[name] = expected.get(name, 0.0) + model.gamma**t * reward
    by_place = {name: sum(of for (place, _), of in account.items() if place == name) for name in expected}
    assert by_place == pytest.approx(expected)


def test_a_policys_account_is_the_mean_of_walks():
    model = model_of(((2, 2), (8, 24)), (8, 0.3), gamma=0.97)
    world, exact = model.grid, exact_values(model.world)
    slope = Slope(world, world.successor, exact.shifted, exact.shift)
    moves = np.array([int(slope.best_moves(state).argmax()) for state in range(len(world))])
    account = account_of_policy(model, world.successor.astype(np.int64), moves, np.arange(len(world)), model.start)
    generator, n_walks = np.random.default_rng(0), 3000
    found = {key: np.zeros(n_walks) for key in account}
    for walk in range(n_walks):
        state, discount = model.start, 1.0
        while state != world.goal:
            move = moves[state]
            if generator.random() < world.slip:
                move = generator.choice([other for other in range(8) if other != move])
            after = int(world.successor[state, move])
            kind = "the goal" if after == world.goal else "steps" if world.move_length[move] == 1 else "diagonal steps"
            reward = world.goal_reward if after == world.goal else world.move_reward[move]
            place = model.region_of[after if after == world.goal else state]
            found[model.region_names[place], kind][walk] += discount * reward
            state, discount = after, discount * world.gamma
    for key, samples in found.items():
        assert abs(samples.mean() - account[key]) < 5 * samples.std() / np.sqrt(n_walks) + 1e-9, key
    assert sum(account.values()) == pytest.approx(exact.value[model.start])


def test_it_may_be_asked_anywhere():
    model = model_of(((2, 2), (2, 24)), (4, 0.0))
    places = qualrl.plan(model).places
    answer = qualrl.questions.why(model, at=places[1])
    assert answer.at == places[1]
    assert answer.best.places == places[1:]
    off = next(name for name in model.region_names if name not in places)
    assert qualrl.questions.why(model, at=off).best.places[0] == off
    last = qualrl.questions.why(model, at=places[-1])
    assert last.action == "walk to the goal"
    assert last.other is None


def test_what_cannot_be_asked_is_refused():
    model = model_of(((2, 2), (2, 24)), (4, 0.0))
    with pytest.raises(UnknownNameError, match="no region is called 'kitchen'"):
        qualrl.questions.why(model, at="kitchen")
    door = next(door for door in REGIONS.doorways if model.region_of[model.start] in door.pair)
    shut = model.with_closed(of.name for of in REGIONS.doorways if of.name != door.name)
    with pytest.raises(NoPlanError):
        qualrl.questions.why(shut)
    table = qualrl.HybridMDP.from_table(model.grid.table(), ["all"] * len(model), start=model.start)
    with pytest.raises(SettingError, match="without a map"):
        qualrl.questions.why(table)


@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_the_command_answers(tmp_path, slip):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text("map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\n")
    asked = "why", "loop.scenario.yaml", "--set", f"motion.slip={slip}"
    document = json.loads(qualrl_command(*asked, "--json", cwd=tmp_path)[0])
    said = qualrl_command(*asked, cwd=tmp_path)[0]
    assert said.splitlines() == document["sentences"]
    margin = document["best"]["value"] - document["other"]["value"]
    assert sum(entry["difference"] for entry in document["entries"]) == pytest.approx(margin, abs=1e-6)
    assert f"The {margin:.3g} at gamma" in said
    error = qualrl_command(*asked, "--at", "kitchen", cwd=tmp_path, expect=2)[1]
    assert error.count("\n") == 1
