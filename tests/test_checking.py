"""Claims in words: read back, judged cell by cell, and never in clash where some map shows them all."""

import json
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import qualrl
from qualrl.errors import ScenarioError, SettingError, UnknownNameError
from qualrl.io.scenario import load_scenario
from qualrl.qualitative import conflicts as conflicts_module
from qualrl.qualitative.calculus import algebraic_closure, calculus
from qualrl.qualitative.checking import check, distance_calculus
from qualrl.qualitative.conflicts import conflicts, smallest_conflict
from qualrl.qualitative.statements import CONNECTED, DIRECTIONS, SPELLINGS, Statement, read_statement
from qualrl.qualitative.whereabouts import AXES, is_ordered
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.relations import Relations
from qualrl.spatial.zones import Zone
from tests import oracles_relations as oracles
from tests.command_here import qualrl as qualrl_command
from tests.test_calculi import seen_from
from tests.test_commands import draw
from tests.test_relations import cells_of, labelled, regions_of
from tests.worlds import TWO_ROOMS, grid_of

WRITTEN = [(relation, spelling) for relation, spellings in SPELLINGS.items() for spelling in spellings]
NAMES = ["kitchen", "room A", "corridor 1", "north lab", "Ann's room", "3"]
QUOTED = ["near field", "north of it", "is", "not", "by the sea"]
CUTS = DistanceCuts(1.0, 2.0)
NOWHERE = Relations(regions_of([[0]]))
"""A map with nothing of what is said."""


@given(
    st.sampled_from(NAMES + QUOTED), st.sampled_from(NAMES + QUOTED), st.sampled_from(WRITTEN),
    st.sampled_from(["", "is ", "lies "]), st.booleans(), st.booleans(),
    st.sampled_from([None, "door 2", "near door"]), st.sampled_from(["'", '"']),
)  # fmt: skip
def test_what_is_written_is_read_back(subject, other, written, linking, negated, denied, doorway, quote):
    relation, spelling = written
    one, two = (f"{quote}{name}{quote}" if name in QUOTED else name for name in (subject, other))
    by = f" by {quote}{doorway}{quote}" if doorway and relation == CONNECTED else ""
    text = f"{'Not ' if denied else ''}{one} {linking}{'not ' if negated else ''}{spelling.upper()}  {two}{by}"
    expected = Statement(text, subject, relation, other, negated is not denied, doorway if by else None)
    assert read_statement(text) == expected


UNREAD = {
    "kitchen nort of lab": "'kitchen nort of lab': no relation is known in it; did you mean 'north of'?",
    "kitchen conected to lab": "'kitchen conected to lab': no relation is known in it; did you mean 'connected to'?",
    "kitchen beside lab": "'kitchen beside lab': no relation is known in it; known are 'north of', ",
    "north of lab": "'north of lab': a name is missing; write NAME RELATION NAME, as 'kitchen north of lab'",
    "kitchen is not near": "'kitchen is not near': a name is missing",
    "": "'': no relation is known in it; known are",
    "a near b north of c": "'a near b north of c' can be read as 'a' near 'b north of c' or as 'a near b' north of 'c'",
    "'a b near c": '"\'a b near c": a quote is not closed at the end of a word; quotes stand around names',
    "a near " + 101 * "b": "a name has at most 100 characters, got 101 in a claim",
    401 * "a": "a claim has at most 400 characters, got 401",
}


@pytest.mark.parametrize("text", UNREAD)
def test_what_cannot_be_read_is_told_in_one_line(text):
    with pytest.raises(SettingError) as caught:
        read_statement(text)
    assert str(caught.value).startswith(UNREAD[text])
    assert "\n" not in str(caught.value)


@given(
    st.text(st.sampled_from("ab '\"\n") | st.characters(), max_size=30)
    | st.lists(st.sampled_from(["near", "not", "is", "by", "north", "of", "a", "'", '"x"', "connected", "to"])).map(
        " ".join
    )
)
def test_any_text_is_read_or_refused(text):
    try:
        found = read_statement(text)
    except SettingError as problem:
        refused = str(problem)
    else:
        refused = ""
        assert all(found.names)
        assert found.relation in SPELLINGS
    assert "\n" not in refused


