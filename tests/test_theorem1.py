"""The audit of Theorem 1 against exact algebra, dense linear algebra, simulation, and enumeration."""

import json
from fractions import Fraction

import networkx as nx
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.polys.matrices import DomainMatrix
from typer.testing import CliRunner

import qualrl
from qualrl.commands.main import app
from qualrl.errors import NoPlanError, SettingError
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.solving.crossings import crossings
from qualrl.solving.exact import exact_values
from qualrl.solving.fold import fold
from qualrl.solving.theorem1 import audit_theorem1, blind_lumping, door_blind, door_lumping
from qualrl.solving.theorem1_words import explained
from tests import oracles
from tests.small_worlds import solved, tables, two_corridors, two_doors
from tests.test_commands import ROOT, draw
from tests.test_commands import qualrl as command
from tests.worlds import PUZZLE, TWO_ROOMS, free_masks, grid_of

WIDE_DOOR = """
##############################
#.........#........#.........#
#.........#........#.........#
#.........#........#.........#
#.........#..................#
#..................#.........#
#..................#.........#
#.........#........#.........#
#.........#........#.........#
#.........#........#.........#
##############################
"""


TWO_DOORS = """
####################
#........#.........#
#..................#
#..................#
#........#.........#
#........#.........#
#........#.........#
#..................#
#..................#
#........#.........#
####################
"""


def flat_value_of_the_same_policy(model, folded, values):
    """{(state, way): value}: the flat chain whose state is a state and the action under way, solved densely."""
    table = model.world.table() if isinstance(model.world, GridWorld) else model.world
    ways, part_of = folded.ways, folded.crossings.level.part_of
    chosen = {int(s): ways.exit_of_pair[p] for s, p in zip(ways.state[:-1], values.pair[:-1], strict=True)}
    nodes, work = {}, list(chosen.items())
    rows = []
    while work:
        node = work.pop()
        if node in nodes:
            continue
        nodes[node] = len(nodes)
        s, way = node
        part = ways.parts[int(part_of[s])]
        action = int(ways.policies[int(part_of[s]), way][np.searchsorted(part.inside, s)])
        row, reward = {}, 0.0
        for e in range(
            table.row_start[s * table.n_actions + action], table.row_start[s * table.n_actions + action + 1]
        ):
            p, t = table.probability[e], int(table.target[e])
            reward += p * table.reward[e]
            if p > 0 and not table.terminal[t]:
                after = (t, way if part_of[t] == part_of[s] else chosen[t])
                row[after] = row.get(after, 0.0) + p
                work.append(after)
        rows.append((node, row, reward))
    matrix, right = np.eye(len(nodes)), np.zeros(len(nodes))
    for node, row, reward in rows:
        right[nodes[node]] = reward
        for after, p in row.items():
            matrix[nodes[node], nodes[after]] -= model.gamma * p
    solution = np.linalg.solve(matrix, right) if len(nodes) else right
    return {s: solution[nodes[s, way]] for s, way in chosen.items()}


def assert_refined_is_flat(model):
    folded = fold(model)
    values = folded.solve()
    flat = flat_value_of_the_same_policy(model, folded, values)
    scale = max(1.0, abs(folded.exact.shift))
    for s, value in zip(folded.ways.state[:-1].tolist(), values.value[:-1] - folded.exact.shift, strict=True):
        assert value == pytest.approx(flat[s], abs=1e-9 * scale)
    return folded, values


def test_rounding_is_no_difference_where_no_reward_is_below_0():
    outcomes = {
        0: {0: [(0.00902253, 2, 0.47, False), (0.99097747, 1, 1.81, False)]},
        1: {0: [(0.4777687, 0, 1.34, False), (0.0036769, 3, 0.23, True), (0.5185544, 1, 0.06, False)]},
        2: {0: [(0.70534121, 1, 0.53, False), (0.29465879, 2, 0.57, False)]},
        3: {0: [(1.0, 3, 0.0, True)]},
    }
    table = qualrl.TabularMDP.from_outcomes(outcomes, gamma=0.5)
    refined = audit_theorem1(HybridMDP.from_table(table, ["a", "b", "b", "a"])).refined
    assert refined.holds
    assert refined.scale == pytest.approx(exact_values(table).value.max())


