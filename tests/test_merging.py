"""Zones are merged as the textbook does it, one set of zones at a time; and what holds of any merging."""

import math
from collections import Counter, defaultdict

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qualrl.kernels import merging as kernels
from qualrl.kernels import zone_graph
from qualrl.kernels.bonds import linked
from qualrl.kernels.trees import Trees, odds_of, questions_of
from qualrl.spatial.merging import apart, unpacked
from qualrl.training.merging import packed
from tests import oracles_merging
from tests.oracles_merging import Contact, Merging, Place, Zone

FEATURES = len(kernels.FEATURES)
CELL_M = 0.25
"""A power of two: sums of lengths come out the same in any order."""
ABOUT = (0.3, -1.2, 0.7)
ROOM = 400
SEEDS = st.integers(0, 2**32 - 1)
ZONES = arrays(np.int32, st.tuples(st.integers(2, 7), st.integers(2, 7)), elements=st.integers(-1, 7))


def numbered(image):
    """The labels of an image as 0, 1 ... without holes."""
    used = sorted({*image.ravel().tolist()} - {-1})
    return np.vectorize(lambda label: used.index(label) if label >= 0 else -1, otypes=[np.int32])(image)


def beside(image):
    """Each step between two cells as (label, label, is along a row)."""
    for row, column in np.ndindex(image.shape):
        for r, c in ((row, column + 1), (row + 1, column)):
            if r < image.shape[0] and c < image.shape[1]:
                yield int(image[row, column]), int(image[r, c]), r == row


def graph_of(image, draw):
    """(zones, contacts) of a label image; what it does not show is drawn, in eighths, from a generator."""
    count = int(image.max()) + 1
    cells = Counter(image.ravel().tolist())
    touching, border = Counter(), Counter()
    between = defaultdict(lambda: [0.0] * 8)
    for one, other, is_row in beside(image):
        if one != other and min(one, other) >= 0:
            touching.update((one, other))
            between[min(one, other), max(one, other)][0 if is_row else 1] += CELL_M
        elif one != other:
            border[max(one, other)] += 1
    pairs = [(one, other) for other in range(count) for one in range(other)]
    for pair in pairs:
        if draw.random() < 0.2:
            between[pair][5 + draw.integers(2)] += eighths(draw)
    for known in between.values():
        sides = known[0] + known[1]
        if sides:
            known[2] = sides * draw.integers(3) / 2
            known[3], known[4] = known[2] * eighths(draw), known[2] * eighths(draw)
            known[7] = eighths(draw)
    contacts = [Contact(*pair, *known) for pair, known in between.items()]
    draw.shuffle(contacts)
    far = oracles_merging.reaches(image.tolist(), count, oracles_merging.directions())
    zones = []
    for label in range(count):
        area, seen = cells[label] * CELL_M**2, border[label] * CELL_M
        unknown = seen * draw.integers(3) / 2
        reach = tuple(reach * CELL_M for reach in far[label])
        zones.append(
            Zone(area, area * eighths(draw), seen - unknown, unknown, touching[label] * CELL_M, eighths(draw), reach)
        )
    return zones, [Contact(*map(int, contact[:2]), *map(float, contact[2:])) for contact in contacts]


def eighths(draw):
    return float(draw.integers(1, 17)) / 8


def arrays_of(zones, contacts):
    """The same as the loops take it."""
    sums = np.array([zone[:5] for zone in zones])
    peak, reach = np.array([zone.peak for zone in zones]), np.array([zone.reach for zone in zones])
    places = kernels.Places(np.arange(len(zones), dtype=np.int32), sums, peak, reach)
    pair = np.array([contact[:2] for contact in contacts], np.int32).reshape(-1, 2)
    known = np.array([contact[2:] for contact in contacts]).reshape(-1, 8)
    return places, linked(pair, known, len(zones))


def tree_of(draw, rows, depth):
    """A nested tree that splits between rows of features, never right at one; few values of leaves, so odds tie."""
    if depth == 0 or draw.random() < 0.1:
        return float(draw.integers(-4, 5)) / 4
    feature = int(draw.integers(FEATURES))
    one, other = rows[draw.integers(len(rows), size=2), feature].tolist()
    threshold = float(np.float32(one + (other - one) * draw.random() + 0.01 * draw.normal()))
    return feature, threshold, tree_of(draw, rows, depth - 1), tree_of(draw, rows, depth - 1)