FAMILIES = st.lists(st.frozensets(st.integers(0, 7), min_size=1, max_size=4), min_size=1, max_size=6)


@given(FAMILIES)
def test_conflicts_are_smallest_and_have_nothing_in_common(family):
    def is_consistent(chosen):
        return not any(conflict <= chosen for conflict in family)

    found = conflicts(8, is_consistent)
    rest = frozenset(range(8))
    for conflict in found:
        left = [one for one in family if one <= rest]
        assert conflict.members in left
        assert len(conflict.members) == min(map(len, left))
        assert conflict.is_smallest
        rest -= conflict.members
    assert is_consistent(rest)


@given(FAMILIES)
def test_a_conflict_is_found_also_where_the_smallest_takes_too_long(family):
    def is_consistent(chosen):
        return not any(conflict <= chosen for conflict in family)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(conflicts_module, "MOST_TRIES", 2)
        found = smallest_conflict(frozenset(range(8)), is_consistent)
    assert not is_consistent(found.members)
    assert all(is_consistent(found.members - {one}) for one in found.members)
    assert not found.is_smallest or len(found.members) == min(map(len, family))


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 6), min_size=3, max_size=3), st.floats(0.5, 3), st.floats(0.1, 3))
def test_lengths_of_walks_compose_as_their_sums_allow(places, near_m, more):
    """Of places on a line, and of all lengths that three walks can have."""
    cuts = DistanceCuts(near_m, near_m + more)
    table = distance_calculus(cuts)
    lengths = [abs(places[a] - places[b]) for a, b in ((0, 1), (1, 2), (0, 2))]
    first, second, third = (table.relation(cuts.name(length)) for length in lengths)
    assert third & table.compose(first, second)
    steps = np.unique([*np.linspace(0, 2.5 * cuts.far_m, 9), near_m, cuts.far_m, near_m + 1e-6, 2 * near_m])
    seen = {}
    for a in steps:
        for b in steps:
            for c in steps[(steps <= a + b) & (steps >= abs(a - b))]:
                seen.setdefault((cuts.name(a), cuts.name(b)), set()).add(cuts.name(c))
    for (a, b), names in seen.items():
        assert names <= set(table.names(table.compose(table.relation(a), table.relation(b))))


def test_the_table_of_distances_leaves_out_what_no_three_walks_can_have():
    table = distance_calculus(DistanceCuts(2.0, 5.0))
    near, far = table.relation("near"), table.relation("far")
    assert table.names(table.compose(near, near)) == ("near", "medium")
    assert table.names(table.compose(near, far)) == ("medium", "far")
    wide = distance_calculus(DistanceCuts(3.0, 5.0))
    assert wide.names(wide.compose(near, near)) == ("near", "medium", "far")


def holds_on(relations, of, cuts):
    """Whether a statement holds, cell by cell."""
    grid = relations.regions.grid
    first, second = (cells_of(relations, name) for name in of.names)
    if of.direction:
        shares = oracles.tile_shares(grid, first, second)
        return sum(share for tile, share in shares.items() if of.direction in (tile, *tile.split("-"))) > 0.5 + 1e-12
    if of.relation in ("near", "far from", "at medium distance from"):
        steps = oracles.steps_between(grid.free, relations.centre(of.subject), relations.centre(of.object))
        far = steps * grid.resolution_m
        return {"near": far <= cuts.near_m, "far from": far > cuts.far_m}.get(
            of.relation, cuts.near_m < far <= cuts.far_m
        )
    a, b = set(first), set(second)
    touch = oracles.rcc8(a, b)
    return {
        "apart from": touch == "DC", "touches": touch == "EC", "inside": a <= b, "contains": a >= b,
        "the same as": a == b, "overlaps": bool(a & b and a - b and b - a),
    }[of.relation]  # fmt: skip


TOLD = st.sampled_from([relation for relation in SPELLINGS if relation != CONNECTED])