@given(tables())
@settings(max_examples=80, deadline=None)
def test_refined_values_of_random_tables_are_flat_values_of_the_same_policy(model):
    folded, values = assert_refined_is_flat(model)
    audit = audit_theorem1(model)
    assert audit.refined.holds
    smdp = folded.smdp
    sums = np.asarray(smdp.transition.sum(axis=1)).ravel()
    assert np.all(sums <= 1 + 1e-9)
    np.testing.assert_allclose(sums[np.isfinite(smdp.duration)], 1, atol=1e-9)
    assert np.all(values.value[:-1] <= folded.exact.shifted[folded.ways.state[:-1]] + 1e-7)
    json.dumps(audit.to_dict(), allow_nan=False)
    assert explained(audit).startswith("Theorem 1, ")


@given(st.data(), free_masks(side=6), st.sampled_from([0.0, 0.2, 0.5]), st.sampled_from([4, 8]))
@settings(max_examples=60, deadline=None)
def test_refined_values_of_cut_up_grids(data, free, slip, directions):
    cells = np.argwhere(free).tolist()
    goal = tuple(data.draw(st.sampled_from(cells)))
    world = GridWorld(free, goal, 0.9, slip, directions)
    cut = data.draw(st.integers(0, 2**32 - 1))
    names = [f"r{i}" for i in np.random.default_rng(cut).integers(0, 3, size=len(cells))]
    model = HybridMDP.from_table(world.table(), names, start=data.draw(st.integers(0, len(cells) - 1)))
    folded, values = assert_refined_is_flat(model)
    audit = audit_theorem1(model)
    assert audit.refined.holds
    if slip == 0:
        twin = oracles.GridTwin(free, goal, directions).values(0.9)
        for s, w in zip(folded.ways.state[:-1].tolist(), values.value[:-1], strict=True):
            assert w - folded.exact.shift == pytest.approx(twin[tuple(cells[s])], abs=1e-9)
        assert audit.refined.reaches_optimum


@given(st.data(), free_masks(side=9, connected=False), st.sampled_from([4, 8]), st.sampled_from([0.0, 0.1]))
@settings(max_examples=40, deadline=None)
def test_audits_of_random_maps(data, free, directions, slip):
    goal = data.draw(st.sampled_from(np.argwhere(free).tolist()))
    model = qualrl.build(
        qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.2)), goal, directions=directions, slip=slip
    )
    audit = audit_theorem1(model)
    assert audit.refined.holds
    assert audit.refined.reaches_optimum or slip > 0
    assert audit.holds == (audit.blind.counterexample is None)
    if audit.holds:
        assert audit.blind.largest_error <= 1e-8
        assert audit.by_door.holds


