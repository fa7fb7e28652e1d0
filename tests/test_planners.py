"""Dyna-Q, prioritized sweeping and hql-replay: textbook twins, and what must hold of all that they learn."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.kernels import replay, stepping
from qualrl.learning.learner import NO_LIMIT
from qualrl.learning.planners import relevant_regions
from qualrl.learning.rules import RULES, Loop
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner, train
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP
from tests import oracles_learning
from tests.learning_worlds import World, random_table, rooms, table_model, table_models
from tests.oracles_learning import DenseMDP
from tests.worlds import PUZZLE, TWO_ROOMS, free_masks, grid_of

MODELS = {
    "puzzle": lambda: rooms(),
    "slippery puzzle, any start": lambda: rooms(slip=0.3, start=None),
    "eight moves": lambda: rooms(slip=0.2, directions=8),
    "table": lambda: table_model(random_table(3, 30, 4)),
    "table without chance": lambda: table_model(random_table(4, 30, 4, most_outcomes=1)),
}
ALPHA_MEANS_NOTHING = ("prioritized-sweeping", "hql-replay")
STEP_BY_STEP = sorted(name for name, rule in RULES.items() if rule.loop is not Loop.TASKS)


@pytest.mark.parametrize("alpha", [0.2, "8/(16+k)"])
@pytest.mark.parametrize("where", list(MODELS))
def test_dyna_equals_the_textbook_to_the_last_bit(alpha, where):
    model = MODELS[where]()
    world = World(model)
    chosen = LearnSettings(episodes=5, alpha=alpha, epsilon=0.1, max_steps=200, planning_steps=4)
    run = train(model, "dyna-q", chosen, seed=6)
    certain = isinstance(model.world, GridWorld) and not model.world.slip
    q, steps, returns = oracles_learning.dyna_q(
        world.step, world.terminal, world.starts, world.n_states, world.n_actions, planning_steps=4, gamma=model.gamma,
        alpha=(lambda k: 0.2) if alpha == 0.2 else (lambda k: 8 / (16 + k)), epsilon=0.1, episodes=5, seed=6,
        max_steps=200, order=None if certain else lambda s, a: [one[3] for one in world.outcomes(s, a)],
    )  # fmt: skip
    assert run.steps.tolist() == steps
    assert run.returns.tolist() == returns
    np.testing.assert_array_equal(run.q, q)


@pytest.mark.parametrize("planning_steps", [1, 5, 50])
@pytest.mark.parametrize("where", list(MODELS))
def test_prioritized_sweeping_equals_the_textbook_to_the_last_bit(planning_steps, where):
    """Ties of priority included: both keep to the textbook's binary heap."""
    model = MODELS[where]()
    world = World(model)
    chosen = LearnSettings(
        episodes=6, epsilon=0.1, max_steps=300, planning_steps=planning_steps, planning_threshold=1e-4
    )
    run = train(model, "prioritized-sweeping", chosen, seed=6)
    q, steps, returns = oracles_learning.prioritized_sweeping(
        world.step, world.terminal, world.starts, world.n_states, world.n_actions, planning_steps=planning_steps,
        threshold=1e-4, gamma=model.gamma, epsilon=0.1, episodes=6, seed=6, max_steps=300, before=world.before(),
        certain=isinstance(model.world, GridWorld) and not model.world.slip,
    )  # fmt: skip
    assert run.steps.tolist() == steps
    assert run.returns.tolist() == returns
    np.testing.assert_array_equal(run.q, q)


def lowest_value(world):
    """The least that an action can be worth, which hql-replay holds those to be worth that were never tried."""
    if isinstance(world, GridWorld) and not world.slip:
        return world.step_reward / (1 - world.gamma)
    return min(world.reward_bounds[0], 0.0) / (1 - world.gamma)


def empirical(world: World, seen) -> DenseMDP:
    """The MDP of what was seen, from the counts alone."""

    def outcomes(s, a):
        row = s * world.n_actions + a
        if not seen.tries[row]:
            return []
        if len(seen.counts) == 1:
            return [(1.0, *world.outcomes(s, a)[0][1:3])]
        counted = [(int(seen.counts[number]), s2, reward) for _, s2, reward, number in world.outcomes(s, a)]
        assert sum(n for n, _, _ in counted) == seen.tries[row]
        return [(n / int(seen.tries[row]), s2, reward) for n, s2, reward in counted]

    mdp = DenseMDP.of_outcomes(world.n_states, world.n_actions, outcomes, world.terminal, world.model.gamma)
    mdp.known = seen.tries.reshape(world.n_states, world.n_actions) > 0
    return mdp


