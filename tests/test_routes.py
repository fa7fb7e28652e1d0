"""Ways between places of a map, against networkx, breadth-first distances, and their own cells."""

from itertools import pairwise

import cv2
import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.errors import NoPlanError, PlaceError, UnknownNameError
from qualrl.kernels import routing
from qualrl.models.grid_world import GridWorld
from qualrl.planning.gates import apart, gates_of, straight
from qualrl.planning.routes import Routes
from qualrl.spatial.doorways import find_doorways
from qualrl.spatial.floor_plans import random_floor_plan
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.region_map import Region, RegionMap
from tests.worlds import PUZZLE, free_masks, grid_of


@pytest.fixture(scope="module")
def office() -> Routes:
    return Routes(qualrl.segment(qualrl.read_map("maps/office.yaml")))


def check(routes: Routes, route, start, goal) -> None:
    """Step by step over free cells, through the doorways and regions that it names."""
    path, regions = route.path, routes.regions
    assert (tuple(path[0]), tuple(path[-1])) == (tuple(start), tuple(goal))
    assert (np.abs(np.diff(path, axis=0)).sum(axis=1) == 1).all()
    assert regions.grid.free[path[:, 0], path[:, 1]].all()
    names = [regions.region_names[label] for label in regions.label[path[:, 0], path[:, 1]]]
    assert list(route.regions) == [name for at, name in enumerate(names) if at == 0 or names[at - 1] != name]
    pairs = {door.name: {regions.region_names[region] for region in door.pair} for door in regions.doorways}
    assert [pairs[door] for door in route.doors] == [set(pair) for pair in pairwise(route.regions)]
    assert route.steps == len(path) - 1
    assert route.length_m == pytest.approx(route.steps * regions.grid.resolution_m)


def shortest(routes: Routes, goal) -> np.ndarray:
    """(H, W) steps to a cell, by the solver's breadth-first search."""
    world = GridWorld(routes.regions.grid.free, tuple(goal), 0.9)
    found = np.full(world.free.shape, -1)
    found[world.free] = world.steps_to_goal
    return found


@pytest.mark.no_cover
@pytest.mark.parametrize(("walked", "vast"), [(0, 0), (20_000_000, 2000)])
@pytest.mark.parametrize("style", ["drawn", "furnished", "scanned"])
def test_ways_on_floor_plans_are_walks_and_hardly_longer(style, walked, vast, monkeypatch):
    monkeypatch.setattr("qualrl.planning.routes.WALKED", walked)
    monkeypatch.setattr("qualrl.planning.routes.VAST", vast)
    regions = qualrl.segment(random_floor_plan(3, style=style).grid)
    routes, cells = Routes(regions), np.argwhere(regions.grid.free)
    generator = np.random.default_rng(0)
    for goal in generator.choice(cells, 5):
        away = shortest(routes, goal)
        for start in generator.choice(cells[away[cells[:, 0], cells[:, 1]] >= 0], 10):
            route = routes.between(tuple(start.tolist()), tuple(goal.tolist()))
            check(routes, route, start, goal)
            exact = routes.between(tuple(start.tolist()), tuple(goal.tolist()), exact=True)
            check(routes, exact, start, goal)
            assert exact.steps == away[tuple(start)] <= route.steps
            assert route.steps <= 1.03 * exact.steps


@st.composite
def partitions(draw) -> RegionMap:
    """Cells and blocks dealt out to regions at random: wide and bent doorways, slits, several between the same two."""
    side, generator = draw(st.integers(2, 14)), np.random.default_rng(draw(st.integers(0, 2**32)))
    block = draw(st.sampled_from([1, 2, 4, 6]))
    owner = generator.integers(0, draw(st.integers(1, 6)), (side, side)).repeat(block, 0).repeat(block, 1)[:side, :side]
    owner[generator.random((side, side)) < draw(st.sampled_from([0.0, 0.1, 0.3]))] = -1
    for _ in range(draw(st.integers(0, 3))):
        row, column, length = generator.integers(0, side, 3)
        owner[row : row + 1, column : column + length] = -1
    label = np.full((side, side), -1, np.int32)
    count = 0
    for number in range(owner.max() + 1):
        parts, piece = cv2.connectedComponents((owner == number).astype(np.uint8), connectivity=4)
        label[piece > 0] = piece[piece > 0] - 1 + count
        count += parts - 1
    assume(count)
    return parted(label)


