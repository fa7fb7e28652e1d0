"""Levels above the regions: wings and floors, their files, and the fold on any of them."""

import json
import subprocess
import sys

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import MapError, SettingError, UnknownNameError
from qualrl.io.graph_file import write_graph_json
from qualrl.io.model_file import fingerprint, read_arrays, read_model, write_arrays, write_model
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.levels import Grouping, wings_of
from qualrl.solving.fold import fold
from qualrl.solving.theorem1 import audit_theorem1
from tests import tracing
from tests.small_worlds import tables
from tests.worlds import TWO_ROOMS, free_masks, grid_of


@pytest.fixture(scope="module")
def building() -> HybridMDP:
    """Two corridors with four rooms each and a door between them, with all levels."""
    free = np.zeros((21, 109), np.bool_)
    for left in (1, 55):
        free[15:20, left : left + 53] = True
        for room in range(4):
            free[1:14, left + 13 * room : left + 13 * room + 12] = True
            free[14, left + 13 * room + 5 : left + 13 * room + 7] = True
    free[16:18, 54] = True
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.3))
    return qualrl.build(regions, "room C", start="room B", gamma=0.999, levels=4)


def assert_is_a_hierarchy(model):
    """Each level is a partition of the one below into connected parts, and its graph is what lies between them."""
    finer = model.levels[0]
    assert finer.names == model.region_names
    for level in model.levels[1:]:
        assert sorted(name for inside in level.members for name in inside) == sorted(finer.names)
        assert len(level.part_of) == len(model)
        for index, (name, inside) in enumerate(zip(level.names, level.members, strict=True)):
            states = np.isin(finer.part_of, [finer.names.index(part) for part in inside])
            np.testing.assert_array_equal(level.part_of == index, states)
            if model.regions is not None:
                assert nx.is_weakly_connected(finer.graph.subgraph(inside))
            assert level.graph.nodes[name]["parts"] == len(inside)
        of = {part: name for name, inside in zip(level.names, level.members, strict=True) for part in inside}
        between = [(of[a], of[b], key) for a, b, key in finer.graph.edges(keys=True) if of[a] != of[b]]
        assert sorted(level.graph.edges(keys=True)) == sorted(between)
        joints = {key for _, _, key in between}
        if model.regions is not None:
            assert set(level.landmarks.names) == joints | {"goal"}
        assert nx.is_frozen(level.graph)
        finer = level


def test_the_building_has_wings_and_one_floor(building):
    assert_is_a_hierarchy(building)
    regions, wings, floors = building.levels
    assert 1 < len(wings.names) < len(regions.names)
    assert wings.names[0] == "wing A"
    assert floors.names == ("floor A",)
    assert floors.graph.number_of_edges() == 0
    assert all(data["action"].startswith("go through door") for _, _, data in wings.graph.edges(data=True))
    corridor = next(inside for inside in wings.members if "corridor 1" in inside)
    assert len(corridor) > 2


def test_wings_are_the_same_in_another_process(building, tmp_path):
    write_graph_json(building.graph, tmp_path / "graph.json")
    code = (
        "from pathlib import Path; from qualrl.io.graph_file import read_graph_json; "
        "from qualrl.models.levels import groupings; print(groupings(read_graph_json(Path('graph.json')), 4))"
    )
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True,
            env=tracing.environment_without() | {"PYTHONHASHSEED": seed},
        )  # fmt: skip
        assert done.stdout.strip() == str(building.coarser)


@given(st.data(), free_masks(side=9, connected=False), st.sampled_from([2, 3, 4]))
@settings(max_examples=50, deadline=None)
def test_levels_of_random_maps_are_hierarchies_and_read_back(tmp_path_factory, data, free, levels):
    goal = data.draw(st.sampled_from(np.argwhere(free).tolist()))
    model = qualrl.build(qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.2)), goal, levels=levels)
    assert len(model.levels) == levels - 1
    assert_is_a_hierarchy(model)
    if levels == 4:
        assert model.levels[-1].graph.number_of_edges() == 0
    file = tmp_path_factory.mktemp("model") / "m.npz"
    write_model(model, file)
    again = read_model(file)
    assert again.coarser == model.coarser
    assert fingerprint(again) == fingerprint(model)


@pytest.mark.parametrize("levels", [0, 1, 5])
def test_other_numbers_of_levels_are_refused(levels):
    with pytest.raises(SettingError, match="levels must be 2"):
        qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B", levels=levels)


def test_a_wing_does_not_take_the_name_of_a_region():
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    model = qualrl.build(regions, "wing A", names={"room A": "wing A"}, levels=3)
    assert model.levels[1].names == ("wing B",)


