"""The compiled loop against a textbook twin, draw for draw; and what must hold of every learner."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.api import training_of
from qualrl.errors import NoPlanError, SettingError, UnknownNameError
from qualrl.kernels import stepping
from qualrl.learning.learner import seed_stream
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP
from tests import oracles
from tests.learning_worlds import from_python
from tests.worlds import PUZZLE, free_masks, grid_of

PAPERS = ("q-learning", "hql")
"""The rows that ``oracles.learn`` implements; test_traces, test_planners and test_hql_settings cover the others."""
BOUNDED = (*PAPERS, "dyna-q", "prioritized-sweeping", "hql-replay")
"""Rows whose values are means of what can be had; a trace with a large alpha overshoots."""
PAPER_MARKS = [(11, 1), (1, 1), (1, 11), (11, 11), (9, 9), (9, 3), (3, 3), (3, 9), (2, 6), (8, 6), (6, 6)]


def model_with_marks(world: GridWorld, marks, start=None) -> HybridMDP:
    """A hybrid model of one region whose landmarks are single cells."""
    from qualrl.models.landmarks import landmark_level
    from qualrl.qualitative.graph import graph_of_mapping

    landmark_of = np.full(len(world), -1, np.int32)
    for index, cell in enumerate(marks):
        landmark_of[world.state_of[cell]] = index
    level = landmark_level([str(cell) for cell in marks], landmark_of, [(0,)] * len(marks))
    region_of = np.zeros(len(world), np.int32)
    return HybridMDP(world, ("all",), region_of, level, graph_of_mapping(("all",), []), start)


def puzzle(start=(11, 1), slip=0.0, directions=4) -> HybridMDP:
    world = GridWorld(grid_of(PUZZLE).free, (6, 6), 0.9, slip, directions)
    return model_with_marks(world, PAPER_MARKS, None if start is None else int(world.state_of[start]))


def twin_run(model, algorithm, chosen: LearnSettings, seed):
    """The same run by the textbook twin."""
    world, level = model.world, model.landmarks
    grid = oracles.GridTwin(world.free, world.goal_cell, world.directions, world.slip)
    moves = len(grid.moves)

    def step(s, a, draws):
        move = a
        if world.slip:
            x = (next(draws) >> 11) / 2**53
            if x < world.slip:
                move = (a + 1 + min(int(x / world.slip * (moves - 1)), moves - 2)) % moves
        to = grid.lands(grid.cells[s], move)
        cost = world.step_reward * float(np.hypot(*grid.moves[move]))
        return grid.cells.index(to), world.goal_reward if to == grid.goal else cost

    arcs = [set(level.arc_target[a:b].tolist()) for a, b in zip(level.arc_start[:-1], level.arc_start[1:], strict=True)]
    return oracles.learn(
        step, lambda s: grid.cells[s] == grid.goal, model.starts.tolist(), len(world), moves,
        gamma=world.gamma, alpha=chosen.alpha, epsilon=chosen.epsilon, episodes=chosen.episodes, seed=seed,
        max_steps=chosen.max_steps, landmarks=(level.landmark_of.tolist(), arcs) if algorithm == "hql" else None,
        eta0=chosen.eta0, power=chosen.eta_power, counter=chosen.eta_counter,
    )  # fmt: skip


@pytest.mark.parametrize("algorithm", PAPERS)
@pytest.mark.parametrize("counter", ["run", "pair", "episode"])
@pytest.mark.parametrize(("slip", "directions", "start"), [(0.0, 4, (11, 1)), (0.3, 4, None), (0.2, 8, (11, 1))])
def test_compiled_loop_equals_the_textbook_to_the_last_bit(algorithm, counter, slip, directions, start):
    model = puzzle(start, slip, directions)
    chosen = LearnSettings(episodes=12, alpha=0.2, epsilon=0.05, eta_counter=counter, max_steps=700)
    run = train(model, algorithm, chosen, seed=7)
    q, steps, returns = twin_run(model, algorithm, chosen, seed=7)
    assert run.steps.tolist() == steps
    np.testing.assert_array_equal(run.returns, returns)
    np.testing.assert_array_equal(run.q, q)


def test_a_table_learns_as_the_textbook_does():
    world = GridWorld(grid_of(PUZZLE).free, (6, 6), 0.9, slip=0.25)
    table = world.table()
    model = HybridMDP.from_table(table, ["left" if c < 6 else "right" for _, c in world.cells.tolist()], start=3)
    level = model.landmarks
    chosen = LearnSettings(episodes=10, alpha=0.3, epsilon=0.1, max_steps=500)

    def step(s, a, draws):
        x = (next(draws) >> 11) / 2**53
        row = s * 4 + a
        for entry in range(table.row_start[row], table.row_start[row + 1]):
            if x < table.cumulative[entry] or entry == table.row_start[row + 1] - 1:
                return int(table.target[entry]), float(table.reward[entry])
        raise AssertionError

    arcs = [set(level.arc_target[a:b].tolist()) for a, b in zip(level.arc_start[:-1], level.arc_start[1:], strict=True)]
    for algorithm in PAPERS:
        run = train(model, algorithm, chosen, seed=2)
        q, steps, returns = oracles.learn(
            step, lambda s: bool(table.terminal[s]), [3], len(table), 4, gamma=0.9, alpha=0.3, epsilon=0.1,
            episodes=10, seed=2, max_steps=500,
            landmarks=(level.landmark_of.tolist(), arcs) if algorithm == "hql" else None,
        )  # fmt: skip
        assert run.steps.tolist() == steps
        np.testing.assert_array_equal(run.q, q)
        np.testing.assert_array_equal(run.returns, returns)


@given(st.integers(0, 2**63 - 1))
@settings(max_examples=20, deadline=None)
def test_random_stream_is_xoshiro(seed):
    words = seed_stream(seed)
    twin = oracles.xoshiro(seed)
    state = tuple(np.uint64(w) for w in words)
    draw = from_python(stepping.draw)
    for _ in range(20):
        u, *state = (np.uint64(word) for word in draw(*state))
        assert int(u) == next(twin)


def test_slicing_a_run_changes_nothing(monkeypatch):
    model = puzzle()
    chosen = LearnSettings(episodes=60, alpha=0.1, epsilon=0.1)
    whole = train(model, "hql", chosen, seed=3)
    monkeypatch.setattr("qualrl.learning.trainer.SLICE_S", 1e-7)
    seen = []
    sliced = train(model, "hql", chosen, seed=3, watch=seen.append)
    np.testing.assert_array_equal(whole.q, sliced.q)
    np.testing.assert_array_equal(whole.steps, sliced.steps)
    np.testing.assert_array_equal(whole.arc_q, sliced.arc_q)
    assert len(seen) > 1
    assert seen[-1].episode == seen[-1].episodes == 60
    assert seen[-1].total_steps == whole.total_steps == whole.steps.sum()


@given(
    st.data(), free_masks(side=6), st.sampled_from(BOUNDED), st.sampled_from([0.0, 0.3]), st.sampled_from([4, 8]),
    st.floats(0.05, 1.0), st.floats(0.0, 1.0), st.sampled_from([0.0, 0.5, 0.95]), st.floats(-5, 100),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_learned_values_stay_within_the_bounds_of_discounted_rewards(
    data, free, algorithm, slip, directions, alpha, epsilon, gamma, prize
):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 1)
    goal = data.draw(st.sampled_from(cells))
    marks = data.draw(st.lists(st.sampled_from(cells), unique=True, max_size=6))
    world = GridWorld(free, goal, gamma, slip, directions, -1.0, max(prize, -1.0))
    model = model_with_marks(world, marks)
    run = train(model, algorithm, LearnSettings(episodes=20, alpha=alpha, epsilon=epsilon, max_steps=300), seed=1)
    low, high = (bound / (1 - gamma) for bound in world.reward_bounds)
    assert run.q.min() >= min(low, 0) - 1e-9
    assert run.q.max() <= max(high, 0) + 1e-9
    assert (run.steps >= 1).all()
    assert (run.steps <= 300).all()


@given(
    st.data(), free_masks(side=6), st.sampled_from([4, 8]),
    st.sampled_from([("q-learning", "run"), ("hql", "run"), ("hql", "pair")]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_once_converged_the_greedy_policy_is_worth_the_exact_optimum(data, free, directions, learner):
    algorithm, counter = learner
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 1)
    goal = data.draw(st.sampled_from(cells))
    marks = data.draw(st.lists(st.sampled_from(cells), unique=True, max_size=5))
    world = GridWorld(free, goal, 0.9, directions=directions)
    chosen = LearnSettings(episodes=40_000, alpha=0.5, epsilon=0.5, eta_counter=counter)
    run = train(model_with_marks(world, marks), algorithm, chosen, seed=4)
    twin = oracles.GridTwin(free, goal, directions)
    policy = {tuple(cell): int(np.argmax(run.q[s])) for s, cell in enumerate(world.cells.tolist())}
    worth = oracles.exact_policy_values(twin, 0.9, policy)
    exact = twin.values(0.9)
    assert [worth[c] for c in twin.cells] == pytest.approx([exact[c] for c in twin.cells], abs=1e-6)
    assert run.max_error < 1e-3


def test_restarted_weights_may_keep_the_policy_off_the_optimum():
    """Why "episode" is not the default: exploring detours are handed down in every episode, for ever."""
    free = np.ones((2, 3), bool)
    world = GridWorld(free, (0, 0), 0.9, directions=8)
    optimum = oracles.GridTwin(free, (0, 0), 8).values(0.9)
    worst = {}
    for counter in ("run", "episode"):
        chosen = LearnSettings(episodes=40_000, alpha=0.5, epsilon=0.5, eta_counter=counter)
        runs = [train(model_with_marks(world, [(0, 0), (0, 1)]), "hql", chosen, seed) for seed in range(5)]
        worst[counter] = max(abs(run.q[s].max() - v) for run in runs for s, v in enumerate(optimum.values()))
    assert worst["run"] < 1e-6
    assert worst["episode"] > 0.1


@pytest.mark.parametrize("algorithm", BOUNDED)
def test_under_slip_the_greedy_policy_comes_near_the_optimum(algorithm):
    free = grid_of("#####\n#...#\n#.#.#\n#...#\n#####").free
    world = GridWorld(free, (3, 3), 0.9, slip=0.2)
    twin = oracles.GridTwin(free, (3, 3), slip=0.2)
    exact = twin.values(0.9)
    losses = []
    for seed in range(5):
        run = train(
            model_with_marks(world, [(1, 1), (1, 3), (3, 1)]), algorithm,
            LearnSettings(episodes=20_000, alpha=0.01, epsilon=0.3, eta_counter="run"), seed,
        )  # fmt: skip
        policy = {tuple(cell): int(np.argmax(run.q[s])) for s, cell in enumerate(world.cells.tolist())}
        worth = oracles.exact_policy_values(twin, 0.9, policy)
        losses.append(max(exact[c] - worth[c] for c in twin.cells))
        assert run.max_error < 3
    assert np.median(losses) < 0.5


def episodes_until_converged(steps, window=50, most=36) -> int:
    means = np.convolve(steps, np.ones(window) / window, "valid")
    late = np.flatnonzero(means > most)
    return int(late[-1]) + window if len(late) else 0


def test_landmark_step_restarted_each_episode_is_what_speeds_the_puzzle_up():
    """paper.md's law: depth of the maze over alpha for Q-learning, the longest stretch over alpha with the restart."""
    found = {}
    for algorithm, counter in (("q-learning", "run"), ("hql", "run"), ("hql", "pair"), ("hql", "episode")):
        chosen = LearnSettings(episodes=1500, alpha=0.05, epsilon=0.01, eta_counter=counter)
        runs = [train(puzzle(), algorithm, chosen, seed) for seed in range(9)]
        assert all(run.greedy_steps == run.optimal_steps == 32 for run in runs)
        found[algorithm, counter] = np.median([episodes_until_converged(run.steps) for run in runs])
    assert 500 < found["q-learning", "run"] < 660
    assert found["hql", "run"] == pytest.approx(found["q-learning", "run"], rel=0.05)
    assert found["hql", "pair"] == pytest.approx(found["q-learning", "run"], rel=0.05)
    assert found["hql", "episode"] < 0.65 * found["q-learning", "run"]


