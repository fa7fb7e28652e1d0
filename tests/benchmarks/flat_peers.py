"""Q-learning beside the tabular Q-learners of other libraries: same world, settings and number of steps.

    python -m tests.benchmarks --only 1

CPU seconds; the world is a table of lists in a peer's own interface, so that hardly anything but its learner counts.
"""

from collections.abc import Iterator

import numpy as np

from tests.benchmarks.against_c import ALPHA, EPSILON, ours, puzzle
from tests.benchmarks.effort import Effort
from tests.benchmarks.peers import MUSHROOM, OPEN_SPIEL, RLBERRY, PeerError
from tests.benchmarks.table import Row, short
from tests.benchmarks.worlds_for_peers import maze_data

STEPS = 200_000


def rows(effort: Effort) -> Iterator[Row]:
    """Target 1's rows beside peers, for which it sets no ratio."""
    model, rounds = puzzle(), effort.rounds(3, 1)
    what = f"Q-learning, 13 x 13 puzzle, {STEPS:,} steps"
    data = maze_data(model, ALPHA, EPSILON) | {"steps": STEPS, "rounds": rounds}
    ours(model, 1000, 0)  # compile
    for peer in (OPEN_SPIEL, RLBERRY, MUSHROOM):
        mine = np.array([ours(model, STEPS, seed).speed for seed in range(rounds)])
        try:
            theirs = np.array(effort.environments.run(peer, data)["speeds"]) / 1e6
        except PeerError as error:
            yield Row(1, what, beside=peer.title, missing=str(error))
            continue
        yield Row(
            1, what, f"{short(float(np.median(mine)))} M steps/s",
            f"{peer.title} {short(float(np.median(theirs)))} M steps/s", mine / theirs,
        )  # fmt: skip