def check_against_what_was_seen(model, learner):
    """The values of hql-replay solve the MDP of its counts, up to what it lets go; nothing may wait."""
    assert learner._levels.notes[replay.WAITING] == 0
    assert not learner._levels.waits.any()
    mdp = empirical(World(model), learner._seen)
    q = mdp.optimal(lowest_value(model.world))
    span = np.abs(q - lowest_value(model.world)).max()
    certain = learner._levels.notes[replay.NEEDED] == 1
    let_go = 1e-10 / (1 - model.gamma) if certain else 0.01
    tried = mdp.known & ~mdp.terminal[:, None]
    np.testing.assert_allclose(learner.learned().q[tried], q[tried], rtol=0, atol=let_go * span + 1e-9)


@pytest.mark.parametrize("episodes", [1, 2, 20, 200])
@pytest.mark.parametrize("where", list(MODELS))
def test_replayed_values_are_the_exact_solution_of_what_was_seen(episodes, where):
    model = MODELS[where]()
    chosen = LearnSettings(episodes=episodes, epsilon=0.1, planning_steps=1000)
    learner = start_learner(model, "hql-replay", chosen, seed=episodes)
    learner.advance(200_000)
    assert learner.progress.whole[stepping.EPISODE] == episodes
    check_against_what_was_seen(model, learner)


@given(table_models(), st.integers(1, 30), st.integers(0, 100))
@settings(max_examples=25, deadline=None)
def test_replay_solves_what_was_seen_of_any_table(model, episodes, seed):
    chosen = LearnSettings(episodes=episodes, epsilon=0.1, planning_steps=1000, max_steps=150)
    learner = start_learner(model, "hql-replay", chosen, seed)
    learner.advance(5_000)
    if learner.progress.whole[stepping.EPISODE] == episodes:
        check_against_what_was_seen(model, learner)


@given(table_models(), st.sampled_from(STEP_BY_STEP), st.lists(st.integers(1, 40), min_size=2, max_size=8))
@settings(max_examples=50, deadline=None)
def test_slices_of_any_size_give_the_same_result(model, algorithm, sizes):
    check_slices(model, algorithm, sizes)


@pytest.mark.parametrize("algorithm", STEP_BY_STEP)
@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_slices_of_any_size_give_the_same_result_on_a_map(algorithm, slip):
    check_slices(rooms(slip=slip), algorithm, [1, 7, 30, 1, 2, 400, 5, 900])


def check_slices(model, algorithm, sizes):
    alpha = 0.1 if algorithm in ALPHA_MEANS_NOTHING else "8/(16+k)"  # either is a loop to compile
    chosen = LearnSettings(episodes=10_000, alpha=alpha, epsilon=0.1, max_steps=100, eta_counter="episode")
    whole, sliced = (start_learner(model, algorithm, chosen, 8) for _ in range(2))
    assert whole.advance(sum(sizes)) == sum(sizes)
    for size in sizes:
        assert sliced.advance(size) == size
    np.testing.assert_array_equal(whole.learned().q, sliced.learned().q)
    np.testing.assert_array_equal(whole.learned().arc_q, sliced.learned().arc_q)
    np.testing.assert_array_equal(whole.progress.steps, sliced.progress.steps)
    np.testing.assert_array_equal(whole.progress.returns, sliced.progress.returns)
    np.testing.assert_array_equal(whole.progress.stream, sliced.progress.stream)


@given(table_models(most_outcomes=1), st.integers(1, 400), st.integers(1, 50), st.integers(0, 50))
@settings(max_examples=50, deadline=None)
def test_replayed_values_grow_towards_the_optimum_and_never_pass_it(model, n_steps, planning_steps, seed):
    """Where nothing is left to chance, every value is what some way that was seen is worth."""
    optimum = World(model).dense().optimal()
    chosen = LearnSettings(episodes=10_000, epsilon=0.2, planning_steps=planning_steps, max_steps=200)
    learner = start_learner(model, "hql-replay", chosen, seed)
    known = np.full(optimum.shape, -np.inf)
    for _ in range(3):
        learner.advance(n_steps)
        q = learner.learned().q
        assert (q <= optimum + 1e-9).all()
        assert (q >= known - 1e-9).all()
        known = q


