"""Calculi: tables made anew, and closure against every assignment of concrete models."""

import json
from itertools import permutations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import UnknownNameError
from qualrl.qualitative.calculus import CALCULI, algebraic_closure, calculus, calculus_of
from qualrl.training.calculi import generated, main
from tests.oracles_relations import closed as closed_by_the_textbook
from tests.oracles_relations import rcc8

PUBLISHED = {"point": (3, 13), "cardinal": (9, 169), "allen": (13, 409), "rcc8": (8, 193)}


def order(a, b):
    return "<" if a < b else ">" if a > b else "="


def seen_from(a, b):
    """Where the point a (east, north) lies seen from b."""
    up = {"<": "S", "=": "", ">": "N"}[order(a[1], b[1])]
    return up + {"<": "W", "=": "", ">": "E"}[order(a[0], b[0])] or "EQ"


def allen(a, b):
    """In the words of Allen's definitions, one after the other."""
    (s, e), (t, f) = a, b
    rules = {
        "before": e < t, "after": f < s, "meets": e == t, "met-by": f == s,
        "overlaps": s < t < e < f, "overlapped-by": t < s < f < e,
        "starts": s == t and e < f, "started-by": s == t and f < e,
        "finishes": e == f and t < s, "finished-by": e == f and s < t,
        "during": t < s and e < f, "contains": s < t and f < e, "equals": a == b,
    }  # fmt: skip
    (name,) = [name for name, holds in rules.items() if holds]
    return name


NUMBERS = st.integers(0, 5)
CELLS = st.frozensets(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1)
RINGS = st.builds(
    lambda r, c, size: frozenset(product(range(r - size, r + size + 1), range(c - size, c + size + 1))),
    st.integers(0, 4), st.integers(0, 4), st.integers(0, 3),
)  # fmt: skip
THINGS = {
    "point": (order, NUMBERS),
    "cardinal": (seen_from, st.tuples(NUMBERS, NUMBERS)),
    "allen": (allen, st.tuples(NUMBERS, NUMBERS).filter(lambda span: span[0] < span[1])),
    "rcc8": (rcc8, CELLS | RINGS),
}


@pytest.mark.parametrize("name", CALCULI)
def test_tables_are_those_of_the_models_and_as_large_as_published(name):
    made, shipped = generated(name), calculus(name)
    assert made.to_dict() == shipped.to_dict()
    assert (len(shipped.relations), shipped.triples) == PUBLISHED[name]


def test_the_command_writes_what_is_shipped(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["calculi", "--out", str(tmp_path)])
    main()
    assert "rcc8: 8 relations, 193 triples" in capsys.readouterr().out
    for name in CALCULI:
        written = calculus_of(json.loads((tmp_path / f"{name}.json").read_text()))
        assert written.to_dict() == calculus(name).to_dict()


@pytest.mark.parametrize("name", CALCULI)
@settings(deadline=None, max_examples=300)
@given(st.data())
def test_composition_and_converse_hold_for_any_three_things(name, data):
    of = calculus(name)
    between, things = THINGS[name]
    a, b, c = (data.draw(things) for _ in range(3))
    ab, bc, ac = (of.relation(between(*pair)) for pair in ((a, b), (b, c), (a, c)))
    assert ac & of.compose(ab, bc)
    assert of.converse(ab) == of.relation(between(b, a))
    assert of.relation(between(a, a)) == 1 << of.identity


@pytest.mark.parametrize("name", CALCULI)
@settings(deadline=None, max_examples=60)
@given(st.data())
def test_sets_are_the_unions_of_their_base_relations(name, data):
    of = calculus(name)
    first, second = (data.draw(st.integers(0, of.any_relation)) for _ in range(2))
    pairs = product(of.names(first), of.names(second))
    after = {t for r, s in pairs for t in of.names(of.compose(of.relation(r), of.relation(s)))}
    assert set(of.names(of.compose(first, second))) == after
    assert of.converse(of.compose(first, second)) == of.compose(of.converse(second), of.converse(first))
    assert of.converse(of.converse(first)) == first
    assert of.compose(first, 1 << of.identity) == first


