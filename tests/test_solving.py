"""Exact values and walks against textbook value iteration, linear algebra, exact fractions, networkx and scipy."""

import math

import mpmath
import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from qualrl.errors import PlaceError, SettingError
from qualrl.kernels.bellman import number_outward
from qualrl.models.grid_world import GridWorld
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.solving.exact import action_values, exact_values, off_of, shift_of
from qualrl.solving.policy import greedy_walk
from tests import oracles
from tests.worlds import PUZZLE, free_masks, grid_of


def goals(free):
    return st.sampled_from([(int(r), int(c)) for r, c in np.argwhere(free)])


@given(
    st.data(), free_masks(side=5, connected=False), st.sampled_from([4, 8]),
    st.sampled_from([0.0, 0.2, 0.6, 0.75, 0.95]), st.sampled_from([0.0, 0.5, 0.9, 0.99]),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_exact_values_equal_textbook_value_iteration(data, free, directions, slip, gamma):
    goal = data.draw(goals(free))
    world = GridWorld(free, goal, gamma, slip, directions)
    twin = oracles.GridTwin(free, goal, directions, slip)
    expected = twin.values(gamma)
    found = exact_values(world)
    np.testing.assert_allclose(found.value, [expected[tuple(c)] for c in world.cells.tolist()], atol=1e-8)
    explicit = exact_values(world.table())
    np.testing.assert_allclose(explicit.value, found.value, atol=1e-8)


@pytest.mark.parametrize(("slip", "gamma"), [(0.1, 0.9), (0.5, 0.95), (0.75, 0.95), (0.9, 0.9)])
@pytest.mark.parametrize("directions", [4, 8])
def test_far_states_are_as_exact_as_near_ones(slip, gamma, directions):
    generator = np.random.default_rng(4)
    free = np.pad(generator.random((58, 58)) > 0.2, 1)
    free[30, 30] = True
    world = GridWorld(free, (30, 30), gamma, slip, directions)
    found = exact_values(world)
    reached = world.outward
    assert directions == 8 or found.shifted[reached].min() < 0.03 * found.shifted[reached].max()
    backup = [max(action_values(world, found.shifted, found.shift, state)) for state in reached.tolist()]
    np.testing.assert_allclose(backup, found.shifted[reached], rtol=2e-12)
    swept = exact_values(world.table())  # another loop: all states again and again, from below
    np.testing.assert_allclose(swept.shifted[reached], found.shifted[reached], rtol=1e-9)


@given(st.data(), free_masks(side=7, connected=False), st.sampled_from([4, 8]))
@settings(max_examples=60, deadline=None)
def test_breadth_first_steps_equal_networkx(data, free, directions):
    goal = data.draw(goals(free))
    world = GridWorld(free, goal, 0.9, directions=directions)
    lengths = nx.single_source_shortest_path_length(oracles.GridTwin(free, goal, directions).graph(), goal)
    assert world.steps_to_goal.tolist() == [lengths.get(tuple(cell), -1) for cell in world.cells.tolist()]


@given(st.data(), st.integers(1, 12), st.sampled_from([4, 8]))
def test_states_are_numbered_by_their_place_in_a_list(data, count, directions):
    states = np.array(data.draw(st.permutations(range(count))), np.int64)
    asked = data.draw(st.integers(0, count))
    ends = st.lists(st.integers(0, count - 1), min_size=directions, max_size=directions)
    successor = np.array(data.draw(st.lists(ends, min_size=count, max_size=count)), np.uint32)
    number, near = np.zeros(count, np.uint32), np.zeros((asked, directions), np.uint32)
    number_outward(successor, states, number, near)
    order = states.tolist()
    assert [order.index(state) for state in range(count)] == number.tolist()
    assert near.tolist() == [[order.index(end) for end in successor[state].tolist()] for state in order[:asked]]


def test_puzzle_values_are_exact_fractions():
    world = GridWorld(grid_of(PUZZLE).free, (6, 6), 0.9)
    found = exact_values(world)
    start = world.state_of[11, 1]
    assert world.steps_to_goal[start] == 32
    for state in range(len(world)):
        if state != world.goal:
            expected = oracles.deterministic_value(int(world.steps_to_goal[state]), "9/10")
            assert found.value[state] == pytest.approx(float(expected), rel=1e-12)


def test_shifted_values_tell_cells_apart_where_plain_ones_cannot():
    free = np.ones((1, 3000), bool)
    world = GridWorld(free, (0, 0), 0.9)
    found = exact_values(world)
    assert found.value[2000] == found.value[2001]
    assert np.all(np.diff(found.shifted[1:]) < 0)
    walk, arrived = greedy_walk(world, lambda s: action_values(world, found.shifted, found.shift, s), 2999)
    assert arrived
    assert len(walk) == 3000


def test_unreachable_states_are_worth_walking_for_ever():
    world = GridWorld(np.array([[True, True, False, True]]), (0, 0), 0.9, directions=8)
    assert exact_values(world).value[2] == pytest.approx(-10)


@given(st.data(), free_masks(side=5), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.3]))
@settings(max_examples=30, deadline=None)
def test_greedy_policy_of_exact_values_is_worth_them(data, free, directions, slip):
    goal = data.draw(goals(free))
    world = GridWorld(free, goal, 0.9, slip, directions)
    found = exact_values(world)
    twin = oracles.GridTwin(free, goal, directions, slip)
    policy = {
        tuple(cell): int(np.argmax(action_values(world, found.shifted, found.shift, s)))
        for s, cell in enumerate(world.cells.tolist())
    }
    worth = oracles.exact_policy_values(twin, 0.9, policy)
    np.testing.assert_allclose([worth[tuple(c)] for c in world.cells.tolist()], found.value, atol=1e-7)


