"""Model, training, graph and label files: write then read gives the same; other files are refused with one line."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import MapError, OutputError, QualrlError
from qualrl.io.graph_file import read_graph_json, write_graph_json, write_graphml
from qualrl.io.label_image import read_label_image, write_label_image
from qualrl.io.model_file import read_model, write_model
from qualrl.io.training_file import read_run, write_run
from qualrl.models.hybrid_mdp import HybridMDP
from tests.worlds import TWO_ROOMS, free_masks, grid_of

NAMES = st.text(min_size=1, max_size=8).filter(lambda name: name.strip() and name.isprintable() and "," not in name)


def same_model(one: HybridMDP, other: HybridMDP) -> None:
    """Assert that two models are the same in everything."""
    assert one.region_names == other.region_names
    assert (one.start, one.gamma) == (other.start, other.gamma)
    np.testing.assert_array_equal(one.region_of, other.region_of)
    for name in ("names", "regions", "arcs"):
        assert getattr(one.landmarks, name) == getattr(other.landmarks, name)
    for name in ("landmark_of", "arc_start", "arc_target"):
        np.testing.assert_array_equal(getattr(one.landmarks, name), getattr(other.landmarks, name))
    assert list(one.graph.nodes(data=True)) == list(other.graph.nodes(data=True))
    assert list(one.graph.edges(keys=True, data=True)) == list(other.graph.edges(keys=True, data=True))
    table, again = (m.world if isinstance(m.world, qualrl.TabularMDP) else m.world.table() for m in (one, other))
    for name in ("row_start", "target", "probability", "reward", "terminal"):
        np.testing.assert_array_equal(getattr(table, name), getattr(again, name))
    assert table.action_names == again.action_names


@given(st.data(), free_masks(side=9, connected=False), st.sampled_from([4, 8]), st.floats(0, 0.9), st.floats(0, 0.99))
@settings(max_examples=40, deadline=None)
def test_a_written_model_reads_back_the_same(tmp_path_factory, data, free, directions, slip, gamma):
    cells = list(np.argwhere(free).tolist())
    goal, start = data.draw(st.sampled_from(cells)), data.draw(st.sampled_from([None, *cells]))
    grid = qualrl.OccupancyGrid(free, ~free & (np.indices(free.shape).sum(0) % 2 == 0), 0.25, (1.5, -2.0, 0.3))
    regions = qualrl.segment(grid)
    new = data.draw(st.lists(NAMES, unique=True, min_size=1, max_size=1))
    names = {regions.regions[0].name: new[0]} if new[0] not in regions.all_names else {}
    model = qualrl.build(regions, goal, start=start, gamma=gamma, slip=slip, directions=directions, names=names)
    file = tmp_path_factory.mktemp("model") / "model.npz"
    write_model(model, file)
    again = read_model(file)
    same_model(model, again)
    assert again.regions is not None
    np.testing.assert_array_equal(again.regions.label, model.regions.label)
    np.testing.assert_array_equal(again.regions.grid.occupied, grid.occupied)
    assert again.regions.grid.origin == grid.origin
    assert again.regions.regions == model.regions.regions


def test_a_model_without_a_map_reads_back_the_same(tmp_path):
    table = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B", slip=0.1).grid.table()
    model = HybridMDP.from_table(table, ["even" if s % 2 == 0 else "odd" for s in range(len(table))], start=2)
    write_model(model, tmp_path / "m.npz")
    same_model(model, read_model(tmp_path / "m.npz"))


def test_a_written_run_reads_back_the_same_and_knows_its_model(tmp_path):
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    model = qualrl.build(regions, "room B", start="room A")
    for algorithm, alpha in (("hql", 0.5), ("hql", "1/(1+k)"), ("hql-replay", 0.5)):
        run = qualrl.train(model, algorithm, episodes=40, alpha=alpha)
        write_run(run, tmp_path / "t.npz")
        again = read_run(tmp_path / "t.npz", model)
        for name in ("q", "steps", "returns", "arc_q", "arc_visits", "shifted_q", "visits"):
            np.testing.assert_array_equal(getattr(run, name), getattr(again, name))
    assert (run.settings, run.algorithm, run.seed) == (again.settings, again.algorithm, again.seed)
    other = qualrl.build(regions, "room B", directions=8)
    with pytest.raises(MapError, match="another model"):
        read_run(tmp_path / "t.npz", other)


def test_a_model_file_is_the_same_bytes_each_time(tmp_path):
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B")
    for name in ("a.npz", "b.npz"):
        write_model(model, tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@given(st.binary(max_size=300))
@settings(max_examples=50, deadline=None)
def test_other_files_are_refused_with_one_line(tmp_path_factory, content):
    file = tmp_path_factory.mktemp("junk") / "x"
    file.write_bytes(content)
    for read in (read_model, read_graph_json):
        with pytest.raises(QualrlError, match="not a"):
            read(file)


def test_files_of_another_format_or_cut_short_are_refused(tmp_path):
    np.savez(tmp_path / "plain.npz", a=np.zeros(3))
    np.savez(tmp_path / "other.npz", about=np.array(json.dumps({"format": "qualrl-hybrid-mdp/99"})))
    np.savez(tmp_path / "empty.npz", about=np.array(json.dumps({"format": "qualrl-hybrid-mdp/1", "map": {}})))
    np.savez(tmp_path / "pickle.npz", about=np.array([object()]))
    for name, what in (
        ("plain", "about"),
        ("other", "this version reads"),
        ("empty", "not a whole"),
        ("pickle", "Object arrays"),
    ):
        with pytest.raises(MapError, match=what):
            read_model(tmp_path / f"{name}.npz")
    (tmp_path / "g.json").write_text('{"graph": {"schema": "other/1"}, "nodes": [], "edges": []}')
    with pytest.raises(MapError, match="schema"):
        read_graph_json(tmp_path / "g.json")


def test_graphs_read_back_the_same(tmp_path):
    graph = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B").graph
    write_graph_json(graph, tmp_path / "g.json")
    write_graphml(graph, tmp_path / "g.graphml")
    again = read_graph_json(tmp_path / "g.json")
    assert list(again.edges(keys=True, data=True)) == list(graph.edges(keys=True, data=True))
    assert dict(again.nodes(data=True)) == dict(graph.nodes(data=True))


def test_label_images_hold_16_bits(tmp_path):
    label = np.arange(-1, 65534, dtype=np.int32).reshape(-1, 15)
    write_label_image(label, tmp_path / "l.png")
    np.testing.assert_array_equal(read_label_image(tmp_path / "l.png"), label)
    with pytest.raises(OutputError, match="16 bits"):
        write_label_image(label + 2, tmp_path / "m.png")