def parted(label) -> RegionMap:
    """(H, W) numbers of regions; -1 for walls."""
    count = int(label.max()) + 1
    grid = OccupancyGrid.from_free(label >= 0)
    regions = tuple(
        Region(f"region {number}", "room", len(cells), float(len(cells)), tuple(cells.mean(axis=0)), tuple(cells[0]))
        for number, cells in ((number, np.argwhere(label == number)) for number in range(count))
    )
    nothing = np.full(label.shape, -1, np.int32)
    doors = find_doorways(label, np.ones(label.shape, np.float32), nothing, np.full(count, np.inf, np.float32), 1.0)
    return RegionMap(grid, label, regions, doors, ())


@given(partitions(), st.data(), st.sampled_from([0, 20_000_000]), st.sampled_from([0, 20, 10**9]))
@settings(max_examples=300, deadline=None)
def test_no_way_is_3_percent_longer_than_the_shortest(regions, data, walked, vast):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("qualrl.planning.routes.WALKED", walked)
        patch.setattr("qualrl.planning.routes.VAST", vast)
        hold_for_short_and_exact_ways(Routes(regions), data)


def hold_for_short_and_exact_ways(routes: Routes, data) -> None:
    """From some cells to one of them, whichever is drawn."""
    regions = routes.regions
    cells = [tuple(cell) for cell in np.argwhere(regions.grid.free).tolist()]
    goal = data.draw(st.sampled_from(cells))
    away = shortest(routes, goal)
    for start in cells[:: 1 + len(cells) // 20]:
        if away[start] < 0:
            with pytest.raises(NoPlanError):
                routes.between(start, goal)
            continue
        route, exact = routes.between(start, goal), routes.between(start, goal, exact=True)
        check(routes, route, start, goal)
        assert exact.steps == away[start]
        assert route.steps <= 1.03 * away[start]


@given(st.data(), free_masks(side=9, connected=False))
@settings(max_examples=60, deadline=None)
def test_ways_exist_where_they_do(data, free):
    routes = Routes(qualrl.segment(OccupancyGrid.from_free(free)))
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    start, goal = data.draw(st.sampled_from(cells)), data.draw(st.sampled_from(cells))
    away = shortest(routes, goal)[start]
    if away < 0:
        with pytest.raises(NoPlanError, match=r"no way leads from cell \d+,\d+ to cell"):
            routes.between(start, goal)
        return
    check(routes, routes.between(start, goal), start, goal)
    assert routes.between(start, goal, exact=True).steps == away


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_the_search_over_doorways_equals_networkx(data):
    count = data.draw(st.integers(2, 5))
    doors = data.draw(st.lists(st.lists(st.integers(0, count - 1), min_size=2, max_size=2, unique=True), max_size=8))
    found = sorted((region, number) for number, pair in enumerate(doors) for region in pair)
    region = np.array([here for here, _ in found], np.int32)
    first = np.searchsorted(region, np.arange(count + 1)).astype(np.int64)
    partner = [next(at for at, (r, n) in enumerate(found) if n == number and r != here) for here, number in found]
    width = np.diff(first)[region] if len(found) else np.zeros(0, np.int64)
    row = np.cumsum(width) - width
    step_counts = st.integers(-1, 9)
    steps = np.array([data.draw(step_counts) for _ in range(int(width.sum()))], np.int32)
    start, goal = data.draw(st.integers(0, count - 1)), data.draw(st.integers(0, count - 1))
    leave = np.array([data.draw(step_counts) for _ in range(first[start], first[start + 1])], np.int32)
    arrive = np.array([data.draw(step_counts) for _ in range(first[goal], first[goal + 1])], np.int32)

    graph: nx.DiGraph = nx.DiGraph()
    graph.add_nodes_from(["start", "goal"])
    for at, (here, _) in enumerate(found):
        graph.add_edge(("out", at), ("in", partner[at]), weight=1)
        for other in range(first[here], first[here + 1]):
            if steps[row[at] + other - first[here]] >= 0:
                graph.add_edge(("in", at), ("out", other), weight=int(steps[row[at] + other - first[here]]))
        if here == start and leave[at - first[start]] >= 0:
            graph.add_edge("start", ("out", at), weight=int(leave[at - first[start]]))
        if here == goal and arrive[at - first[goal]] >= 0:
            graph.add_edge(("in", at), "goal", weight=int(arrive[at - first[goal]]))
    expected = 2000
    if nx.has_path(graph, "start", "goal"):
        expected = nx.shortest_path_length(graph, "start", "goal", weight="weight")

    nothing, width = np.zeros(0, np.int32), row.astype(np.int64)
    gates = routing.Gates(first, region, region, np.array(partner, np.int32), width, nothing, np.zeros(1, np.int64))
    remaining = nx.single_source_dijkstra_path_length(graph.reverse(), "goal")
    led = [min(int(remaining.get(("out", at), 30)), data.draw(st.integers(0, 30))) for at in range(len(found))]
    for most in (1000, expected, expected + 1) if expected < 2000 else (1000,):
        best, last, away, before = routing.over_gates(
            gates, steps, start, leave, goal, arrive, np.array(led, np.int32), most
        )
        assert best == min(expected, most)
        assert (last >= 0) == (expected < most)
        if last < 0:
            continue
        assert region[partner[last]] == goal
        assert best == away[last] + 1 + arrive[partner[last] - first[goal]]
        while before[last] >= 0:
            inside = partner[before[last]]
            assert region[inside] == region[last]
            assert away[last] == away[before[last]] + 1 + steps[row[inside] + last - first[region[last]]]
            last = before[last]
        assert region[last] == start
        assert away[last] == leave[last - first[start]]


def met(gates, steps, region, leave, beyond, limit) -> dict[int, int]:
    """By gate, the least steps with which it is left by, from somewhere in a region; textbook Dijkstra.

    A gate is passed over from which the steps so far and those beyond are not less than the limit.
    """
    found: dict[int, int] = {}
    waiting = [(away, at) for at, away in enumerate(leave.tolist(), gates.first[region]) if away >= 0]
    while waiting:
        away, at = min(waiting)
        waiting.remove((away, at))
        if at not in found and away + beyond[at] < limit:
            found[at] = away
            inside = int(gates.partner[at])
            first, end = gates.first[gates.region[inside]], gates.first[gates.region[inside] + 1]
            row = steps[gates.row[inside] :][: end - first].tolist()
            waiting += [(away + 1 + more, other) for other, more in enumerate(row, first) if more >= 0]
    return found


@given(partitions(), st.data(), st.sampled_from([0, 3]), st.sampled_from([0, 20_000_000]))
@settings(max_examples=150, deadline=None)
def test_the_regions_kept_are_those_of_the_textbook(regions, data, longer, walked):
    """Those of all doorways by which, by the least steps, a way may be short enough, and those of a shortest way."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("qualrl.planning.routes.WALKED", walked)
        routes = Routes(regions)
    cells = [tuple(cell) for cell in np.argwhere(regions.grid.free).tolist()]
    gates, graph = routes.graph.gates, routes.graph
    ends = []
    for row, column in data.draw(st.lists(st.sampled_from(cells), min_size=2, max_size=2)):
        region = int(regions.label[row, column])
        ends.append(routing.End(row, column, region, *routes._to_gates(region, [routes._flat((row, column))])))
    start, goal = ends
    most = data.draw(st.sampled_from([2**30, 5, 40]))
    wanted, found = routing.on_the_way(gates, graph.boxes, graph.steps, graph.least, start, goal, most, longer)

    partner, none = gates.partner.tolist(), [0] * len(gates.partner)
    away = met(gates, graph.steps, start.region, start.middle, none, 2**31)
    back = met(gates, graph.steps, goal.region, goal.middle, none, 2**31)
    through = {at: away[at] + 1 + back[partner[at]] for at in away if partner[at] in back}
    assert found == min([most, *through.values()])
    limit = -(-100 * found // (100 + longer))
    straight_on = apart(graph.boxes, np.repeat([goal.row, goal.column], 2)[:, None]).tolist()
    away = met(gates, graph.least, start.region, start.nearest, straight_on, limit)
    back = met(gates, graph.least, goal.region, goal.nearest, [away.get(at, limit) + 1 for at in partner], limit)
    kept = sides(gates, back)
    first_way = sides(gates, [at for at, steps in through.items() if steps == found < most])
    assert kept <= set(np.flatnonzero(wanted).tolist()) <= kept | first_way
    if first_way:
        assert wanted[[start.region, goal.region]].all()


def sides(gates, passed) -> set[int]:
    """The regions on both sides of some gates."""
    return {int(region) for at in passed for region in gates.region[[at, gates.partner[at]]]}


@given(st.data())
@settings(max_examples=100, deadline=None)
def test_the_straight_rows_among_gates_are_those_on_which_networkx_walks_straight(data):
    regions = data.draw(partitions())
    gates = gates_of(regions)
    height, width = regions.label.shape
    for gate, is_straight in enumerate(straight(gates, regions.label).tolist()):
        cells = gates.cells[gates.cell_first[gate] : gates.cell_first[gate + 1]].tolist()
        assert gates.cell[gate] in cells
        own = regions.label.ravel()[cells]
        assert (own == gates.region[gate]).all()
        inside = [divmod(cell, width) for cell in np.flatnonzero(regions.label == gates.region[gate]).tolist()]
        graph = nx.grid_2d_graph(height, width).subgraph(inside)
        ends = [divmod(cell, width) for cell in cells]
        away = [[nx.shortest_path_length(graph, one, other) for other in ends] for one in ends]
        if is_straight:
            assert away == [[abs(a - c) + abs(b - d) for c, d in ends] for a, b in ends]
        elif len({row for row, _ in ends}) == 1 or len({column for _, column in ends}) == 1:
            assert len(cells) <= max(abs(ends[0][0] - ends[-1][0]), abs(ends[0][1] - ends[-1][1]))  # there is a gap


def test_gates_that_are_nearest_meet_where_networkx_says():
    generator = np.random.default_rng(1)
    for _ in range(20):
        label = generator.integers(-1, 1, (9, 9)).astype(np.int32)
        inside = np.flatnonzero(label.ravel() == 0)
        cells = generator.choice(inside, 4).astype(np.int32)
        owner, steps, queue = np.full(81, -1, np.int32), np.zeros(81, np.int32), np.zeros(81, np.int32)
        pairs, between = routing.nearest_gates(label, cells, owner, steps, queue)
        assert (owner == -1).all()
        grid = nx.grid_2d_graph(9, 9).subgraph([divmod(cell, 9) for cell in inside.tolist()])
        for (one, other), found in zip(pairs.tolist(), between.tolist(), strict=True):
            ends = divmod(int(cells[one]), 9), divmod(int(cells[other]), 9)
            assert found >= nx.shortest_path_length(grid, *ends)
        places = {divmod(int(cell), 9) for cell in cells}
        met = nx.Graph()
        met.add_nodes_from(places)
        for (one, other), found in zip(pairs.tolist(), between.tolist(), strict=True):
            ends = divmod(int(cells[one]), 9), divmod(int(cells[other]), 9)
            met.add_edge(*ends, weight=min(found, met.get_edge_data(*ends, {"weight": found})["weight"]))
        for one in places:  # whoever can reach each other can do so from gate to gate, and the nearest one at once
            reach = nx.single_source_shortest_path_length(grid, one)
            assert nx.node_connected_component(met, one) == places & set(reach)
            away = nx.single_source_dijkstra_path_length(met, one)
            others = {other: steps for other, steps in reach.items() if other in places - {one}}
            if others:
                assert min(away[other] for other in others) == min(others.values())


def test_places_are_read_as_everywhere(office):
    named = office.between("room A", "room G")
    assert named.regions == ("room A", "corridor 1", "room G")
    assert named.doors == ("door 1", "door 8")
    row, column = next(region.centre for region in office.regions.regions if region.name == "room A")
    assert office.between((row, column), "room G").steps == named.steps
    assert office.between("room A", "room A").regions == ("room A",)
    assert office.between("room A", "room A").steps == 0
    with pytest.raises(UnknownNameError, match="room Z"):
        office.between("room A", "room Z")
    with pytest.raises(PlaceError, match="outside the map"):
        office.between("room A", (0, 100_000))


@pytest.mark.parametrize("vast", [0, 50_000])
def test_a_way_may_leave_its_region_and_come_back(vast, monkeypatch):
    monkeypatch.setattr("qualrl.planning.routes.VAST", vast)
    horseshoe = parted(np.array([[0, 1, 1, 1, 0], *[[0, -1, -1, -1, 0]] * 5, [0] * 5], np.int32))
    for exact in (False, True):
        assert Routes(horseshoe).between((1, 0), (1, 4), exact=exact).regions == ("region 0", "region 1", "region 0")
    # a wall divides the left part of the corridor's loop: the short way round is through the other room
    regions = qualrl.segment(grid_of(PUZZLE))
    routes = Routes(regions)
    for start in np.argwhere(regions.grid.free).tolist():
        route = routes.between(tuple(start), (6, 6))
        check(routes, route, start, (6, 6))
        assert route.steps >= shortest(routes, (6, 6))[tuple(start)]


def test_steps_are_counted_anew_before_they_overflow(office, monkeypatch):
    before = office.between("room B", "room H").steps
    monkeypatch.setattr("qualrl.planning.routes.MOST", 5000)
    for _ in range(3):
        assert office.between("room B", "room H").steps == before
        assert office._base < 2**31