def test_eight_directions_find_the_octile_shortest_path():
    rng = np.random.default_rng(5)
    free = rng.random((30, 30)) > 0.25
    free[0, 0] = free[29, 29] = True
    twin = oracles.GridTwin(free, (29, 29), 8)
    edges = [(twin.cells.index(a), twin.cells.index(b), d["length"]) for a, b, d in twin.graph().edges(data=True)]
    source, target, length = zip(*edges, strict=True)
    matrix = coo_matrix((length, (source, target)), shape=(len(twin.cells),) * 2)
    expected = dijkstra(matrix, indices=[twin.cells.index((0, 0))])[0][twin.cells.index((29, 29))]
    world = GridWorld(free, (29, 29), 0.99999, directions=8)
    found = exact_values(world)
    walk, arrived = greedy_walk(
        world, lambda s: action_values(world, found.shifted, found.shift, s), int(world.state_of[0, 0])
    )
    assert arrived
    moves = np.diff(world.cells[walk], axis=0)
    assert np.hypot(*moves.T).sum() == pytest.approx(expected, rel=1e-9)


def test_tables_from_outcome_lists_are_solved():
    # two states and an end; staying pays 1 for ever (value 1 / (1 - 0.5) = 2), leaving pays 3 at once
    outcomes = {
        0: {0: [(1.0, 0, 1.0, False)], 1: [(0.5, 1, 3.0, True), (0.5, 0, 3.0, False)]},
        1: {0: [(1.0, 1, 0.0, True)], 1: [(1.0, 1, 0.0, True)]},
    }
    table = TabularMDP.from_outcomes(outcomes, 0.5, ["stay", "leave"])
    found = exact_values(table)
    assert found.value == pytest.approx([4.0, 0.0])  # v = 3 + 0.5 * 0.5 * v
    assert table.cumulative == pytest.approx([1, 0.5, 1, 1, 1])


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"gamma": 1.0}, "gamma"),
        ({"gamma": math.nan}, "gamma"),
        ({"slip": 1.0}, "slip"),
        ({"directions": 6}, "directions"),
        ({"step_reward": 0.0}, "step"),
        ({"goal_reward": math.inf}, "goal"),
    ],
)
def test_grid_world_refuses_numbers_out_of_range(change, what):
    with pytest.raises(SettingError, match=what):
        GridWorld(**({"free": np.ones((2, 2), bool), "goal_cell": (0, 0), "gamma": 0.9} | change))