@given(table_models(most_outcomes=1), st.integers(0, 50))
@settings(max_examples=60, deadline=None)
def test_curiosity_alone_finds_the_best_way_among_bad_ends(model, seed):
    """Without chance and without epsilon: what was never tried must not be left for an end that is known."""
    learner = start_learner(model, "hql-replay", LearnSettings(episodes=10**6, epsilon=0.0, max_steps=60), seed)
    learner.advance(200_000)
    best = World(model).dense().optimal()[model.start].max()
    assert learner.learned().q[model.start].max() == pytest.approx(best, abs=1e-6)  # of what is let go


@pytest.mark.parametrize("max_steps", [100, None])
def test_what_was_seen_does_not_wait_for_an_end_that_never_comes(max_steps):
    """Two states of one region, left once in ten million steps: no qualitative transition brings a replay about."""
    rows = {
        0: {0: [(1.0, 0, -1.0, False)], 1: [(1.0, 1, -2.0, False)]},
        1: {0: [(1.0, 0, -1.0, False)], 1: [(1 - 1e-7, 1, -0.1, False), (1e-7, 2, 0.0, True)]},
        2: {0: [(1.0, 2, 0.0, True)], 1: [(1.0, 2, 0.0, True)]},
    }
    model = HybridMDP.from_table(TabularMDP.from_outcomes(rows, 0.9), ["here", "here", "there"], 0)
    chosen = LearnSettings(episodes=10**6, epsilon=0.1, max_steps=max_steps)
    learner = start_learner(model, "hql-replay", chosen, 0)
    learner.advance(20_000)
    optimum = World(model).dense().optimal()
    np.testing.assert_allclose(learner.learned().q[:2], optimum[:2], atol=1e-3)


@given(table_models(most_outcomes=1), st.integers(1, 1000), st.integers(0, 50))
@settings(max_examples=30, deadline=None)
def test_sweeping_is_never_more_hopeful_than_0_for_what_it_does_not_know(model, n_steps, seed):
    """Where nothing is left to chance: an action is worth at most what it is if one could stop anywhere at 0."""
    dense = World(model).dense()
    hopeful = DenseMDP(
        np.concatenate([dense.p, np.zeros_like(dense.p[:, :1])], axis=1),
        np.concatenate([dense.r, np.zeros_like(dense.r[:, :1])], axis=1), dense.terminal, dense.gamma,
    ).optimal()[:, :-1]  # fmt: skip
    learner = start_learner(model, "prioritized-sweeping", LearnSettings(episodes=10_000, epsilon=0.2), seed)
    learner.advance(n_steps)
    assert (learner.learned().q <= np.maximum(hopeful, 0) + 1e-9).all()


def test_greedy_path_is_a_shortest_one_once_nothing_is_left_to_try():
    for text, goal, start in ((PUZZLE, (6, 6), (11, 1)), (U_TURN, (3, 11), (3, 1))):
        model = rooms(text, goal, start, gamma=0.95)
        for seed in range(5):
            run = train(model, "hql-replay", LearnSettings(episodes=60, epsilon=0.0), seed)
            assert run.greedy_steps == nx.shortest_path_length(World(model).twin.graph(), start, goal), (text, seed)


# a corridor in the shape of a U, and a room that joins its two ends: the short way enters the corridor twice
U_TURN = """
#############
#####...#####
#####...#####
#...........#
#.###...###.#
#.#########.#
#.#########.#
#.#########.#
#...........#
#############
"""


@given(st.data(), free_masks(side=7), st.sampled_from([4, 8]), st.integers(0, 30))
@settings(max_examples=40, deadline=None)
def test_the_shortest_path_is_found_on_any_map(data, free, directions, seed):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 1)
    goal, start = data.draw(st.sampled_from(cells)), data.draw(st.sampled_from(cells))
    assume(goal != start)
    regions = qualrl.segment(grid_of("\n".join("".join(".#"[not c] for c in row) for row in free)))
    model = qualrl.build(regions, list(goal), start=list(start), gamma=0.95, directions=directions)
    run = train(model, "hql-replay", LearnSettings(episodes=400, epsilon=0.1, max_steps=400), seed)
    optimum = World(model).dense().optimal()
    worth = run.q[model.start].max()
    assert worth == pytest.approx(optimum[model.start].max(), abs=1e-8)