def flat(trees, start):
    """Nested trees as the loops take them; a node comes after what hangs on it."""
    nodes, root = [], []

    def put(tree):
        if isinstance(tree, tuple):
            feature, threshold, low, high = tree
            left, right = put(low), put(high)
            nodes.append((feature, threshold, left, right, 0.0))
        else:
            nodes.append((-1, 0.0, 0, 0, tree))
        return len(nodes) - 1

    root = [put(tree) for tree in trees]
    feature, threshold, left, right, leaf = zip(*nodes, strict=True)
    whole = (np.array(part, np.int32) for part in (root, feature, left, right))
    root, feature, left, right = whole
    parts = np.array(threshold, np.float32), left, right, np.array(leaf, np.float32)
    return questions_of(Trees(root, feature, *parts, start))


def some_trees(zones, contacts, draw):
    """Nested trees and their start, with thresholds among what the pairs of zones show."""
    twin = Merging(zones, contacts, [], 0.0, ABOUT, range(len(zones)), ROOM)
    twin.run(math.inf, 0.0)
    rows = np.array([row[:FEATURES] for row in twin.samples] or [[0.0] * FEATURES])
    return [tree_of(draw, rows, 4) for _ in range(draw.integers(1, 6))], float(draw.normal() / 4)


def walked(zones, contacts, trees, least_odds, min_area, truth=None, room=ROOM):
    """(host of each zone, samples) by the compiled loops."""
    return walk(zones, contacts, trees, least_odds, min_area, truth, room)[1:]


def walk(zones, contacts, trees, least_odds, min_area, truth, room=ROOM, parts=()):
    """(places, host of each zone, samples); all zones at once, or part by part."""
    places, bonds = arrays_of(zones, contacts)
    known = np.array([] if truth is None else truth, np.int32)
    samples = kernels.Samples(known, np.zeros((room, FEATURES + 2)), np.zeros(1, np.int64))
    for part in parts or [range(len(zones))]:
        chosen = np.array(part, np.int64)
        kernels.merge(places, bonds, chosen, trees, np.array(ABOUT), least_odds, min_area, samples)
    return places, places.parent.tolist(), samples.found[: samples.size[0]]


def compare(zones, contacts, draw, least_odds, min_area):
    """Without truth, and with one that some zones lack: the same places, the same samples."""
    nested, start = some_trees(zones, contacts, draw)
    trees = flat(nested, start)
    truths = (None, draw.integers(-1, 4, len(zones)).tolist())
    for truth in truths:
        twin = Merging(zones, contacts, nested, start, ABOUT, truth, ROOM)
        hosts = twin.run(least_odds, min_area)
        places, found, samples = walk(zones, contacts, trees, least_odds, min_area, truth)
        assert found == hosts
        for host, members in twin.members.items():
            known = Place(members, zones, contacts)
            sums = [known.area, known.breadth * known.area, known.walls, known.unknown, known.touching]
            np.testing.assert_allclose(places.sums[host], sums, rtol=1e-12, atol=1e-12)
            assert places.peak[host] == known.peak
            assert places.reach[host].tolist() == known.reach
        assert len(samples) == len(twin.samples)
        if len(samples):
            np.testing.assert_allclose(samples, np.array(twin.samples, np.float64), rtol=1e-9, atol=1e-9)


def pieces(zones, contacts):
    """The sets of zones that contacts join, in pieces that touch."""
    graph = nx.Graph()
    graph.add_nodes_from(range(len(zones)))
    graph.add_edges_from(contact[:2] for contact in contacts if contact.along + contact.across > 0)
    return graph


@settings(deadline=None, max_examples=80)
@given(ZONES.map(numbered).filter(lambda image: image.max() >= 0), SEEDS, st.sampled_from([-9, 0, 0.5, 9]),
       st.sampled_from([0.0, 0.2, 1.0, 9.0]))  # fmt: skip