def test_grid_world_refuses_a_goal_in_a_wall_or_outside():
    free = np.array([[True, False]])
    for goal in ((0, 1), (5, 5), (-1, 0)):
        with pytest.raises(PlaceError, match="free cell"):
            GridWorld(free, goal, 0.9)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"probability": np.array([0.5, 1.0])}, "sum to 0.5"),
        ({"target": np.array([7, 0], np.uint32)}, "target is 7"),
        ({"row_start": np.array([0, 1, 1])}, "row_start"),
        ({"gamma": 1.5}, "gamma"),
        ({"state_names": ("only one",)}, "names"),
        ({"reward": np.array([np.inf, 0])}, "finite"),
    ],
)
def test_table_refuses_what_is_no_mdp(change, what):
    good = {
        "row_start": np.array([0, 1, 2]),
        "target": np.array([1, 1], np.uint32),
        "probability": np.array([1.0, 1.0]),
        "reward": np.array([1.0, 0.0]),
        "terminal": np.array([False, True]),
        "gamma": 0.9,
        "action_names": ("go",),
    }
    TabularMDP(**good)
    with pytest.raises(SettingError, match=what):
        TabularMDP(**(good | change))


@given(
    st.data(), free_masks(side=7, connected=False), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.2, 0.6]),
    st.sampled_from([0.5, 0.9, 0.99]), st.sampled_from([1e-9, 1e-3, 0.1, 3.0, 1e9]),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_no_value_is_off_by_more_than_the_error_asked_for(data, free, directions, slip, gamma, error):
    world = GridWorld(free, data.draw(goals(free)), gamma, slip, directions)
    whole = exact_values(world).value
    settled = 2e-12 * (100 + 1.5 / (1 - gamma)) / (1 - gamma)  # no error that is asked for is less than the default's
    assert np.abs(exact_values(world, error).value - whole).max() <= error + settled
    assert np.abs(exact_values(world.table(), error).value - whole).max() <= error + settled


@pytest.mark.parametrize("error", [0.0, -1.0, math.nan])
def test_an_error_that_is_none_is_refused(error):
    with pytest.raises(SettingError, match="must be above 0"):
        exact_values(GridWorld(np.ones((2, 2), bool), (0, 0), 0.9), error)


@pytest.mark.parametrize("gamma", [0.05, 0.06, 0.13, 0.27, 0.53, 0.64, 0.91])
def test_far_values_fade_as_they_should_where_the_shift_is_not_exact(gamma):
    world = GridWorld(np.ones((1, 120), bool), (0, 0), gamma)
    assert world.step_reward + shift_of(world) * (1 - gamma) != 0  # by rounding
    found = exact_values(world)
    steps = np.arange(1, 120)
    expected = gamma ** (steps - 1.0) * (world.goal_reward + found.shift)
    np.testing.assert_allclose(found.shifted[1:], expected, rtol=1e-10)
    np.testing.assert_allclose(exact_values(world.table()).shifted[1:], expected, rtol=1e-10)


def values_of_best_policy(world):
    """(S,) value + shift by elimination with 40 digits, for the best moves at the values found."""
    with mpmath.workdps(40):
        found, gamma, slip = exact_values(world), mpmath.mpf(world.gamma), mpmath.mpf(world.slip)
        here = [state for state in world.outward.tolist() if state != world.goal]
        if not here:
            return [], [], found
        number = {state: at for at, state in enumerate(here)}
        step, paid = mpmath.eye(len(here)), mpmath.zeros(len(here), 1)
        for state in here:
            best = int(np.argmax(action_values(world, found.shifted, found.shift, state)))
            for move in range(world.n_actions):
                chance = 1 - slip if move == best else slip / (world.n_actions - 1)
                there = int(world.successor[state, move])
                paid[number[state]] += chance * (world.goal_reward if there == world.goal else world.move_reward[move])
                if there != world.goal:
                    step[number[state], number[there]] -= gamma * chance
        solved = mpmath.lu_solve(step, paid)
        return here, [float(solved[at] + mpmath.mpf(found.shift)) for at in range(len(here))], found


