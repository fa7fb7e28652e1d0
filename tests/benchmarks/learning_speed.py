"""Steps per second of every learner's compiled loop, beside the textbook loop of tests/oracles.py in the same process.

    python -m tests.benchmarks.learning_speed

CPU seconds of one thread; the rounds of the learners alternate, so that a machine that slows down slows all.
"""

import time
from collections.abc import Iterator, Sequence

import numpy as np

import qualrl
from qualrl.learning.rules import RULES
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from tests import oracles
from tests.benchmarks.against_c import puzzle
from tests.benchmarks.effort import Effort
from tests.benchmarks.table import Row, at_least, short, spread

ROUNDS = 7
EPISODES = {"q-learning": 40_000, "dyna-q": 4_000, "maxq-q": 40_000}
"""Episodes of a round where they are not 15 000: about as long a round each."""
TARGETED = "hql", "hql-replay", "q-lambda", "sarsa", "option-q", "maxq-q", "hamq"
"""Those that are to be at least 0.3 times as fast as the flat loop."""


def compiled_speed(model: qualrl.HybridMDP, algorithm: str, episodes: int, seed: int) -> float:
    """Million steps a second of one run."""
    begun = time.thread_time()
    run = train(model, algorithm, LearnSettings(episodes=episodes, alpha=0.1, epsilon=0.01), seed)
    return run.total_steps / (time.thread_time() - begun) / 1e6


def textbook_speed(model: qualrl.HybridMDP, seed: int) -> float:
    """Million steps a second of the textbook loop."""
    successor = model.grid.successor.tolist()
    goal = model.grid.goal
    begun = time.thread_time()
    _, steps, _ = oracles.learn(
        lambda s, a, draws: (successor[s][a], 100.0 if successor[s][a] == goal else -1.0), lambda s: s == goal,
        [model.start], len(model), 4, gamma=0.9, alpha=0.01, epsilon=0.01, episodes=20, seed=seed,
    )  # fmt: skip
    return sum(steps) / (time.thread_time() - begun) / 1e6


def measured(learners: Sequence[str], rounds: int) -> dict[str, list[float]]:
    """Million steps a second of each learner ("textbook": that loop) in each round."""
    model = puzzle()
    for algorithm in RULES.keys() & learners:
        compiled_speed(model, algorithm, 10, 0)  # compile
    speeds: dict[str, list[float]] = {name: [] for name in learners}
    for seed in range(rounds):
        for name, found in speeds.items():
            if name == "textbook":
                found.append(textbook_speed(model, seed))
            else:
                found.append(compiled_speed(model, name, EPISODES.get(name, 15_000), seed))
    return speeds


def rows(effort: Effort) -> Iterator[Row]:
    """Target 2's rows beside the flat loop."""
    speeds = measured(("q-learning", *TARGETED), effort.rounds(ROUNDS, 4))
    flat = np.array(speeds.pop("q-learning"))
    for name, found in speeds.items():
        yield Row(
            2, f"{name}, 13 x 13 puzzle", f"{short(float(np.median(found)))} M steps/s",
            f"q-learning {short(float(np.median(flat)))} M steps/s", np.array(found) / flat, at_least(0.3),
        )  # fmt: skip


def main() -> None:
    """Print the table."""
    speeds = measured(("textbook", *RULES), ROUNDS)
    flat = np.array(speeds["q-learning"])
    print(f"{'13 x 13 puzzle':22s}{'million steps/s: median (least to most)':>42s}{'times Q-learning':>18s}")
    for name, values in speeds.items():
        print(f"{name:22s}{spread(values):>42s}{np.median(np.array(values) / flat):18.3f}")


if __name__ == "__main__":
    main()