@given(tables(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_any_weighing_of_entries_stays_within_the_bounds(model, seed):
    folded = fold(model)
    lumping = blind_lumping(folded)
    least, greatest = lumping.least_values(), lumping.greatest_values()
    smdp, rng = folded.smdp, np.random.default_rng(seed)
    group, names = lumping.group, lumping.names
    weight = rng.random(len(smdp))
    value = np.zeros(len(names))
    rows = [[i for i in range(len(smdp) - 1) if group[i] == g] for g in range(len(names) - 1)]
    dense, reward = smdp.discounted.toarray(), folded.shifted_reward
    for _ in range(3000):
        value[-1] = folded.exact.shift
        spread = np.append(value, 0.0)[group]
        new = value.copy()
        for g, members in enumerate(rows):
            share = weight[members] / weight[members].sum()
            count = smdp.action_start[members[0] + 1] - smdp.action_start[members[0]]
            new[g] = max(
                sum(w * (reward[smdp.action_start[i] + a] + dense[smdp.action_start[i] + a] @ spread)
                    for w, i in zip(share, members, strict=True))
                for a in range(count)
            )  # fmt: skip
        if np.abs(new - value).max() < 1e-11:
            break
        value = new
    scale = max(1.0, float(np.abs(greatest).max()))
    assert np.all(value >= least - 1e-8 * scale)
    assert np.all(value <= greatest + 1e-8 * scale)
    if lumping.is_exact().all():
        expected = folded.solve().value
        for i in np.flatnonzero(group >= 0):
            assert lumping.values()[group[i]] == pytest.approx(expected[i], abs=1e-7 * scale)


def test_two_corridors_identically_in_gamma():
    """Flat and SMDP value as rational functions of gamma are one and the same; the numbers are theirs."""
    gamma, stay = sympy.symbols("gamma"), sympy.Rational(3, 10)
    field = sympy.QQ.frac_field(gamma)
    length = {"short": 3, "long": 6}

    def folded(n):
        inside = sympy.zeros(n, n)
        for i in range(n):
            inside[i, i] = stay
            if i + 1 < n:
                inside[i, i + 1] = 1 - stay
        right = sympy.zeros(n, 2)  # gamma P_out, and the reward
        right[n - 1, 0] = gamma * (1 - stay)
        for i in range(n):
            right[i, 1] = -1 if i < n - 1 else 100 * (1 - stay) - stay
        matrix = DomainMatrix.from_Matrix(sympy.eye(n) - gamma * inside).convert_to(field)
        return matrix.lu_solve(DomainMatrix.from_Matrix(right).convert_to(field)).to_Matrix()

    hub = (1 - stay) * gamma / (1 - stay * gamma)
    for name, n in length.items():
        discount, reward = folded(n)[0, 0], folded(n)[0, 1]
        assert sympy.cancel(discount - (gamma * (1 - stay) / (1 - gamma * stay)) ** n) == 0
        smdp_value = -1 / (1 - stay * gamma) + hub * reward
        # the flat chain: the hub and the corridor in one system
        flat = sympy.zeros(n + 1, n + 1)
        for i in range(n + 1):
            flat[i, i] = stay
            if i < n:
                flat[i, i + 1] = 1 - stay
        gains = sympy.Matrix([-1] * n + [100 * (1 - stay) - stay])
        whole = DomainMatrix.from_Matrix(sympy.eye(n + 1) - gamma * flat).convert_to(field)
        flat_value = whole.lu_solve(DomainMatrix.from_Matrix(gains).convert_to(field)).to_Matrix()[0]
        assert sympy.cancel(smdp_value - flat_value) == 0
        for at in (sympy.Rational(1, 2), sympy.Rational(9, 10), sympy.Rational(99, 100)):
            found = fold(two_corridors(float(at), 0.3))
            entry = next(i for i, s in enumerate(found.smdp.state_names) if s.startswith(f"{name} corridor"))
            pair = int(found.smdp.action_start[entry])
            assert found.smdp.discount[found.smdp.arc_start[pair]] == pytest.approx(float(discount.subs(gamma, at)))
            assert found.smdp.reward[pair] == pytest.approx(float(reward.subs(gamma, at)))
            out = found.smdp.pair_index(found.smdp.state_names[0], f"move from hub to {name} corridor")
            values = found.solve().value - found.exact.shift
            through = found.smdp.reward[out] + (found.smdp.discounted[[out]] @ values).item()
            assert through == pytest.approx(float(flat_value.subs(gamma, at)))


def test_two_corridors_in_exact_fractions():
    gamma, stay = Fraction(9, 10), Fraction(3, 10)
    n = 4  # the hub and the short corridor
    matrix = [[Fraction(int(i == j)) - gamma * (stay * (i == j) + (1 - stay) * (j == i + 1)) for j in range(n)]
              for i in range(n)]  # fmt: skip
    value = solved(matrix, [Fraction(-1)] * 3 + [100 * (1 - stay) - stay])
    model = two_corridors(0.9, 0.3)
    audit = audit_theorem1(model)
    assert audit.holds
    assert audit.start_values == pytest.approx((float(value[0]), float(value[0])), rel=1e-10)
    assert "equal" in explained(audit)
    assert audit.blind.largest_error < 1e-9


def walked(model, state):
    """(steps, discounted reward) of the only way from a state out of its region, by walking it."""
    table, steps, reward, discount = model.world, 0, 0.0, 1.0
    region = model.region_of[state]
    while model.region_of[state] == region and not table.terminal[state]:
        reward, discount = reward + discount * table.reward[table.row_start[state]], discount * table.gamma
        state, steps = int(table.target[table.row_start[state]]), steps + 1
    return steps, reward


def test_a_corridor_with_two_doors_is_the_counterexample_and_the_walk_confirms_it():
    model = two_doors(0.9, far=5, near=2)
    audit = audit_theorem1(model)
    assert not audit.holds
    found = audit.blind.counterexample
    assert {found.first.door, found.second.door} == {"room A to corridor", "room C to corridor"}
    for entry, state in ((found.first, 3), (found.second, 0)):
        steps, reward = walked(model, state)
        assert entry.discount == pytest.approx(0.9**steps)
        assert entry.reward == pytest.approx(reward)
        assert (entry.mean_steps, entry.is_certain) == (pytest.approx(steps), True)
        assert entry.value == pytest.approx(reward)
    assert found.first.discount == pytest.approx(0.9**2)
    assert found.second.discount == pytest.approx(0.9**5)
    middle = (found.first.value + found.second.value) / 2
    assert found.value == pytest.approx(middle)
    assert found.error == pytest.approx(found.first.value - middle)
    assert (found.least, found.greatest) == (pytest.approx(found.second.value), pytest.approx(found.first.value))
    assert audit.by_door.holds
    assert audit.refined.reaches_optimum
    text = explained(audit)
    assert "counterexample" in text
    assert "0.9^5 = 0.59049" in text
    assert "0.9^2 = 0.81" in text


def test_a_start_inside_a_region_does_not_change_what_its_entries_say():
    model = two_doors(0.9)
    without, with_start = audit_theorem1(model), audit_theorem1(model, start=1)
    assert with_start.blind == without.blind
    assert with_start.refined.states == without.refined.states + 1
    assert with_start.start_values == pytest.approx((walked(model, 1)[1],) * 2)


def test_no_region_is_entered_from_the_goal():
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), (4, 9))
    assert model.grid.goal not in crossings(model).source
    assert audit_theorem1(model).refined.reaches_optimum