@given(
    st.data(), free_masks(side=4), st.sampled_from([4, 8]), st.sampled_from([0.001, 0.1, 0.4]),
    st.sampled_from([0.3, 0.9, 0.9999, 0.999999, 1 - 1e-8]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_no_settled_value_is_off_by_more_than_is_said(data, free, directions, slip, gamma):
    world = GridWorld(free, data.draw(goals(free)), gamma, slip, directions)
    here, expected, found = values_of_best_policy(world)
    for state, value in zip(here, expected, strict=True):
        off = off_of(world, float(found.shifted[state]), found.shift)
        assert abs(found.shifted[state] - value) <= off


def corridor_values(cells, gamma, slip):
    """(cells - 1,) values of a corridor without the goal at its end, by elimination along it with 60 digits."""
    with mpmath.workdps(60):
        gamma, aside = mpmath.mpf(gamma), mpmath.mpf(slip) / 3
        onward, paid = [], []  # value at k = onward * value at k + 1 + paid
        for k in range(cells - 1):
            stays = gamma * aside * (2 if k else 3)
            back, before = (gamma * aside * onward[-1], gamma * aside * paid[-1]) if k else (0, 0)
            rest, ahead = 1 - stays - back, 1 - 3 * aside
            last = k == cells - 2
            onward.append(0 if last else gamma * ahead / rest)
            paid.append((before - 1 + (ahead * 101 if last else 0)) / rest)
        values = [paid[-1]]
        for k in range(cells - 3, -1, -1):
            values.append(onward[k] * values[-1] + paid[k])
        return values[::-1]


@pytest.mark.parametrize("gamma", [0.99, 0.9999999])
@pytest.mark.parametrize("slip", [0.3, 0.74])
@pytest.mark.parametrize("cells", [20, 1500])
def test_of_long_expected_ways_no_value_is_off_by_more_either(cells, slip, gamma):
    world = GridWorld(np.ones((1, cells), bool), (0, cells - 1), gamma, slip)
    found, expected = exact_values(world), corridor_values(cells, gamma, slip)
    off = off_of(world, found.shifted, found.shift)
    with mpmath.workdps(60):
        least = -world.step_reward / (1 - mpmath.mpf(gamma))  # the shift, not rounded
        for state, value in enumerate(expected):
            assert abs(mpmath.mpf(float(found.shifted[state])) - least - value) <= off[state] + 1e-14 * found.shift
    assert (off[:-1] <= 1e-5 * found.shifted[:-1]).all()  # faint values, too, are known well


def test_cells_that_no_way_leads_from_have_values_at_once():
    free = np.ones((2, 5), bool)
    free[:, 2] = False
    world = GridWorld(free, (0, 0), 1 - 1e-8, 0.1, 8)
    cut_off = np.flatnonzero(world.steps_to_goal < 0)
    chance = np.full(8, 0.1 / 7)
    chance[np.argmax(world.move_reward)] = 0.9
    number = np.searchsorted(cut_off, world.successor[cut_off])
    onward = sum(chance[a] * np.eye(len(cut_off))[number[:, a]] for a in range(8))
    paid = np.full(len(cut_off), chance @ world.move_reward)
    expected = np.linalg.solve(np.eye(len(cut_off)) - world.gamma * onward, paid)
    np.testing.assert_allclose(exact_values(world).value[cut_off], expected, rtol=1e-6)


def test_what_few_steps_lead_to_is_known_well_at_gammas_near_1():
    world = GridWorld(np.ones((4, 6), bool), (0, 0), 0.999999, 0.1)
    found = exact_values(world)
    least = float(found.shifted[world.outward[1:]].min())
    assert off_of(world, least, found.shift) < 1e-4  # a 1e-9th of it is 1e-3
