"""What trees are trained on is true of the plans, and what is trained reads as it was stored."""

from collections import Counter
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.kernels import merging as kernels
from qualrl.kernels.trees import odds_of, questions_of
from qualrl.spatial import merging
from qualrl.spatial.floor_plans import FloorPlan, random_floor_plan
from qualrl.spatial.merging import unpacked, zone_graph_of
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.view import look
from qualrl.training.merging import FURNITURE_M, LEAST_ODDS, averaged, packed, samples_of, train, trained, varied
from tests.oracles_merging import Contact, Merging, Zone

FEATURES = len(kernels.FEATURES)
NONE = packed([], 0.0)


@pytest.fixture
def one_thread():
    """Fits this small are done sooner by one thread than threads wait for each other on a busy machine."""
    pytest.importorskip("sklearn")
    with pytest.importorskip("threadpoolctl").threadpool_limits(1):
        yield


def zones_and_contacts(graph):
    """A graph of zones as plain records."""
    sums, peak, reach = graph.places.sums.tolist(), graph.places.peak.tolist(), graph.places.reach.tolist()
    zones = [Zone(*known, far, tuple(all_far)) for known, far, all_far in zip(sums, peak, reach, strict=True)]
    target, known = graph.bonds.target.tolist(), graph.bonds.sums.tolist()
    ends = zip(target[1::2], target[::2], known[::2], strict=True)
    return zones, [Contact(one, other, *lengths) for one, other, lengths in ends]


