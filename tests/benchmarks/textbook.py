"""Q-learning's compiled loop beside the loop that tutorials show, for the same number of steps.

    python -m tests.benchmarks.textbook

Of actions that are as good, ours takes any, each as likely, and so does the textbook loop; one that takes the first of
them, which numpy does in less time, stands beside it.  CPU seconds of one thread; rounds alternate.
"""

import time
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import qualrl
from tests.benchmarks.against_c import ALPHA, EPSILON, ours, puzzle, usual_speed
from tests.benchmarks.effort import Effort
from tests.benchmarks.table import Row, at_least, short, spread

ROUNDS = 5
STEPS = 200_000


class Maze(gymnasium.Env[Any, Any]):
    """A grid world as Gymnasium has it."""

    def __init__(self, model: qualrl.HybridMDP) -> None:
        self.observation_space = gymnasium.spaces.Discrete(len(model))
        self.action_space = gymnasium.spaces.Discrete(4)
        self.model, self.state = model, model.start or 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Back to the start."""
        super().reset(seed=seed)
        self.state = self.model.start or 0
        return self.state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """One move."""
        grid = self.model.grid
        self.state = int(grid.successor[self.state, action])
        over = self.state == grid.goal
        return self.state, grid.goal_reward if over else grid.step_reward, over, False, {}


def gymnasium_speed(model: qualrl.HybridMDP, seed: int, breaks_ties: bool = True) -> float:
    """Million steps a second of the loop that tutorials show: a numpy table and Gymnasium's interface."""
    world, generator = Maze(model), np.random.default_rng(seed)
    q = np.zeros((len(model), 4))
    begun = time.thread_time()
    state, _ = world.reset(seed=seed)
    for _ in range(STEPS):
        if generator.random() < EPSILON:
            action = int(generator.integers(4))
        elif breaks_ties:
            action = int(generator.choice(np.flatnonzero(q[state] == q[state].max())))
        else:
            action = int(np.argmax(q[state]))
        after, reward, over, _, _ = world.step(action)
        target = reward + model.grid.gamma * (0.0 if over else q[after].max())
        q[state, action] += ALPHA * (target - q[state, action])
        state = world.reset()[0] if over else after
    return STEPS / (time.thread_time() - begun) / 1e6


def measured(rounds: int) -> NDArray[np.float64]:
    """(rounds, 3) million steps a second: ours, the textbook loop's, and the same that takes the first best action."""
    model = puzzle()
    ours(model, 1000, 0)  # compile
    return np.array([
        (usual_speed(model, STEPS, seed), gymnasium_speed(model, seed), gymnasium_speed(model, seed, False))
        for seed in range(rounds)
    ])  # fmt: skip


def rows(effort: Effort) -> Iterator[Row]:
    """Target 1's rows beside the textbook loop; the target is that of the loop which does the same."""
    found = measured(effort.rounds(ROUNDS, 2))
    mine, *theirs = np.median(found, axis=0)
    for column, title in enumerate(("numpy over Gymnasium", "the same with np.argmax"), 1):
        yield Row(
            1, f"Q-learning, 13 x 13 puzzle, {STEPS:,} steps", f"{short(mine)} M steps/s",
            f"{title} {short(theirs[column - 1])}", found[:, 0] / found[:, column],
            at_least(1000) if column == 1 else None,
        )  # fmt: skip


def main() -> None:
    """Print how many times as long the textbook loop takes."""
    found = measured(ROUNDS)
    print(f"the textbook loop over Gymnasium: {spread(found[:, 0] / found[:, 1])} times as long")
    print(f"the same with np.argmax: {spread(found[:, 0] / found[:, 2])} times as long")


if __name__ == "__main__":
    main()