@st.composite
def claims_of_maps(draw, most=8):
    regions, zones = draw(labelled())
    relations = Relations(regions, zones)
    names = st.sampled_from(relations.names)
    told = st.builds(Statement, st.just("claim"), names, TOLD, names, st.booleans())
    return relations, draw(st.lists(told, min_size=1, max_size=most))


@settings(deadline=None, max_examples=150)
@given(claims_of_maps())
def test_verdicts_are_those_of_the_cells_and_what_is_true_never_clashes(drawn):
    relations, claims = drawn
    found = check(relations, claims, CUTS)
    for claim, judged in zip(claims, found.judged, strict=True):
        assert judged.holds is (holds_on(relations, claim, CUTS) is not claim.negated)
    true = [claim for claim, judged in zip(claims, found.judged, strict=True) if judged.holds]
    assert check(relations, true, CUTS).holds
    assert check(NOWHERE, [renamed(claim, "there") for claim in true], CUTS).clashes == ()
    known = {name for number, name in enumerate(relations.names) if number % 2}
    half = [renamed(claim, "there", known) for claim in true]
    assert check(relations, half, CUTS).clashes == ()


LIES = [f"{way} of" for way in DIRECTIONS]
HOLDS = ["inside", "contains", "the same as", "overlaps"]


def all_true(relations, names):
    """All claims about directions, and about what is inside what, that hold on a map, denials too."""
    said = (
        Statement("claim", one, relation, other, negated)
        for one, other in permutations(names, 2) for relation in (*LIES, *HOLDS) for negated in (False, True)
    )  # fmt: skip
    return [claim for claim in said if holds_on(relations, claim, CUTS) is not claim.negated]


@settings(deadline=None, max_examples=25)
@given(labelled(), st.data())
def test_true_claims_of_directions_and_of_what_is_inside_what_never_clash(drawn, data):
    """Of places some of which are left off the map."""
    regions, zones = drawn
    free = np.argwhere(regions.grid.free)
    part = np.zeros(regions.grid.shape, np.bool_)
    holder = regions.label == data.draw(st.integers(0, len(regions.regions) - 1))
    part[tuple(np.array(data.draw(st.lists(st.sampled_from(np.argwhere(holder).tolist()), min_size=1))).T)] = True
    whole = part.copy()
    whole[tuple(np.array(data.draw(st.lists(st.sampled_from(free.tolist()), min_size=1))).T)] = True
    relations = Relations(regions, [*zones, Zone("part", part), Zone("whole", whole), Zone("twin", part)])
    true = all_true(relations, relations.names)
    known = data.draw(st.sets(st.sampled_from(relations.names)))
    assert check(relations, [renamed(claim, "there", known) for claim in true], CUTS).clashes == ()


MAPS_OF_EIGHT = st.lists(st.sampled_from([-1, 0, 0, 1, 1]), min_size=8, max_size=8).filter(
    lambda cells: {0, 1} <= {*cells}
)


def maps_with_any_x(regions, cells):
    """The map with each set of some cells (N, 2) for a zone, one after the other."""
    for chosen in range(1, 2 ** len(cells)):
        mask = np.zeros(regions.grid.shape, np.bool_)
        mask[tuple(cells[[at for at in range(len(cells)) if chosen >> at & 1]].T)] = True
        yield Relations(regions, [Zone("x", mask)])


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.booleans()), max_size=8))
def test_points_can_be_ordered_where_algebraic_closure_says_so(orders):
    point = calculus("point")
    said = [(low, high, point.relation(*("<" if is_less else "<="))) for low, high, is_less in orders]
    assert is_ordered(5, orders) == (algebraic_closure(point, 5, said) is not None)


STRAIGHT = st.sampled_from([(way, axis) for axis, ways in enumerate(AXES) for way in ways])


