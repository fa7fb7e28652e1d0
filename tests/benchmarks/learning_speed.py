"""Steps per second of every learner's compiled loop, beside the textbook loop of tests/oracles.py in the same process.

    python -m tests.benchmarks.learning_speed

CPU seconds of one thread; the rounds of the learners alternate, so that a machine that slows down slows all.
"""

import time

import numpy as np

import qualrl
from qualrl.learning.rules import RULES
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from tests import oracles
from tests.worlds import PUZZLE, grid_of

ROUNDS = 7
EPISODES = {"q-learning": 40_000, "dyna-q": 4_000, "maxq-q": 40_000}
"""Episodes of a round where they are not 15 000: about as long a round each."""


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


def main() -> None:
    """Print the table."""
    model = qualrl.build(qualrl.segment(grid_of(PUZZLE)), [6, 6], start=[11, 1], gamma=0.9)
    for algorithm in RULES:
        compiled_speed(model, algorithm, 10, 0)  # compile
    speeds: dict[str, list[float]] = {name: [] for name in ("textbook", *RULES)}
    for seed in range(ROUNDS):
        speeds["textbook"].append(textbook_speed(model, seed))
        for algorithm in RULES:
            speeds[algorithm].append(compiled_speed(model, algorithm, EPISODES.get(algorithm, 15_000), seed))
    flat = np.array(speeds["q-learning"])
    print(f"{'13 x 13 puzzle':22s}{'million steps/s: median (least to most)':>42s}{'times Q-learning':>18s}")
    for name, values in speeds.items():
        spread = f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"
        print(f"{name:22s}{spread:>42s}{np.median(np.array(values) / flat):18.3f}")


if __name__ == "__main__":
    main()