def test_groups_of_ones_own_read_back_and_survive_another_goal(tmp_path):
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B", start="room A")
    grouped = model.grouped({"room A": "west", "room B": "east"})
    assert grouped.levels[1].names == ("west", "east")
    assert_is_a_hierarchy(grouped)
    assert fingerprint(grouped) != fingerprint(model)
    with pytest.raises(UnknownNameError, match="room C"):
        model.grouped({"room C": "west"})
    with pytest.raises(SettingError, match="given no group"):
        model.grouped({"room A": "west"})
    table = HybridMDP.from_table(model.grid.table(), [model.region_names[r] for r in model.region_of])
    both = table.grouped({"room A": "all", "room B": "all"})
    write_model(both, tmp_path / "m.npz")
    assert read_model(tmp_path / "m.npz").levels[1].members == (("room A", "room B"),)
    assert qualrl.plan(grouped, "room B", goal="room A").places == ("room B", "room A")


def test_groupings_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(SettingError, match="a name of its own"):
        Grouping(("a", "a"), (0, 1))
    with pytest.raises(SettingError, match="needs a part below"):
        Grouping(("a", "b"), (0, 0))
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B", levels=3)
    write_model(model, tmp_path / "m.npz")
    about, arrays = read_arrays(tmp_path / "m.npz", "qualrl-hybrid-mdp/1")
    for coarser in ([[["w"], [0]]], [[["w"], [0, 1]]], [["w"]], 3):
        write_arrays(tmp_path / "bad.npz", json.loads(json.dumps(about)) | {"coarser": coarser}, arrays)
        with pytest.raises(MapError, match="not a whole model file"):
            read_model(tmp_path / "bad.npz")


def test_files_without_levels_are_as_before(tmp_path):
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B")
    write_model(model, tmp_path / "m.npz")
    assert "coarser" not in read_arrays(tmp_path / "m.npz", "qualrl-hybrid-mdp/1")[0]


def test_wings_fold_as_regions_do(building):
    for number, level in enumerate(building.levels, 2):
        folded = fold(building, level)
        values = folded.solve()
        states = folded.ways.state[:-1]
        np.testing.assert_allclose(values.value[:-1], folded.exact.shifted[states], rtol=1e-9)
        audit = audit_theorem1(building, number)
        assert audit.kind == ("region", "wing", "floor")[number - 2]
        assert audit.refined.reaches_optimum
        assert audit.start_values[1] == pytest.approx(audit.start_values[0], rel=1e-12)
        assert audit.holds == (number == 4)


@given(tables(), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_any_grouping_of_a_table_folds_to_the_same_flat_chain(model, seed):
    rng = np.random.default_rng(seed)
    grouped = model.grouped({name: f"group {rng.integers(0, 2)}" for name in model.region_names})
    assert_is_a_hierarchy(grouped)
    assert audit_theorem1(grouped, 3).refined.holds


def buildings(*rooms):
    """A graph of buildings, each a corridor with so many rooms; a further corridor joins each to the next."""
    graph = nx.MultiDiGraph()
    for number, count in enumerate(rooms):
        for room in range(count):
            graph.add_edge(f"aisle {number}", f"room {number}.{room}", width_m=0.9)
        if number:
            graph.add_edge(f"aisle {number - 1}", f"bridge {number}", width_m=0.9)
            graph.add_edge(f"bridge {number}", f"aisle {number}", width_m=0.9)
    return graph


@given(st.lists(st.integers(4, 8), min_size=2, max_size=2))
def test_two_buildings_joined_by_a_corridor_are_two_wings(rooms):
    wings = wings_of(buildings(*rooms))
    assert list(wings) == ["wing A", "wing B"]
    of = {region: name for name, inside in wings.items() for region in inside}
    assert all(of[f"room {n}.{room}"] == of[f"aisle {n}"] for n, count in enumerate(rooms) for room in range(count))
    assert of["aisle 0"] != of["aisle 1"]


@settings(max_examples=60)
@given(st.integers(1, 20), st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=40))
def test_wings_are_connected_parts_of_three_regions_where_so_many_hang_together(count, edges):
    graph = nx.MultiDiGraph()
    graph.add_nodes_from(f"room {number}" for number in range(count))
    graph.add_edges_from((f"room {a % count}", f"room {b % count}") for a, b in edges if a % count != b % count)
    wings = wings_of(graph)
    assert sorted(region for inside in wings.values() for region in inside) == sorted(graph)
    plain = nx.Graph(graph)
    for inside in wings.values():
        assert nx.is_connected(plain.subgraph(inside))
        assert len(inside) >= min(3, len(nx.node_connected_component(plain, inside[0])))
    assert wings_of(graph.copy()) == wings