@settings(deadline=None, max_examples=200)
@given(st.lists(st.tuples(st.permutations("abc"), STRAIGHT, st.booleans()), min_size=1, max_size=6))
def test_straight_directions_clash_where_no_numbers_fit_them(said):
    """Numbers for the four cells that count of each place, by linear programming."""
    claims = [Statement("claim", *names[:1], f"{way} of", names[1], denied) for names, (way, _), denied in said]
    fits = []
    for axis in range(len(AXES)):
        rows = [("abc".index(of), at, "abc".index(of), at + 1, 0) for of in "abc" for at in range(3)]
        for (one, other, _), (way, along), denied in said:
            if along != axis:
                continue
            here, there = "abc".index(one), "abc".index(other)
            below = (here, 2, there, 0) if way == AXES[axis][0] else (there, 3, here, 1)
            rows.append((*below[2:], *below[:2], 0) if denied else (*below, 1))
        matrix = np.zeros((len(rows), 12))
        for at, (low, low_cell, high, high_cell, _) in enumerate(rows):
            matrix[at, 4 * low + low_cell] += 1
            matrix[at, 4 * high + high_cell] -= 1
        less = [-float(row[-1]) for row in rows]
        fits.append(linprog(np.zeros(12), matrix, less, bounds=(None, None)).status == 0)
    assert bool(check(NOWHERE, claims, CUTS).clashes) is not all(fits)


@settings(deadline=None, max_examples=100)
@given(
    MAPS_OF_EIGHT,
    st.lists(
        st.tuples(
            st.sampled_from([("x", "region 0"), ("region 0", "x"), ("x", "region 1"), ("region 1", "x")]),
            st.sampled_from([*LIES, *HOLDS]), st.booleans(),
        ),
        min_size=1, max_size=3,
    ),
    st.sampled_from([0.0, 0.3]),
)  # fmt: skip
def test_no_clash_of_what_some_set_of_cells_satisfies(cells, said, yaw):
    """All sets of cells of a map of eight, one after the other."""
    regions = regions_of(np.array(cells).reshape(2, 4), (0.0, 0.0, yaw))
    claims = [Statement("claim", one, relation, other, negated) for (one, other), relation, negated in said]
    found = check(Relations(regions), claims, CUTS)
    assert not found.clashes or not any(
        all(holds_on(relations, claim, CUTS) is not claim.negated for claim in claims)
        for relations in maps_with_any_x(regions, np.argwhere(regions.grid.free))
    )


@settings(deadline=None, max_examples=25)
@given(MAPS_OF_EIGHT, st.sampled_from([0.0, 0.3]))
def test_a_place_inside_a_region_clashes_with_a_direction_that_no_part_of_the_region_has(cells, yaw):
    regions = regions_of(np.array(cells).reshape(2, 4), (0.0, 0.0, yaw))
    possible = set()
    for relations in maps_with_any_x(regions, np.argwhere(regions.label == 1)):
        possible |= {claim for claim in about_x() if holds_on(relations, claim, CUTS) is not claim.negated}
    inside = Statement("claim", "x", "inside", "region 1")
    for claim in about_x():
        found = check(Relations(regions), [claim, inside], CUTS).clashes
        assert [clash.members for clash in found] == ([] if claim in possible else [(0, 1)])


def about_x():
    """That it lies in each direction from region 0, and that it does not."""
    return [Statement("claim", "x", way, "region 0", negated) for way in LIES for negated in (False, True)]


def test_what_is_inside_a_region_lies_where_the_region_does():
    """A claims file that was called free of clashes: room B lies west of room A."""
    relations = Relations(
        regions_of([[1, 1, 0], [1, 1, 2], [-1, 1, 2]]).renamed({"region 0": "room A", "region 1": "room B"})
    )
    for texts, members in (
        (["Q east of room A", "Q inside room B"], (0, 1)),
        (["Q west of room A", "Q inside room B"], None),
        (["room B contains Q", "P inside Q", "room A west of P"], (0, 1, 2)),
        (["Q inside room B", "Q not west of room A"], (0, 1)),
        (["Q the same as room B", "Q south-west of room A"], None),
        (["Q the same as room B", "Q not south-west of room A"], (0, 1)),
        (["Q inside room B", "Q south-west of room A"], None),
    ):
        found = check(relations, read(*texts), CUTS)
        assert [(clash.members, clash.about) for clash in found.clashes] == (
            [(members, "directions and touching")] if members else []
        ), texts
        assert all(clash.with_map and clash.is_smallest for clash in found.clashes)


