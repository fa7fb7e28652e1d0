"""What replay by regions gains: the puzzle without and with slip, and the office, beside the strongest flat learners.

    python -m tests.benchmarks.better_hql             everything (about 10 minutes)
    python -m tests.benchmarks.better_hql plain slip  parts of it: plain, slip, office

Steps are steps of the environment.  "For good" means: at every later check until the run's end, which is printed.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

import qualrl
from qualrl.kernels import stepping
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.hybrid_mdp import HybridMDP
from tests.worlds import PUZZLE, grid_of

SEEDS = 30
NEVER = np.inf
LANDMARKS = {
    "S0": [11, 1], "S1": [1, 1], "S2": [1, 11], "S3": [11, 11], "S4": [9, 9], "S5": [9, 3], "S6": [3, 3],
    "S7": [3, 9], "S8": [2, 6], "S9": [8, 6],
}  # fmt: skip
FORMULA = "1/(1+k)**0.7"


def puzzle(slip: float = 0.0) -> HybridMDP:
    """The paper's puzzle with its landmarks and natural regions."""
    regions = qualrl.segment(grid_of(PUZZLE))
    return qualrl.build(regions, [6, 6], start=[11, 1], gamma=0.9, slip=slip, landmarks=LANDMARKS)


def greedy_steps(model: HybridMDP, q: np.ndarray) -> float:
    """Steps of the greedy path from the start when no move slips."""
    assert model.start is not None
    onward = model.grid.successor[np.arange(len(model)), q.argmax(axis=1)].tolist()
    state, steps, goal = model.start, 0, model.grid.goal
    while state != goal and steps <= len(model):
        state, steps = onward[state], steps + 1
    return steps if state == goal else NEVER


def expected_steps(model: HybridMDP, q: np.ndarray) -> float:
    """Expected steps of the greedy policy from the start to the goal, by one linear solve."""
    world, n = model.grid, len(model)
    matrix, here, best = np.eye(n), np.arange(n), q.argmax(axis=1)
    for move in range(world.n_actions):
        share = np.where(best == move, 1 - world.slip, world.slip / (world.n_actions - 1))
        np.add.at(matrix, (here, world.successor[:, move]), -share)
    matrix[world.goal] = 0.0
    matrix[world.goal, world.goal] = 1.0
    ones = np.ones(n)
    ones[world.goal] = 0.0
    found = float(np.linalg.solve(matrix, ones)[model.start])
    return found if found > 0 else NEVER


def least_expected_steps(model: HybridMDP) -> float:
    """The best that a policy can do in expectation."""
    world = model.grid
    value = np.zeros(len(model))
    for _ in range(20_000):
        onward = value[world.successor]
        others = world.slip / (world.n_actions - 1)
        cost = 1 + (1 - world.slip - others) * onward + others * onward.sum(axis=1, keepdims=True)
        new = cost.min(axis=1)
        new[world.goal] = 0.0
        if np.abs(new - value).max() < 1e-12:
            break
        value = new
    return float(value[model.start])


def settled(steps: np.ndarray, window: int = 50, most: float = 36) -> float:
    """Episodes until the mean of ``window`` episodes is at most ``most``, for good."""
    means = np.convolve(steps, np.ones(window) / window, "valid")
    late = np.flatnonzero(means > most)
    if not len(late):
        return 0
    return float(late[-1]) + window if late[-1] < len(means) - 1 else NEVER


Good = Callable[[HybridMDP, np.ndarray], bool]


def run_until(
    model: HybridMDP, algorithm: str, chosen: LearnSettings, seed: int, every: int, most: int, good: Good
) -> tuple[float, float, np.ndarray]:
    """(steps until the policy is good for good, CPU seconds of learning until then, steps of the finished episodes)."""
    learner = start_learner(model, algorithm, chosen, seed)
    steps, spent, since, since_spent = 0, 0.0, NEVER, NEVER
    while steps < most:
        begun = time.thread_time()
        made = learner.advance(every)
        spent += time.thread_time() - begun
        steps += made
        if not good(model, learner.learned().q):
            since = since_spent = NEVER
        elif since == NEVER:
            since, since_spent = steps, spent
        if made < every:
            break
    return since, since_spent, learner.progress.steps[: int(learner.progress.whole[stepping.EPISODE])]


