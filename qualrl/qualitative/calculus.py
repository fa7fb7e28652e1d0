"""Qualitative calculi: a few relations of which just one holds between any two things, and what follows from them.

A set of base relations ("one of these holds, and it is not known which") is a whole number with a bit for each, the
first relation the lowest; 0 is "none can hold", a contradiction.  The tables were made from concrete models by
``qualrl.training.calculi`` and are never typed; they lie in the folder ``calculi``.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import UnknownNameError, did_you_mean
from qualrl.kernels import closure

CALCULI = ("point", "cardinal", "allen", "rcc8")
"""Orders of points; directions of points from each other; intervals; regions (RCC8)."""

Relation = int
"""A set of base relations, as bits."""
Constraint = tuple[int, int, Relation]
"""(first, second, relation of the first to the second), things by their number."""
Network = NDArray[np.int32]
"""(N, N) relations by first and second thing."""


@dataclass(frozen=True, eq=False)
class Calculus:
    """A table: base relations, their converses, and what two of them leave possible when one follows the other."""

    name: str
    relations: tuple[str, ...]
    """Names of the base relations, by bit."""
    identity: int
    """The bit of the relation of a thing to itself."""
    converses: tuple[int, ...]
    """By bit: the bit of the same relation seen from the other end."""
    composition: tuple[tuple[Relation, ...], ...]
    """By two bits: what can hold between a and c when the first holds between a and b, the second between b and c."""

    @property
    def any_relation(self) -> Relation:
        """All base relations: nothing is known."""
        return (1 << len(self.relations)) - 1

    @property
    def triples(self) -> int:
        """How many (r, s, t) there are with t possible after r and s: the size that tables are published with."""
        return sum(cell.bit_count() for row in self.composition for cell in row)

    def relation(self, *names: str) -> Relation:
        """The set of some base relations.  Raises UnknownNameError.

        >>> calculus("point").relation("<", "=")
        3
        """
        for name in names:
            if name not in self.relations:
                hint = did_you_mean(name, self.relations)
                raise UnknownNameError(f"no relation of the calculus {self.name!r} is called {name!r}; {hint}")
        return sum(1 << self.relations.index(name) for name in set(names))

    def names(self, relation: Relation) -> tuple[str, ...]:
        """The base relations in a set."""
        return tuple(name for bit, name in enumerate(self.relations) if relation >> bit & 1)

    def converse(self, relation: Relation) -> Relation:
        """What holds between b and a when the relation holds between a and b."""
        return int(self.converse_table[relation])

    def compose(self, first: Relation, second: Relation) -> Relation:
        """What can hold between a and c when the first holds between a and b, and the second between b and c."""
        return int(
            np.bitwise_or.reduce(self.after[[bit for bit in range(len(self.after)) if first >> bit & 1], second])
        )

    @cached_property
    def after(self) -> Network:
        """(B, 2**B) what can follow a base relation and then a relation."""
        table = np.array(self.composition, np.int32)
        found = np.zeros((len(table), 1), np.int32)
        for cells in table.T:
            found = np.hstack([found, found | cells[:, None]])
        return found

    @cached_property
    def converse_table(self) -> Network:
        """(2**B,) the converse of each relation."""
        found = np.zeros(1, np.int32)
        for other in self.converses:
            found = np.concatenate([found, found | np.int32(1 << other)])
        return found

    def to_dict(self) -> dict[str, Any]:
        """As the files hold it: base relations in words, sets of them separated by blanks."""
        named = zip(self.relations, self.composition, strict=True)
        return {
            "calculus": self.name,
            "relations": list(self.relations),
            "identity": self.relations[self.identity],
            "converse": {name: self.relations[of] for name, of in zip(self.relations, self.converses, strict=True)},
            "composition": {
                name: {second: " ".join(self.names(cell)) for second, cell in zip(self.relations, row, strict=True)}
                for name, row in named
            },
        }


def calculus_of(document: Mapping[str, Any]) -> Calculus:
    """The calculus that ``to_dict`` made this of."""
    relations: tuple[str, ...] = tuple(document["relations"])
    bit = {name: at for at, name in enumerate(relations)}
    composition = tuple(
        tuple(sum(1 << bit[name] for name in document["composition"][first][second].split()) for second in relations)
        for first in relations
    )
    converses = tuple(bit[document["converse"][name]] for name in relations)
    return Calculus(document["calculus"], relations, bit[document["identity"]], converses, composition)


@cache
def calculus(name: str) -> Calculus:
    """One of the CALCULI.  Raises UnknownNameError."""
    if name not in CALCULI:
        raise UnknownNameError(f"no calculus is called {name!r}; {did_you_mean(name, CALCULI)}")
    text = files("qualrl.qualitative").joinpath("calculi", f"{name}.json").read_text(encoding="utf-8")
    return calculus_of(json.loads(text))


def algebraic_closure(
    of: Calculus, things: int, constraints: Iterable[Constraint], known: Network | None = None
) -> Network | None:
    """What is left possible between each two things when every third one is looked at; None for a contradiction.

    known: what holds between them beside the constraints.
    Whatever a concrete model satisfies is left in, so None is proof that there is no model.  The other way round,
    that something is left proves a model for some sets of relations only, among them base relations of all CALCULI.
    """
    network = np.full((things, things), of.any_relation, np.int32) if known is None else known.copy()
    network[np.diag_indices(things)] &= 1 << of.identity
    for first, second, relation in constraints:
        network[first, second] &= relation
        network[second, first] &= of.converse(relation)
    return network if closure.close(network, of.after, of.converse_table) else None