def test_what_is_inside_a_region_lies_in_no_corner_that_the_region_is_not_in():
    """The region goes round the corner; so it reaches north and west, but not north-west."""
    relations = Relations(regions_of([[-1, -1, 0], [0, 0, 1]]))
    for way, members in (("north-west", [(0, 1)]), ("north", []), ("west", [])):
        claims = read("Q inside region 0", f"Q {way} of region 1", f"region 0 not {way} of region 1", "P near Q")
        assert [clash.members for clash in check(relations, claims, CUTS).clashes] == members


def renamed(claim, prefix, kept=()):
    """The same of places that are not on the map, but for those kept."""
    subject, other = (name if name in kept else f"{prefix} {name}" for name in claim.names)
    return Statement(claim.text, subject, claim.relation, other, claim.negated, claim.doorway)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.builds(
            Statement,
            st.just("claim"),
            st.sampled_from("abc"),
            st.sampled_from(list(SPELLINGS)),
            st.sampled_from("abc"),
            st.booleans(),
        ),
        min_size=2,
        max_size=5,
    )
)
def test_clashes_are_smallest_and_gone_without_any_of_their_members(claims):
    found = check(NOWHERE, claims, CUTS).clashes
    sizes = [
        len(chosen) for size in range(1, len(claims) + 1) for chosen in combinations(claims, size)
        if check(NOWHERE, chosen, CUTS).clashes
    ]  # fmt: skip
    assert bool(found) == bool(sizes)
    assume(found)
    assert min(len(clash.members) for clash in found) == min(sizes)
    for clash in found:
        assert clash.is_smallest
        assert not clash.with_map
        kept = [claims[at] for at in clash.members]
        assert check(NOWHERE, kept, CUTS).clashes
        for one in range(len(kept)):
            left = check(NOWHERE, kept[:one] + kept[one + 1 :], CUTS).clashes
            assert clash.about not in [other.about for other in left]


def read(*texts):
    return [read_statement(text) for text in texts]


@pytest.mark.parametrize(
    ("texts", "members", "about"),
    [
        (["a north of b", "c near a", "b north of c", "c north-west of a"], (0, 2, 3), "directions"),
        (["a inside b", "b apart from c", "a touches c"], (0, 1, 2), "touching"),
        (["a inside b", "a south of b"], (0, 1), "directions and touching"),
        (["a inside b", "c east of b", "a east of c"], (0, 1, 2), "directions and touching"),
        (["a inside b", "b west of c", "a east of c"], None, ""),  # less than half of b may lie there
        (["a west of b", "a east of x", "x overlaps b"], (0, 1, 2), "directions and touching"),
        (["a the same as b", "a north of c", "c north of b"], (0, 1, 2), "directions and touching"),
        (["a connected to b", "b not connected to a"], (0, 1), "words"),
        (["a connected to b", "b not connected to a by door 1"], None, ""),
        (["a connected to b by door 1", "b not connected to a"], (0, 1), "words"),
        (["a north-east of b", "a not east of b"], (0, 1), "directions"),
        (["a north of b", "b north of c", "a not north of c"], (0, 1, 2), "directions"),
        (["a not north of b", "c inside b", "a north of c"], None, ""),
        (["a not north of b", "b inside c", "a north of c"], (0, 1, 2), "directions and touching"),
        (["a the same as b", "a west of c", "b not west of c"], (0, 1, 2), "directions and touching"),
        (["a north-east of b", "a not north-east of b"], (0, 1), "words"),
        (["a connected to c", "a the same as b", "b not connected to c"], (0, 1, 2), "words"),
        (["a the same as b", "a north of b", "b not north of a"], (0, 1), "directions and touching"),
        (["a north of a", "a not north of a"], (0,), "directions"),
        (["a connected to c", "a not the same as b", "b not connected to c"], None, ""),
        (["a north of b", "a east of b", "a not north-east of b"], None, ""),
        (["a connected to b", "a apart from b"], (0, 1), "touching"),
        (["a near b", "b near c", "a far from c"], (0, 1, 2), "distances"),
        (["a near b", "b near c", "a not near c"], None, ""),
        (["a far from a"], (0,), "distances"),
        (["a north of a"], (0,), "directions"),
        (["a the same as b", "b contains c", "a apart from c"], (0, 1, 2), "touching"),
    ],
)
def test_sketches_in_words_alone(texts, members, about):
    found = check(NOWHERE, read(*texts), DistanceCuts(2.0, 5.0))
    assert [one.holds for one in found.judged] == [None] * len(texts)
    assert [(clash.members, clash.about) for clash in found.clashes] == ([(members, about)] if members else [])
    assert found.holds is (members is None)