def interval(values: list[float]) -> str:
    """Median, and the 2.5th to 97.5th percentile over seeds."""
    low, middle, high = np.percentile(values, [2.5, 50, 97.5], method="nearest")
    never = sum(value == NEVER for value in values)
    return f"{middle:9.6g} ({low:.6g} to {high:.6g})" + (f", {never} never" if never else "")


def plain() -> None:
    """(a) and (b): the puzzle as it is."""
    model = puzzle()
    print(f"\npuzzle, {SEEDS} seeds, alpha 0.01, epsilon 0.01: median (95 % of seeds)")
    print(f"{'learner':22s}{'episodes until 36 on average':>36s}{'steps until 32 for good':>40s}   run, check, seconds")
    for algorithm, episodes, every in (
        ("q-learning", 5000, 50), ("hql", 4000, 50), ("q-lambda", 6000, 25), ("dyna-q", 6000, 25),
        ("prioritized-sweeping", 1000, 10), ("hql-replay", 1000, 10),
    ):  # fmt: skip
        chosen = LearnSettings(episodes=episodes, alpha=0.01, epsilon=0.01, eta_counter="episode")
        begun = time.perf_counter()
        runs = [
            run_until(model, algorithm, chosen, seed, every, 2**62, lambda m, q: greedy_steps(m, q) == 32)
            for seed in range(SEEDS)
        ]
        took = time.perf_counter() - begun
        waited = interval([settled(run[2]) for run in runs])
        print(
            f"{algorithm:22s}{waited:>36s}{interval([run[0] for run in runs]):>40s}   "
            f"{episodes} episodes, {every} steps, {took:.0f} s",
            flush=True,
        )


def slip() -> None:
    """(c): the puzzle with 20 % slip."""
    model, most, every = puzzle(0.2), 200_000, 50
    best = least_expected_steps(model)
    print(f"\npuzzle, 20 % slip, {SEEDS} seeds, {most} steps, checked every {every}; best expected steps {best:.2f}")
    print(f"{'learner':36s}{'steps until within 5 % for good':>50s}")
    rows: list[tuple[str, dict[str, float | str]]] = [
        ("hql-replay", {}), ("prioritized-sweeping", {}),
        *(("q-lambda", {"alpha": alpha}) for alpha in (0.01, 0.05, 0.1, 0.2, FORMULA)),
    ]  # fmt: skip
    for algorithm, changed in rows:
        chosen = LearnSettings(**{"episodes": 10_000_000, "alpha": 0.01, "epsilon": 0.01, **changed})  # type: ignore[arg-type]
        begun = time.perf_counter()
        waited = [
            run_until(model, algorithm, chosen, seed, every, most, lambda m, q: expected_steps(m, q) <= 1.05 * best)[0]
            for seed in range(SEEDS)
        ]
        name = algorithm + "".join(f" {key} {value}" for key, value in changed.items())
        print(f"{name:36s}{interval(waited):>50s}   {time.perf_counter() - begun:.0f} s", flush=True)


def office() -> None:
    """(d): the bundled office."""
    model = qualrl.load_scenario("maps/office.scenario.yaml").build()
    assert model.start is not None
    shortest = int(model.grid.steps_to_goal[model.start])
    print(f"\noffice, epsilon 0.02, up to 5 million steps, checked every 5000; the shortest path has {shortest} steps")
    print(f"{'learner':36s}{'steps until within 5 % for good':>44s}{'CPU seconds until then':>44s}")
    rows = [("hql-replay", 20, 10), *(("prioritized-sweeping", steps, 3) for steps in (5, 20, 50, 100))]
    for algorithm, planning_steps, seeds in rows:
        chosen = LearnSettings(episodes=10_000_000, epsilon=0.02, planning_steps=planning_steps)
        run_until(model, algorithm, chosen, 0, 1000, 1000, lambda m, q: False)  # compile
        most = 1_500_000 if algorithm == "hql-replay" else 5_000_000
        runs = [
            run_until(model, algorithm, chosen, seed, 5000, most, lambda m, q: greedy_steps(m, q) <= 1.05 * shortest)
            for seed in range(seeds)
        ]
        name = f"{algorithm}, {planning_steps} backups a step"
        print(
            f"{name:42s}{interval([run[0] for run in runs]):>38s}{interval([run[1] for run in runs]):>44s}", flush=True
        )


def main() -> None:
    """Print the tables asked for."""
    parts = {"plain": plain, "slip": slip, "office": office}
    for name in sys.argv[1:] or list(parts):
        parts[name]()


if __name__ == "__main__":
    main()