def places_of_zones(zone, view, place):
    """By zone: the place that has most of its cells, one at a time; cells of none count half, and win a draw."""
    shares = {}
    transposed, upside_down, mirrored = view.posture
    height, width = zone.shape
    for row, column in np.argwhere(zone >= 0).tolist():
        r = (height - 1 - row if upside_down else row) - 1
        c = (width - 1 - column if mirrored else column) - 1
        r, c = (c, r) if transposed else (r, c)
        here = int(place[view.window[0].start + r // view.zoom, view.window[1].start + c // view.zoom])
        shares.setdefault(int(zone[row, column]), Counter())[here] += 1 if here < 0 else 2
    return [min(shares[number].items(), key=lambda share: (-share[1], share[0]))[0] for number in range(len(shares))]


@pytest.mark.parametrize("crowded", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 5, 9])
def test_samples_are_pairs_met_on_the_way_to_the_truth(seed, crowded):
    """Without trees all pairs are equally likely: the twin meets them in the same order, one set of zones at a time."""
    plan = random_floor_plan(seed, crowded=crowded)
    grid, place = varied(plan, np.random.default_rng([seed, 1]))
    view = look(grid.free, grid.resolution_m, FURNITURE_M)
    graph, _ = zone_graph_of(view, grid.occupied, lambda: None)
    truth = places_of_zones(graph.zone, view, place)
    twin = Merging(*zones_and_contacts(graph), [], 0.0, graph.about.tolist(), truth, 10**6)
    hosts = twin.run(LEAST_ODDS, 0.0)
    found = samples_of(seed, NONE, crowded)
    assert {*found[:, FEATURES].tolist()} == {0, 1}
    np.testing.assert_allclose(found, np.array(twin.samples, np.float32), rtol=1e-5, atol=1e-5)
    for host in set(hosts):
        known = {truth[zone] for zone, at in enumerate(hosts) if at == host} - {-1}
        assert len(known) <= 1


def checked_plan(rng):
    """A plan whose cells are places by chance, a third of them walls."""
    place = rng.integers(-1, 5, (40, 60)).astype(np.int32)
    free = place >= 0
    return FloorPlan(OccupancyGrid(free, ~free & (rng.random(free.shape) < 0.5), 0.05), place, (), (), "drawn", 0.0)


def test_place_and_map_vary_alike():
    kinds = Counter()
    for seed in range(300):
        plan = checked_plan(np.random.default_rng(seed))
        grid, place = varied(plan, np.random.default_rng([seed, 2]))
        scale = round(grid.resolution_m / plan.grid.resolution_m)
        at = np.ix_(*(np.arange(size) * scale for size in grid.free.shape))
        assert grid.free.shape == place.shape == tuple(-(-size // scale) for size in plan.place.shape)
        np.testing.assert_array_equal(place, plan.place[at])
        assert not (grid.free & grid.occupied).any()
        changed = (grid.free != plan.grid.free[at]).mean()
        assert changed < 0.03
        if not changed:
            np.testing.assert_array_equal(grid.occupied, plan.grid.occupied[at])
        kinds[scale, bool(changed)] += 1
    assert {scale for scale, _ in kinds} == {1, 2}
    assert {noisy for _, noisy in kinds} == {False, True}
    assert kinds[1, False] > 100, "most plans stay as they are"


def separation(odds, is_one):
    """How often a pair that is one place has better odds than one that is not: 0.5 by chance."""
    higher = np.subtract.outer(odds[is_one], odds[~is_one])
    return (higher > 0).mean() + (higher == 0).mean() / 2


def separates(stored):
    """The same on plans that nothing was trained on."""
    met = np.concatenate([samples_of(seed, NONE, False) for seed in range(30, 42)])
    return separation(odds_of(questions_of(unpacked(stored)), met[:, :FEATURES].astype(float)), met[:, FEATURES] > 0)


def check_trees(trees):
    """Each tree is one: every node is met once from its root, and splits by a feature that there is."""
    met = []
    for root in trees.root.tolist():
        left = [root]
        while left:
            node = left.pop()
            met.append(node)
            if trees.feature[node] >= 0:
                left += [int(trees.left[node]), int(trees.right[node])]
    assert sorted(met) == list(range(len(trees.feature)))
    assert trees.feature.max() < FEATURES
    assert np.isfinite(trees.threshold).all()
    assert np.isfinite(trees.leaf).all()
    assert np.isfinite(trees.start)


@pytest.mark.usefixtures("one_thread")
def test_a_few_plans_teach_more_than_chance():
    parts = [trained(np.concatenate([samples_of(seed, NONE, crowded) for seed in range(10, 14)]), 12)
             for crowded in (False, True)]  # fmt: skip
    for stored in parts:
        check_trees(unpacked(stored))
        assert separates(stored) > 0.75
    both = averaged(parts)
    check_trees(unpacked(both))
    rows = np.random.default_rng(0).normal(size=(50, FEATURES))
    one, other, mean = (odds_of(questions_of(unpacked(stored)), rows) for stored in (*parts, both))
    assert np.ptp(one - other) > 0.1
    np.testing.assert_allclose(mean, (one + other) / 2, rtol=1e-5, atol=1e-6)


@pytest.mark.usefixtures("one_thread")
def test_the_whole_training_runs_and_is_stored_without_pickle(tmp_path, monkeypatch):
    monkeypatch.setattr("qualrl.training.merging.BAGS", 1)
    np.savez_compressed(tmp_path / "small.npz", allow_pickle=False, **train(12, 8, 1))
    with np.load(tmp_path / "small.npz", allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    check_trees(unpacked(arrays))
    assert separates(arrays) > 0.7


@pytest.mark.usefixtures("one_thread")
def test_one_plan_of_each_kind_is_enough_to_train(monkeypatch):
    monkeypatch.setattr("qualrl.training.merging.BAGS", 1)
    check_trees(unpacked(train(1, 2, 1)))


def test_the_trees_that_come_along_are_whole_and_know_rooms():
    path = files("qualrl.spatial").joinpath("merging.npz")
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    for name in ("root", "left", "right"):
        assert arrays[name].min() >= 0
        assert arrays[name].max() < len(arrays["feature"])
    check_trees(unpacked(arrays))
    for kept, read in zip(merging.questions(), questions_of(unpacked(arrays)), strict=True):
        np.testing.assert_array_equal(kept, read)
    assert separates(arrays) > 0.9


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=4), st.floats(-1, 1))
def test_averaging_stumps_averages_their_leaves(leaves, start):
    nodes = [("is_leaf", "?"), ("feature_idx", "i4"), ("left", "u4"), ("right", "u4"), ("num_threshold", "f8"),
             ("value", "f8")]  # fmt: skip
    parts = []
    for low, high in leaves:
        stump = [(False, 2, 1, 2, 0.0, 9.0), (True, 0, 0, 0, 0.0, low), (True, 0, 0, 0, 0.0, high)]
        parts.append(packed([np.array(stump, nodes)] * 2, start))
    rows = np.zeros((2, FEATURES))
    rows[:, 2] = -1, 1
    expected = start + 2 * np.array(leaves).mean(axis=0)
    np.testing.assert_allclose(odds_of(questions_of(unpacked(averaged(parts))), rows), expected, rtol=1e-5, atol=1e-5)