@pytest.fixture(scope="module")
def rooms():
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    west, east = sorted(regions.region_names, key=regions.relations.middle)
    return regions.renamed({west: "west room", east: "east room"})


def test_what_is_the_same_is_not_told_as_inside():
    regions = regions_of([[0, 0, 1]])
    relations = Relations(regions, [Zone("dock", regions.label == 0)])
    for claim in ("dock inside region 0", "dock contains region 0", "dock the same as region 0"):
        (judged,) = check(relations, read(claim), CUTS).judged
        assert judged.holds
        assert judged.because == "dock is the same as region 0 (EQ)"


def test_claims_about_a_map_are_judged_with_reasons(rooms):
    door = rooms.doorways[0].name
    told = [
        "west room west of east room", "west room connected to east room by " + door,
        "west room connected to east room by door 9", "dock inside west room", "dock touches east room",
        "west room near east room", "west room is not far from east room", "cellar west of west room",
        "east rom near west room", "east room west of cellar",
    ]  # fmt: skip
    dock = {"dock": [(1, 6), (4, 6), (4, 8), (1, 8)]}
    found = qualrl.check(rooms, told, zones=dock, near_m=3, far_m=30)
    assert [one.holds for one in found.judged] == [True, True, False, True, False, False, True, None, None, None]
    reasons = [one.because for one in found.judged]
    assert reasons[0].endswith("% of west room lies west of east room, more than half")
    assert reasons[1] == reasons[2] == f"joined by {door}"
    assert reasons[3] == "dock is inside west room (TPP)"
    assert reasons[4] == "dock is apart from east room (DC)"
    walk_m = rooms.relations.distance_m("west room", "east room")
    assert reasons[5] == f"{walk_m:.2f} m from centre to centre is medium"
    assert reasons[7] == "'cellar' is not on the map"
    assert reasons[8] == "'east rom' is not on the map (did you mean 'east room'?)"
    assert [(clash.members, clash.with_map) for clash in found.clashes] == [((0, 7, 9), False)]
    on_map = qualrl.check(rooms, told[7:], zones=dock)
    assert [(clash.members, clash.with_map) for clash in on_map.clashes] == [((0, 2), True)]
    assert "cannot hold together on this map (no fewer do): cellar west of west room; east room" in on_map.explain()


def test_what_has_no_such_relation_is_refused(rooms):
    with pytest.raises(UnknownNameError, match=r"^'centre 1' is a landmark; claims are about regions and zones"):
        qualrl.check(rooms, ["centre 1 north of west room"])
    with pytest.raises(SettingError, match=r"^'dock' is a zone, which has no doorways; write touches, overlaps"):
        qualrl.check(rooms, ["dock connected to west room"], zones={"dock": [(1, 6), (4, 6), (4, 8)]})
    with pytest.raises(TypeError, match="check needs a RegionMap"):
        qualrl.check("map.png", [])