def test_a_diagonal_step_belongs_to_the_nearest_doorway():
    regions = qualrl.segment(grid_of(TWO_DOORS, 0.4))
    steps = crossings(qualrl.build(regions, "room B", directions=8))
    assert len(regions.doorways) == 2
    cells = np.argwhere(regions.grid.free)
    for s, t, x in zip(steps.source, steps.target, steps.exit_of, strict=True):
        door = next(door for door in regions.doorways if door.name == steps.exit_names[x])
        assert abs(door.cells - (cells[s] + cells[t]) / 2).max(axis=1).min() <= 1


def test_two_doors_at_the_same_distance_are_no_counterexample():
    audit = audit_theorem1(two_doors(0.9, far=4, near=4))
    assert audit.holds
    assert audit.blind.counterexample is None


def test_the_puzzle_has_the_counterexample_of_its_ring():
    model = qualrl.build(qualrl.segment(grid_of(PUZZLE)), (6, 6), start=(11, 1))
    audit = audit_theorem1(model)
    found = audit.blind.counterexample
    cells = oracles.GridTwin(grid_of(PUZZLE).free, (6, 6)).graph()
    region = {tuple(c) for c, r in zip(model.grid.cells.tolist(), model.region_of, strict=True)
              if model.region_names[r] == found.group}  # fmt: skip
    inside = cells.subgraph(region)
    ends = {
        entry.state: tuple(int(x) for x in entry.state.replace(",", "").split()[-3::2])
        for entry in (found.first, found.second)
    }
    near, far = ends[found.first.state], ends[found.second.state]
    assert nx.shortest_path_length(inside, far, near) + 1 == found.second.mean_steps
    assert found.first.mean_steps == 1
    assert audit.start_values == pytest.approx((float(oracles.deterministic_value(32, "9/10")),) * 2)


def test_cells_of_a_wide_doorway_differ_and_only_entry_cells_are_exact():
    model = qualrl.build(qualrl.segment(grid_of(WIDE_DOOR, 0.4)), (1, 27), start=(2, 2), gamma=0.95)
    assert sorted(len(door.cells) for door in model.regions.doorways) == [1, 2]
    audit = audit_theorem1(model)
    assert not audit.blind.holds
    assert not audit.by_door.holds
    found = audit.by_door.counterexample
    assert found.first.door == found.second.door == "door 1"
    assert found.second.mean_steps == pytest.approx(found.first.mean_steps + 1)
    assert audit.by_door.largest_error >= found.error
    assert audit.refined.holds
    assert audit.refined.reaches_optimum
    folded = fold(model)
    assert len(door_lumping(folded).names) < len(folded.smdp)
    assert door_blind(folded).state_names == blind_lumping(folded).names == ("room A", "room B", "room C", "goal")


