"""Episodes until convergence on the paper's puzzle, for Q-learning and for each reading of HQL's landmark step.

    python -m tests.benchmarks.puzzle_episodes

Converged = the last episode after which the mean of 50 episodes stays at or below 36 steps (the optimum is 32).
Landmarks are the paper's ten cells and the goal.  30 seeds; median and the interval that holds 95 % of the seeds.
"""

import numpy as np

from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from tests.test_learning import episodes_until_converged, puzzle

SEEDS = range(30)
READINGS = (("q-learning", "run"), ("hql", "run"), ("hql", "pair"), ("hql", "episode"))


def main() -> None:
    """Print the table."""
    print(
        f"{'alpha':>6s} {'learner':12s}{'eta counter':>12s}{'episodes: median (95 % of 30 seeds)':>38s}{'x alpha':>9s}"
    )
    for alpha, episodes in ((0.01, 6000), (0.05, 2000), (0.2, 1500)):
        for algorithm, counter in READINGS:
            chosen = LearnSettings(episodes=episodes, alpha=alpha, epsilon=0.01, eta_counter=counter)
            found = [episodes_until_converged(train(puzzle(), algorithm, chosen, seed).steps) for seed in SEEDS]
            low, middle, high = np.percentile(found, [2.5, 50, 97.5])
            shown = counter if algorithm == "hql" else "-"
            spread = f"{middle:.0f} ({low:.0f} to {high:.0f})"
            print(f"{alpha:6.2f} {algorithm:12s}{shown:>12s}{spread:>38s}{middle * alpha:9.1f}")


if __name__ == "__main__":
    main()
