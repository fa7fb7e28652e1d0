"""Steps per second of the compiled loop, beside the textbook loop of tests/oracles.py in the same process.

    python -m tests.benchmarks.learning_speed

CPU seconds of one thread; the rounds of the learners alternate, so that a machine that slows down slows all.
"""

import time

import numpy as np

import qualrl
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from tests import oracles
from tests.worlds import PUZZLE, grid_of

ROUNDS = 9


def compiled_speed(model: qualrl.HybridMDP, algorithm: str, episodes: int, seed: int) -> float:
    """Million steps a second of one run."""
    begun = time.thread_time()
    run = train(model, algorithm, LearnSettings(episodes=episodes, alpha=0.01, epsilon=0.01), seed)
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
    for algorithm in ("q-learning", "hql"):
        compiled_speed(model, algorithm, 10, 0)  # compile
    speeds: dict[str, list[float]] = {"textbook": [], "q-learning": [], "hql": []}
    for seed in range(ROUNDS):
        speeds["textbook"].append(textbook_speed(model, seed))
        for algorithm in ("q-learning", "hql"):
            speeds[algorithm].append(compiled_speed(model, algorithm, 40_000, seed))
    base = np.array(speeds["textbook"])
    print(f"{'13 x 13 puzzle':16s}{'million steps/s: median (least to most)':>42s}{'times the textbook loop':>26s}")
    for name, values in speeds.items():
        spread = f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"
        print(f"{name:16s}{spread:>42s}{np.median(np.array(values) / base):26.0f}")


if __name__ == "__main__":
    main()