def test_under_slip_monte_carlo_confirms_the_value_and_the_flat_optimum_is_no_worse():
    free = grid_of(TWO_ROOMS).free
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), (4, 14), start=(4, 5), gamma=0.9, slip=0.2)
    folded, values = fold(model), fold(model).solve()
    twin = oracles.GridTwin(free, (4, 14), slip=0.2)
    ways, part_of = folded.ways, model.region_of
    chosen = {int(s): ways.exit_of_pair[p] for s, p in zip(ways.state[:-1], values.pair[:-1], strict=True)}
    rng, returns = np.random.default_rng(1), []
    for _ in range(4000):
        s, gain, discount = model.start, 0.0, 1.0
        way = chosen[s]
        for _ in range(400):
            part = int(part_of[s])
            action = int(ways.policies[part, way][np.searchsorted(ways.parts[part].inside, s)])
            outcomes = twin.outcomes(model.cell_of(s), action)
            _, cell, reward = outcomes[rng.choice(len(outcomes), p=[p for p, _, _ in outcomes])]
            gain, discount = gain + discount * reward, discount * 0.9
            if cell == (4, 14):
                break
            s = int(model.grid.state_of[cell])
            way = way if part_of[s] == part else chosen[s]
        returns.append(gain)
    audit = audit_theorem1(model)
    flat, folded_value = audit.start_values
    assert np.mean(returns) == pytest.approx(folded_value, abs=4 * np.std(returns) / np.sqrt(len(returns)))
    assert flat >= folded_value - 1e-9
    assert flat == pytest.approx(exact_values(model.world).value[model.start])


def test_what_cannot_be_audited_says_so():
    model = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), "room B")
    with pytest.raises(SettingError, match="levels 2 to 2"):
        audit_theorem1(model, level=3)
    islands = qualrl.build(qualrl.segment(grid_of("#######\n#..#..#\n#..#..#\n#######")), (1, 5))
    with pytest.raises(NoPlanError):
        audit_theorem1(islands, start=islands.state_at(qualrl.spatial.place.read_place((1, 1))))


def test_the_office_in_seconds():
    model = qualrl.load_scenario(ROOT / "maps/office.scenario.yaml").build()
    audit = audit_theorem1(model)
    assert not audit.holds
    assert audit.refined.reaches_optimum
    assert audit.refined.relative_gap < 1e-12
    assert audit.start_values[0] == pytest.approx(audit.start_values[1], rel=1e-12)
    found = audit.blind.counterexample
    assert found.first.door != found.second.door
    assert not {found.first.door, found.second.door} & set(found.action.split(" to ")[0].split("through ")[1:])
    assert found.least <= found.second.value < found.first.value <= found.greatest


SCENARIO = "map: rooms.yaml\nstart: room A\ngoal: room B\nlearn: {gamma: 0.9}\n"


def test_the_command_proves_or_refutes(tmp_path, monkeypatch):
    draw(tmp_path, "rooms", TWO_ROOMS)
    (tmp_path / "rooms.scenario.yaml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)

    def prove(*arguments, expect=0):
        done = CliRunner().invoke(app, ["prove", "theorem1", *arguments])
        assert done.exit_code == expect, done.output
        return done.stdout

    assert prove("rooms.scenario.yaml").startswith("Theorem 1, 2 regions, gamma 0.9: equal.")
    document = json.loads(prove("rooms.scenario.yaml", "--json"))
    assert document["holds"]
    assert document["blind"]["counterexample"] is None
    assert prove("rooms.scenario.yaml", "--quiet") == ""
    assert "row 2, column 3" in prove("rooms.scenario.yaml", "--from", "2,3")
    assert "a counterexample" in prove("puzzle", expect=1)
    document = json.loads(prove("puzzle", "--json", "--set", "motion.slip=0.2", expect=1))
    assert document["blind"]["counterexample"]["first"]["is_certain"] is False
    assert "1 wing, gamma 0.9: equal" in prove("puzzle", "--level", "3")
    for wrong in (["puzzle", "--level", "9"], ["nothing.yaml"], ["puzzle", "--from", "nowhere"]):
        prove(*wrong, expect=2)


def test_the_command_in_a_process_of_its_own(tmp_path):
    out, err = command("prove", "theorem1", "puzzle", cwd=tmp_path, expect=1)
    assert "Refined to region and doorway (5 states): exact." in out
    assert err == ""