@pytest.mark.parametrize("name", CALCULI)
@settings(deadline=None, max_examples=100)
@given(st.data())
def test_networks_of_concrete_things_are_never_refuted(name, data):
    of = calculus(name)
    between, things = THINGS[name]
    models = data.draw(st.lists(things, min_size=2, max_size=6))
    truth = {pair: of.relation(between(*(models[at] for at in pair))) for pair in permutations(range(len(models)), 2)}
    known = data.draw(st.lists(st.tuples(st.sampled_from(sorted(truth)), st.integers(0, of.any_relation)), max_size=12))
    closed = algebraic_closure(of, len(models), [(*pair, truth[pair] | more) for pair, more in known])
    assert closed is not None
    for (a, b), relation in truth.items():
        assert closed[a][b] & relation
        assert of.converse(closed[a][b]) == closed[b][a]
    for a, b, c in product(range(len(models)), repeat=3):
        assert closed[a][c] & of.compose(closed[a][b], closed[b][c]) == closed[a][c]


@pytest.mark.parametrize("name", CALCULI)
@settings(deadline=None, max_examples=50)
@given(st.data())
def test_compiled_closure_equals_the_textbook(name, data):
    of = calculus(name)
    things = data.draw(st.integers(1, 5))
    thing = st.integers(0, things - 1)
    wide = st.integers(0, of.any_relation).map(lambda bits: bits | data.draw(st.integers(0, of.any_relation)))
    constraints = data.draw(st.lists(st.tuples(thing, thing, wide), max_size=8))
    found = algebraic_closure(of, things, constraints)
    assert (None if found is None else found.tolist()) == closed_by_the_textbook(of, things, constraints)


SMALL_MODELS = {
    "point": (order, list(range(4))),
    "cardinal": (seen_from, list(product(range(3), repeat=2))),
    "allen": (allen, [(s, e) for e in range(6) for s in range(e)]),
}


@pytest.mark.parametrize("name", SMALL_MODELS)
@settings(deadline=None, max_examples=60)
@given(st.data())
def test_base_relations_between_three_things_are_refuted_just_when_no_model_has_them(name, data):
    of = calculus(name)
    between, models = SMALL_MODELS[name]
    wanted = [data.draw(st.sampled_from(of.relations)) for _ in range(3)]
    pairs = ((0, 1), (1, 2), (0, 2))
    closed = algebraic_closure(of, 3, [(*pair, of.relation(r)) for pair, r in zip(pairs, wanted, strict=True)])
    exists = any(
        all(between(three[a], three[b]) == r for (a, b), r in zip(pairs, wanted, strict=True))
        for three in product(models, repeat=3)
    )
    assert (closed is not None) == exists


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(1, 7)), max_size=8))
def test_closure_decides_any_orders_of_four_points(constraints):
    of = calculus("point")
    closed = algebraic_closure(of, 4, constraints)
    exists = any(
        all(of.relation(order(at[a], at[b])) & relation for a, b, relation in constraints)
        for at in product(range(4), repeat=4)
    )
    assert (closed is not None) == exists


def test_a_cycle_is_refuted_and_what_follows_is_told():
    of = calculus("cardinal")
    north, south = of.relation("N", "NE", "NW"), of.relation("S", "SE", "SW")
    assert algebraic_closure(of, 3, [(0, 1, north), (1, 2, north), (2, 0, north)]) is None
    assert algebraic_closure(of, 1, [(0, 0, north)]) is None
    closed = algebraic_closure(of, 3, [(0, 1, north), (1, 2, north)])
    assert closed is not None
    assert closed[2][0] == south
    assert algebraic_closure(of, 0, []).shape == (0, 0)
    known = algebraic_closure(of, 3, [(0, 1, north)])
    assert (algebraic_closure(of, 3, [(1, 2, north)], known) == closed).all()


def test_unknown_names_are_refused():
    with pytest.raises(UnknownNameError, match="no calculus is called 'rcc'; did you mean 'rcc8'"):
        calculus("rcc")
    with pytest.raises(UnknownNameError, match="no relation of the calculus 'rcc8' is called 'TPPI'; did"):
        calculus("rcc8").relation("TPPI")