def test_merging_is_the_textbook_one(image, seed, least_odds, min_area):
    draw = np.random.default_rng(seed)
    compare(*graph_of(image, draw), draw, least_odds, min_area)


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 12), st.integers(1, 40), SEEDS)
def test_contacts_of_any_graph_add_up(count, contacts, seed):
    """Contacts told in several parts, as no image has them: sums, the widest way and the order stay the same."""
    draw = np.random.default_rng(seed)
    zones, _ = graph_of(np.repeat(np.arange(count, dtype=np.int32), 3)[None], draw)
    ends = [draw.choice(count, 2, replace=False).tolist() for _ in range(contacts)]
    known = draw.integers(0, 9, (contacts, 8)) / 8 + 1 / 8
    known[:, :2] *= draw.random((contacts, 1)) < 0.8
    compare(zones, [Contact(*pair, *row) for pair, row in zip(ends, known.tolist(), strict=True)], draw, -9, 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_place_with_many_neighbours_asks_them_all_again(seed):
    """The queue holds more pairs than there are contacts: it has to grow."""
    draw = np.random.default_rng(seed)
    image = np.full((2, 45), 45, np.int32)
    image[0] = np.arange(45)
    zones, contacts = graph_of(image, draw)
    compare(zones, [contact for contact in contacts if contact.other == 45], draw, -9, 0.0)


def test_the_trees_know_the_features_by_their_place():
    zones, contacts = graph_of(np.array([[0, 1]], np.int32), np.random.default_rng(0))
    twin = Merging(zones, contacts, [], 0.0, ABOUT)
    named, _ = twin.features(0, 1, twin.between(0, 1))
    assert tuple(named) == kernels.FEATURES


def test_a_rectangle_is_convex_and_an_l_is_not():
    image = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, -1, -1]], np.int32)
    zones, contacts = graph_of(image, np.random.default_rng(0))
    _, ((*row, _, _),) = walked(zones, contacts, flat([0.0], 0.0), 0.0, 0.0, [0, 0])
    named = dict(zip(kernels.FEATURES, row, strict=True))
    assert [named[name] for name in ("smaller fill", "larger fill", "fill")] == pytest.approx([1, 1, 10 / 12])
    assert named["larger convexity"] == pytest.approx(1)
    assert named["convexity"] == pytest.approx(10 / 11.5)  # a diagonal of 45 degrees cuts a corner of 1 off


GRAPHS = st.tuples(ZONES.map(numbered).filter(lambda image: image.max() >= 0), SEEDS)


def graph_and_trees(drawn):
    image, seed = drawn
    draw = np.random.default_rng(seed)
    zones, contacts = graph_of(image, draw)
    return zones, contacts, flat(*some_trees(zones, contacts, draw))


@settings(deadline=None, max_examples=100)
@given(GRAPHS, st.floats(-2, 2), st.sampled_from([0.0, 0.3, 2.0]))
def test_places_are_whole_zones_that_touch(drawn, least_odds, min_area):
    zones, contacts, trees = graph_and_trees(drawn)
    hosts, _ = walked(zones, contacts, trees, least_odds, min_area)
    graph = pieces(zones, contacts)
    for host in set(hosts):
        members = [zone for zone, at in enumerate(hosts) if at == host]
        assert host in members
        assert nx.is_connected(graph.subgraph(members))
        if sum(zones[zone].area for zone in members) < min_area:
            assert set(members) == nx.node_connected_component(graph, host), "it touches something"


@settings(deadline=None, max_examples=60)
@given(GRAPHS, st.sampled_from([-9, 0, 0.5]), st.sampled_from([0.0, 0.3, 2.0]), st.randoms())
def test_what_no_contacts_join_can_be_merged_apart_and_in_any_order(drawn, least_odds, min_area, random):
    zones, contacts, trees = graph_and_trees(drawn)
    _, bonds = arrays_of(zones, contacts)
    parts = [part.tolist() for part in apart(bonds)]
    linked = [{contact.one, contact.other} for contact in contacts]
    assert sorted([*parts[0], *parts[1]]) == list(range(len(zones)))
    assert all(ends <= {*parts[0]} or ends <= {*parts[1]} for ends in linked)
    random.shuffle(parts)
    _, at_once, _ = walk(zones, contacts, trees, least_odds, min_area, None)
    _, in_parts, _ = walk(zones, contacts, trees, least_odds, min_area, None, parts=parts)
    assert in_parts == at_once


@settings(deadline=None, max_examples=60)
@given(GRAPHS)
def test_no_odds_merge_nothing_and_any_odds_merge_all_that_touches(drawn):
    zones, contacts, trees = graph_and_trees(drawn)
    alone, _ = walked(zones, contacts, trees, math.inf, 0.0)
    assert alone == list(range(len(zones)))
    graph = pieces(zones, contacts)
    whole, _ = walked(zones, contacts, trees, -math.inf, 0.0)
    sets = {frozenset(np.flatnonzero(np.array(whole) == host).tolist()) for host in whole}
    assert sets == {*map(frozenset, nx.connected_components(graph))}


