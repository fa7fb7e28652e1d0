"""Exact values beside other solvers, to an error of 5e-3 where ours settles to a relative 1e-12; on the same world.

    python -m tests.benchmarks --only 3

CPU seconds without what it takes to build a model: matrices there, successors here.  All values are checked.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks.effort import Effort
from tests.benchmarks.exact_values import (
    ERROR,
    GAMMA,
    SIDES,
    beside_scipy,
    check_error,
    solved,
    sparse_table,
    world,
)
from tests.benchmarks.peers import QUANTECON, STORM, PeerError
from tests.benchmarks.table import Row, short

SLIP = 0.2


def rows(effort: Effort) -> Iterator[Row]:
    """Target 3's rows beside peers, for which it sets no ratio."""
    grid = world(SIDES[1] if effort.quick else SIDES[2], SLIP)
    solved(grid, 1)  # compile
    mine = float(np.median(solved(grid, 3).both))
    what = f"exact values, {len(grid):,} states, slip {grid.slip}"

    def row(title: str, seconds: float) -> Row:
        return Row(3, what, f"{short(mine)} CPU s", f"{title} {short(seconds)} CPU s", [seconds / mine])

    yield row("scipy", beside_scipy(grid))
    step, reward = sparse_table(grid)
    with tempfile.TemporaryDirectory() as folder:
        values_in = Path(folder) / "values.npy"
        data = {
            "n_actions": grid.n_actions, "gamma": GAMMA, "error": ERROR, "values_in": str(values_in), "reward": reward,
            "probability": step.data, "target": step.indices, "row_start": step.indptr,
        }  # fmt: skip
        for peer in (QUANTECON, STORM):
            try:
                seconds = effort.environments.run(peer, data)["seconds"]
                check_error(np.load(values_in), grid)
            except (PeerError, AssertionError) as error:
                yield Row(3, what, beside=peer.title, missing=str(error))
                continue
            yield row(peer.title, seconds)