def test_regions_that_hang_by_one_door_are_left_alone():
    """Only those count that a way may pass which goes through no doorway twice."""
    assert relevant_regions(rooms(U_TURN, (3, 11), (3, 1))).all()
    model = rooms(TWO_ROOMS, (1, 1), (5, 2))  # start and goal in the same room
    assert dict(zip(model.region_names, relevant_regions(model).tolist(), strict=True)) == {
        "room A": True, "room B": False
    }  # fmt: skip
    assert relevant_regions(rooms(TWO_ROOMS, (1, 1), (5, 12))).all()
    assert relevant_regions(rooms(TWO_ROOMS, (1, 1), None)).all()


@pytest.mark.parametrize("gamma", [0.9, 0.99, 0.999, 0.9999, 1 - 1 / 3000])
def test_what_is_worth_nothing_does_not_grow_out_of_a_rounding_error(gamma):
    """Shifted, a step is worth 0 before the goal was found: exactly, or exploration would take it for knowledge."""
    learner = start_learner(rooms(gamma=gamma), "hql-replay", LearnSettings(episodes=1), 0)
    assert (learner._seen.reward == 0).all()
    learner.advance(30)
    assert (learner._value == 0).sum() == len(learner._value) - 1


def test_the_promise_of_a_table_with_bad_ends_is_to_go_on_for_ever():
    rows = {s: {a: [(1.0, min(s + 1, 5) if a else 6, -0.1 if a else -50.0, not a)] for a in range(2)} for s in range(6)}
    rows[6] = {a: [(1.0, 6, 0.0, True)] for a in range(2)}
    learner = start_learner(table_model(TabularMDP.from_outcomes(rows, 0.5), 2), "hql-replay", LearnSettings(), 1)
    assert learner._levels.promise == pytest.approx(-0.2 + 100)


def test_settings_reach_the_planners():
    model = rooms()
    learner = start_learner(model, "prioritized-sweeping", LearnSettings(planning_steps=3, planning_threshold=0.5), 0)
    assert (learner._heap.steps, learner._heap.threshold) == (3, 0.5)
    assert start_learner(model, "dyna-q", LearnSettings(planning_steps=7), 0)._dyna.steps == 7
    levels = start_learner(model, "hql-replay", LearnSettings(tries=4, planning_steps=9), 0)._levels
    assert (levels.tries, levels.steps) == (4, 9)
    assert start_learner(model, "hql-replay", LearnSettings(), 0)._rates.max_steps == NO_LIMIT


@pytest.mark.parametrize("seed", range(4))
def test_gamma_fades_long_before_the_search_ends(seed):
    """At gamma 0.9 a goal 500 cells off is worth 1e-21; neither values nor the search for it may round that to 0."""
    free = np.zeros((3, 1003), bool)
    free[1, 1:-1] = True
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 1.0))
    model = qualrl.build(regions, [1, 1001], start=[1, 501], gamma=0.9)
    run = train(model, "hql-replay", LearnSettings(episodes=3, epsilon=0.0, max_steps=30_000), seed)
    assert run.greedy_steps == 500
    assert run.steps[-1] == 500


def test_a_robot_that_strays_into_a_side_room_finds_the_way_back():
    """A wide door leads from the corridor into a room that no way to the goal passes: it must not be searched."""
    free = np.zeros((36, 62), bool)
    free[1:5, 1:-1] = True
    free[6:-1, 10:50] = True
    free[5, 27:31] = True
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.1), min_area_m2=0.5)
    model = qualrl.build(regions, [2, 60], start=[2, 1], gamma=0.99)
    room = model.region_of[model.grid.state_of[20, 30]]
    assert not relevant_regions(model)[room]
    for seed in range(100):
        learner = start_learner(model, "hql-replay", LearnSettings(episodes=1, epsilon=0.3), seed)
        learner.advance(100_000)
        seen = (learner._seen.tries.reshape(len(model), -1) > 0).any(axis=1)
        assert learner.progress.steps[0] > 0
        assert seen[model.region_of == room].mean() < 0.05
