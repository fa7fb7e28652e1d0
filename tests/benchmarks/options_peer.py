"""Q-learning over options beside SimpleOptions, per move of the world: same world, options and settings.

    python -m tests.benchmarks --only 2

An option goes to a landmark of the region that one is in; "and moves" offers single moves beside them.  SimpleOptions
can keep a log of every step ("logging", as it comes) or only its reward ("log off"); ours keeps the steps and return
of every episode.  Besides learning when an option ends, as ours does, it looks for other options that agree.
"""

import time
from collections.abc import Iterator

import numpy as np

import qualrl
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.landmark_ways import LandmarkWays
from tests.benchmarks.against_c import ALPHA, EPSILON, LEAST_EPISODE, REPEATED, puzzle
from tests.benchmarks.effort import Effort
from tests.benchmarks.peers import SIMPLE_OPTIONS, PeerError
from tests.benchmarks.table import Row, at_least, short
from tests.benchmarks.worlds_for_peers import maze_data, option_moves

STEPS = 200_000
TARGET = at_least(500)


def speed(model: qualrl.HybridMDP, moves_too: bool, steps: int, seed: int) -> float:
    """Million steps a second of option-q: the median of some runs, as one takes but milliseconds."""
    settings = LearnSettings(episodes=steps // LEAST_EPISODE, alpha=ALPHA, epsilon=EPSILON, primitives=moves_too)
    found = []
    for _ in range(REPEATED):
        learner = start_learner(model, "option-q", settings, seed)
        begun = time.thread_time()
        learner.advance(steps)
        found.append(steps / (time.thread_time() - begun) / 1e6)
    return float(np.median(found))


def rows(effort: Effort) -> Iterator[Row]:
    """Target 2's rows beside SimpleOptions."""
    model, rounds = puzzle(), effort.rounds(3, 1)
    ways = LandmarkWays.of(model)
    data = maze_data(model, ALPHA, EPSILON) | {"move": option_moves(ways, len(model)), "steps": STEPS, "rounds": rounds}
    speed(model, False, 1000, 0)  # compile
    for moves_too, logs in ((False, False), (False, True), (True, False), (True, True)):
        what = f"option-q, options{' and moves' * moves_too}, {STEPS:,} steps"
        title = f"{SIMPLE_OPTIONS.title}, {'logging' if logs else 'log off'},"
        mine = np.array([speed(model, moves_too, STEPS, seed) for seed in range(rounds)])
        try:
            found = effort.environments.run(
                SIMPLE_OPTIONS, data | {"single": ways.stuck | moves_too, "logs": logs}
            )["speeds"]  # fmt: skip
        except PeerError as error:
            yield Row(2, what, beside=title, target=TARGET, missing=str(error))
            continue
        theirs = np.array(found) / 1e6
        yield Row(
            2, what, f"{short(float(np.median(mine)))} M steps/s",
            f"{title} {short(float(np.median(theirs)))}", mine / theirs, TARGET,
        )  # fmt: skip