def test_same_seed_same_result_other_seed_another():
    first, again, other = (train(puzzle(), "hql", LearnSettings(episodes=30), seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.q, again.q)
    assert not np.array_equal(first.steps, other.steps)


def test_errors_of_training_are_told_before_it_starts():
    with pytest.raises(UnknownNameError, match="did you mean 'hql'"):
        qualrl.train(puzzle(), "hqll")
    with pytest.raises(UnknownNameError, match="did you mean 'alpha'"):
        qualrl.train(puzzle(), "hql", alhpa=0.1)
    for wrong in ({"alpha": 0}, {"epsilon": 1.1}, {"episodes": 0}, {"max_steps": 0}, {"eta0": 1}, {"eta_power": 1}):
        with pytest.raises(SettingError, match=next(iter(wrong))):
            qualrl.train(puzzle(), "hql", **wrong)
    with pytest.raises(SettingError, match="eta_counter"):
        qualrl.train(puzzle(), "hql", eta_counter="never")
    with pytest.raises(SettingError, match="seed"):
        qualrl.train(puzzle(), "hql", seed=-1)
    cut_off = model_with_marks(GridWorld(np.array([[True, False, True]]), (0, 0), 0.9), [], start=1)
    with pytest.raises(NoPlanError, match="no way leads"):
        qualrl.train(cut_off, "hql")
    alone = model_with_marks(GridWorld(np.array([[True]]), (0, 0), 0.9), [])
    with pytest.raises(NoPlanError, match="only place"):
        qualrl.train(alone, "hql")


def test_hybrid_mdp_of_a_table_names_its_crossings():
    table = TabularMDP.from_outcomes(
        {
            0: {0: [(1.0, 1, -1.0, False)]},
            1: {0: [(0.5, 2, -1.0, False), (0.5, 0, -1.0, False)]},
            2: {0: [(1.0, 3, 5.0, True)]},
            3: {0: [(1.0, 3, 0.0, True)]},
        },
        0.9,
    )
    model = HybridMDP.from_table(table, {0: "A", 1: "A", 2: "B", 3: "B"}, start=0)
    assert model.region_names == ("A", "B")
    assert list(model.graph.edges(keys=True)) == [("A", "B", "A to B")]
    assert model.landmarks.names == ("A to B", "goal")
    assert model.landmarks.landmark_of.tolist() == [-1, -1, 0, 1]
    assert model.landmarks.arcs == [("A to B", "goal"), ("goal", "A to B")]
    training = training_of(train(model, "hql", LearnSettings(episodes=500, alpha=0.1), seed=0))
    assert training.exact_values[2] == pytest.approx(5.0)
    assert training.max_error < 1
    plan = training.plan(start=0)
    assert plan.places == ("A", "B")
    assert "B" in plan.explain()
    with pytest.raises(SettingError, match="states 0 to 3"):
        training.plan(start=9)


def test_what_another_verb_makes_is_asked_for():
    grid = grid_of(PUZZLE)
    with pytest.raises(TypeError, match=r"segment needs an OccupancyGrid, from qualrl.read_map, got str"):
        qualrl.segment("puzzle.png")
    with pytest.raises(TypeError, match=r"build needs a RegionMap, from qualrl.segment, got OccupancyGrid"):
        qualrl.build(grid, [6, 6])
    with pytest.raises(TypeError, match=r"train needs a HybridMDP, from qualrl.build or .*, got RegionMap"):
        qualrl.train(qualrl.segment(grid))
    with pytest.raises(TypeError, match=r"plan needs a HybridMDP or a Training.*, got RegionMap"):
        qualrl.plan(qualrl.segment(grid))
    with pytest.raises(SettingError, match="numbered from 0"):
        TabularMDP.from_outcomes({}, 0.9)
    table = TabularMDP.from_outcomes({0: {0: [(1.0, 1, 1.0, True)]}, 1: {0: [(1.0, 1, 0.0, True)]}}, 0.9)
    assert repr(puzzle()) == "<HybridMDP: 75 states, 1 regions, 11 landmarks, gamma 0.9, start 64>"
    with pytest.raises(SettingError, match="1 qualitative states named for 2 states"):
        HybridMDP.from_table(table, ["here"])
    with pytest.raises(SettingError, match="start and goal are the same"):
        qualrl.train(HybridMDP.from_table(table, ["here", "there"], start=1))