def test_every_number_of_the_sentences_stands_in_the_json(rooms):
    told = [
        "west room west of east room",
        "east room near west room",
        "west room inside east room",
        "cellar near attic",
    ]
    told += ["west room connected to east room", "attic not near cellar"]
    found = qualrl.check(rooms, told)
    document = json.loads(json.dumps(found.to_dict()))
    assert document["sentences"] == found.explain().splitlines()
    assert document["holds"] is found.holds is False
    share, walk, inside, _, joined, _ = document["claims"]
    assert share["because"].startswith(f"{share['share']:.1%} of ")
    assert walk["because"] == f"{walk['walk_m']:.2f} m from centre to centre is {walk['distance']}"
    assert inside["because"].endswith(f"({inside['rcc8']})")
    assert joined["because"] == f"joined by {joined['doorways'][0]}"
    told = [[document["claims"][at]["claim"] for at in clash["members"]] for clash in document["clashes"]]
    assert told == [
        ["west room west of east room", "west room inside east room"], ["cellar near attic", "attic not near cellar"]
    ]  # fmt: skip
    for clash, claims in zip(document["clashes"], told, strict=True):
        line = f"clash of {clash['about']}: these cannot hold together (no fewer do): {'; '.join(claims)}"
        assert line in document["sentences"]
    counts = [sum(claim["holds"] is holds for claim in document["claims"]) for holds in (True, False, None)]
    first = f"6 claims: {counts[0]} true, {counts[1]} false, {counts[2]} of places that are not on the map; 2 clashes."
    assert document["sentences"][0] == first


@settings(deadline=None, max_examples=60)
@given(labelled())
def test_what_a_map_shows_of_all_its_places_is_never_refuted(drawn):
    relations = Relations(*drawn)
    middles = {name: relations.middle(name) for name in relations.names}
    shown = {
        calculus("rcc8"): relations.topology,
        distance_calculus(CUTS): lambda a, b: CUTS.name(relations.distance_m(a, b)),
        calculus("cardinal"): lambda a, b: seen_from(middles[a], middles[b]),
    }
    places = range(len(relations.names))
    for of, relation in shown.items():
        facts = [(a, b, of.relation(relation(relations.names[a], relations.names[b]))) for a in places for b in places]
        assert algebraic_closure(of, len(places), facts) is not None


def test_the_command_checks_and_refuses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    draw(tmp_path, "rooms", TWO_ROOMS)
    file = tmp_path / "s.scenario.yaml"
    head = "map: rooms.yaml\ngoal: [2, 2]\n"
    file.write_text(f"{head}claims:\n- room A near room B\n- room A apart from room B\n")
    told, _ = qualrl_command("check", "s.scenario.yaml", cwd=tmp_path, expect=1)
    document = json.loads(qualrl_command("check", "s.scenario.yaml", "--json", cwd=tmp_path, expect=1)[0])
    assert told.splitlines() == document["sentences"]
    assert "false: s.scenario.yaml:5:3: claims.1: room A apart from room B: room A touches room B (EC)" in told
    near = json.loads(
        qualrl_command("check", "s.scenario.yaml", "--set", "claims=[room A touches room B]", "--json", cwd=tmp_path)[0]
    )
    assert near["holds"]
    file.write_text(f"{head}claims:\n- room A near room B\n- room A nort of room B\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file.name)
    expected = (
        "s.scenario.yaml:5:3: claims.1: 'room A nort of room B': no relation is known in it; did you mean 'north of'?"
    )
    assert str(caught.value) == expected
    file.write_text(f"{head}claims: [room A near door 1]\n")
    with pytest.raises(UnknownNameError) as landmark:
        load_scenario(file.name).check()
    told = "s.scenario.yaml:3:10: claims.0: 'door 1' is a landmark; claims are about regions and zones"
    assert str(landmark.value) == told
    file.write_text(head)
    _, error = qualrl_command("check", "s.scenario.yaml", cwd=tmp_path, expect=2)
    assert error.startswith("qualrl: s.scenario.yaml: has no claims to check; add a line 'claims: [")


def test_places_that_a_robot_is_too_large_for_are_named_so():
    narrow = grid_of("#########\n#...#...#\n#...#...#\n#.......#\n#...#...#\n#...#...#\n#########", 0.5)
    lost = qualrl.segment(narrow, radius_m=0.6)
    assert lost.lost
    found = qualrl.check(lost, [f"{lost.lost[0]} near kitchen"])
    because = f"a robot with radius_m 0.6 is too large for {lost.lost[0]!r} and 'kitchen' is not on the map"
    assert [(one.holds, one.because) for one in found.judged] == [(None, because)]
