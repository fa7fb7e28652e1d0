"""Make the tables of the qualitative calculi from concrete models, all of them up to a size that more does not add to.

    python -m qualrl.training.calculi

Each model is a few things that stand for all: three points in a row, nine on a square, intervals between six points,
and regions that are sets of five cells of a line.  A table holds what is seen between any three of them, and no more.
"""

import argparse
import json
from collections.abc import Callable
from itertools import combinations, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import qualrl.qualitative
from qualrl.qualitative.calculus import CALCULI, Calculus

Seen = tuple[tuple[str, ...], str, NDArray[np.int64]]
"""(names of the base relations, the name of identity, (M, M) number of the relation between each two things)."""

POINT = ("<", "=", ">")
COMPASS = (("SW", "W", "NW"), ("S", "EQ", "N"), ("SE", "E", "NE"))
"""By order of the coordinates east, then north."""
ALLEN = {
    ("<", "<", "<", "<"): "before", ("<", "<", "=", "<"): "meets", ("<", "<", ">", "<"): "overlaps",
    ("=", "<", ">", "<"): "starts", (">", "<", ">", "<"): "during", (">", "<", ">", "="): "finishes",
    ("=", "<", ">", "="): "equals", ("<", "<", ">", "="): "finished-by", ("<", "<", ">", ">"): "contains",
    ("=", "<", ">", ">"): "started-by", (">", "<", ">", ">"): "overlapped-by", (">", "=", ">", ">"): "met-by",
    (">", ">", ">", ">"): "after",
}  # fmt: skip
"""What an interval is called by how its start lies to the other's start and end, and then its end to these."""
RCC8 = ("DC", "EC", "PO", "TPP", "NTPP", "TPPi", "NTPPi", "EQ")
LINE_CELLS = 5
"""Sets of four cells show 153 triples, of five 193, and of up to ten no more."""


def points() -> Seen:
    """Three points: earlier, the same, later."""
    at = np.arange(3)
    return POINT, "=", np.sign(at[:, None] - at) + 1


def compass_points() -> Seen:
    """The points of a square of three by three: where the first lies, seen from the second."""
    at = np.array(list(product(range(3), repeat=2)))
    east, north = np.moveaxis(np.sign(at[:, None] - at) + 1, 2, 0)
    return tuple(name for column in COMPASS for name in column), "EQ", 3 * east + north


def intervals() -> Seen:
    """Intervals with their ends among six points: any three intervals have as many ends."""
    spans = list(combinations(range(6), 2))
    names = tuple(ALLEN.values())

    def number(first: tuple[int, int], second: tuple[int, int]) -> int:
        start, end = ([POINT[int(np.sign(at - other)) + 1] for other in second] for at in first)
        return names.index(ALLEN[start[0], start[1], end[0], end[1]])

    return names, "equals", np.array([[number(first, second) for second in spans] for first in spans])


def cell_sets() -> Seen:
    """Sets of cells of a line, closed: a cell and the next one touch; a set's bits are its cells."""
    first = np.arange(1, 1 << LINE_CELLS)[:, None] << 1
    second = first.T

    def grown(cells: NDArray[np.int64]) -> NDArray[np.int64]:
        return cells | cells << 1 | cells >> 1

    def has(cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        return np.asarray(cells != 0)

    inside, around = ~has(first & ~second), ~has(second & ~first)
    choices = {
        "EQ": inside & around,
        "DC": ~has(grown(first) & second),
        "EC": ~has(first & second),
        "NTPP": ~has(grown(first) & ~second),
        "NTPPi": ~has(grown(second) & ~first),
        "TPP": inside,
        "TPPi": around,
    }  # the first that is true
    numbers = [RCC8.index(name) for name in choices]
    return RCC8, "EQ", np.select(list(choices.values()), numbers, RCC8.index("PO"))


MODELS: dict[str, Callable[[], Seen]] = dict(zip(CALCULI, (points, compass_points, intervals, cell_sets), strict=True))


def generated(name: str) -> Calculus:
    """The calculus of that name, from its models."""
    relations, identity, between = MODELS[name]()
    holds = [(between == relation).astype(np.float32) for relation in range(len(relations))]

    def after(first: int, second: int) -> int:
        """What holds between a and c wherever some b has these relations to both."""
        return sum(1 << relation for relation in np.unique(between[holds[first] @ holds[second] > 0]).tolist())

    numbers = range(len(relations))
    converses = tuple(int(np.unique(between.T[between == relation]).item()) for relation in numbers)
    composition = tuple(tuple(after(first, second) for second in numbers) for first in numbers)
    return Calculus(name, relations, relations.index(identity), converses, composition)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(qualrl.qualitative.__file__).parent / "calculi")
    folder = parser.parse_args().out
    for name in CALCULI:
        made = generated(name)
        text = json.dumps(made.to_dict(), indent=1)
        (folder / f"{name}.json").write_text(text + "\n", encoding="utf-8")
        print(f"{name}: {len(made.relations)} relations, {made.triples} triples")


if __name__ == "__main__":
    main()