@settings(deadline=None, max_examples=60)
@given(GRAPHS, st.sampled_from([0.1, 0.3, 1.0]))
def test_without_odds_only_small_zones_are_merged(drawn, min_area):
    zones, contacts, trees = graph_and_trees(drawn)
    hosts, _ = walked(zones, contacts, trees, math.inf, min_area)
    large = [zone for zone, known in enumerate(zones) if known.area >= min_area]
    assert [hosts[zone] for zone in large] == large


@settings(deadline=None, max_examples=60)
@given(GRAPHS, SEEDS)
def test_known_truths_are_never_merged_and_every_sample_tells_it(drawn, seed):
    zones, contacts, trees = graph_and_trees(drawn)
    truth = np.random.default_rng(seed).integers(-1, 3, len(zones))
    hosts, samples = walked(zones, contacts, trees, -math.inf, 0.0, truth)
    for host in set(hosts):
        assert len({*truth[np.array(hosts) == host].tolist()} - {-1}) <= 1
    assert {*np.unique(samples[:, FEATURES]).tolist()} <= {0, 1}
    kept = walked(zones, contacts, trees, -math.inf, 0.0, truth, room=2)[1]
    np.testing.assert_array_equal(kept, samples[:2])


@settings(deadline=None, max_examples=100)
@given(ZONES.map(numbered).filter(lambda image: image.max() >= 0), st.floats(-1, 1), st.sampled_from([4, 8, 32]))
def test_reaches_are_those_of_all_corners(image, turn, count):
    towards = oracles_merging.directions(count, turn)
    found = zone_graph.reaches(image, int(image.max()) + 1, np.array(towards))
    slow = oracles_merging.reaches(image.tolist(), int(image.max()) + 1, towards)
    np.testing.assert_allclose(found, slow, rtol=1e-12, atol=1e-12)


@settings(deadline=None, max_examples=100)
@given(ZONES)
def test_a_step_has_the_highest_line_around_its_two_cells(line):
    width = line.shape[1]
    along = [(cell, cell + 1) for cell in range(line.size) if (cell + 1) % width]
    steps = along + [(cell, cell + width) for cell in range(line.size - width)]
    found = zone_graph.line_at_steps(np.array(steps, np.int32), line)
    both = [[divmod(cell, width) for cell in step] for step in steps]
    assert found.tolist() == [oracles_merging.line_around(cells, line.tolist()) for cells in both]


@settings(deadline=None, max_examples=100)
@given(SEEDS, st.integers(0, 6))
def test_odds_are_the_sum_of_the_trees_leaves(seed, depth):
    draw = np.random.default_rng(seed)
    rows = draw.normal(size=(20, FEATURES))
    nested, start = [tree_of(draw, rows, depth) for _ in range(3)], float(draw.normal())
    trees = flat(nested, start)
    slow = [oracles_merging.odds(nested, start, row) for row in rows.tolist()]
    assert odds_of(trees, rows).tolist() == slow


def test_a_value_at_the_threshold_goes_left():
    rows = np.array([[0.5, 0.0], [0.5000001, 0.0], [0.4999999, 9.0]])
    assert odds_of(flat([(0, 0.5, 1.0, 2.0)], 0.25), rows).tolist() == [1.25, 2.25, 1.25]


def test_packed_trees_decide_as_where_they_come_from():
    ensemble = pytest.importorskip("sklearn.ensemble")
    draw = np.random.default_rng(0)
    rows = draw.normal(size=(600, 5)).astype(np.float32)
    model = ensemble.HistGradientBoostingClassifier(max_iter=12, max_leaf_nodes=7, early_stopping=False, random_state=0)
    model.fit(rows, rows[:, 0] * rows[:, 1] + rows[:, 2] > 0.3)
    nodes = [tree[0].nodes for tree in model._predictors]
    trees = unpacked(packed(nodes, float(model._baseline_prediction[0, 0])))
    assert len(trees.root) == 12
    fresh = draw.normal(size=(300, 5))
    decided = model.decision_function(fresh)
    assert np.ptp(decided) > 1
    np.testing.assert_allclose(odds_of(questions_of(trees), fresh), decided, rtol=1e-4, atol=1e-5)


def test_a_tree_of_more_leaves_than_a_word_has_bits_is_refused():
    tree = 0.0
    for at in range(64):
        tree = (0, float(at), 1.0, tree)
    with pytest.raises(ValueError, match="65 leaves"):
        flat([tree], 0.0)


def test_without_trees_the_odds_are_what_they_start_from():
    assert odds_of(questions_of(unpacked(packed([], 0.25))), np.zeros((2, FEATURES))).tolist() == [0.25, 0.25]
