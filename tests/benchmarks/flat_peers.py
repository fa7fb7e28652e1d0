"""Q-learning beside the tabular Q-learners of other libraries: same world, settings and number of steps.  JAX, which
has no learner of its own, runs one for many agents at once; ours learns for as many, one after the other.

    python -m tests.benchmarks --only 1

CPU seconds; the world is a table of lists in a peer's own interface, so that hardly anything but its learner counts.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

import qualrl
from tests.benchmarks.against_c import ALPHA, EPSILON, ours, puzzle, usual_speed
from tests.benchmarks.effort import Effort
from tests.benchmarks.peers import JAX, MUSHROOM, OPEN_SPIEL, RLBERRY, Peer, PeerError
from tests.benchmarks.table import Row, short
from tests.benchmarks.worlds_for_peers import maze_data

STEPS = 200_000
AGENTS, STEPS_EACH = 1024, 2000


def rows(effort: Effort) -> Iterator[Row]:
    """Target 1's rows beside peers, for which it sets no ratio."""
    model, rounds = puzzle(), effort.rounds(3, 1)
    data = maze_data(model, ALPHA, EPSILON) | {"rounds": rounds}
    ours(model, 1000, 0)  # compile
    for peer in (OPEN_SPIEL, RLBERRY, MUSHROOM):
        mine = [usual_speed(model, STEPS, seed) for seed in range(rounds)]
        yield beside(peer, f"Q-learning, 13 x 13 puzzle, {STEPS:,} steps", mine, effort, data | {"steps": STEPS})
    mine = [for_agents(model, seed) for seed in range(rounds)]
    agents = {"agents": AGENTS, "steps_each": STEPS_EACH}
    yield beside(JAX, f"Q-learning, {AGENTS} times {STEPS_EACH:,} steps", mine, effort, data | agents)


def beside(peer: Peer, what: str, mine: Sequence[float], effort: Effort, data: Mapping[str, Any]) -> Row:
    """A row; mine: our million steps a second in each round."""
    try:
        theirs = np.array(effort.environments.run(peer, data)["speeds"]) / 1e6
    except PeerError as error:
        return Row(1, what, beside=peer.title, missing=str(error))
    return Row(
        1, what, f"{short(float(np.median(mine)))} M steps/s",
        f"{peer.title} {short(float(np.median(theirs)))} M steps/s", np.array(mine) / theirs,
    )  # fmt: skip


def for_agents(model: qualrl.HybridMDP, seed: int) -> float:
    """Our million steps a second over many agents."""
    speeds = [ours(model, STEPS_EACH, AGENTS * seed + agent).speed for agent in range(AGENTS)]
    return AGENTS / sum(1 / speed for speed in speeds)
