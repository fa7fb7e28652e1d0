"""What is measured of a run: when it has converged, and how it walks before and after.

The paper gives no criterion of convergence.  Here a run has converged after the last episode at which the mean
steps of WINDOW episodes were above ``most_steps``.
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qualrl.learning.run import LearningRun

Measure = Literal[
    "converged", "converges", "steps_until", "mean_before", "mean_after", "sd_after", "last_steps", "greedy_steps",
    "optimal", "env_steps", "cpu_seconds", "arrives", "path_ratio", "mean_value", "mean_return",
]  # fmt: skip
MEASURES: tuple[Measure, ...] = get_args(Measure)[:9]
"""Of runs that are given episodes; those of runs on a budget of steps follow from ``converges`` on."""
UNTIL_CONVERGED: tuple[Measure, ...] = (
    "converged", "steps_until", "mean_before", "mean_after", "sd_after", "env_steps", "cpu_seconds",
)  # fmt: skip
"""Those that say little of a run which did not converge."""
WORDS: dict[Measure, str] = {
    "converged": "episodes until convergence",
    "converges": "converged within the run (1 or 0)",
    "steps_until": "steps of all episodes until convergence",
    "mean_before": "mean steps an episode before convergence",
    "mean_after": "mean steps an episode after convergence",
    "sd_after": "standard deviation of the steps after convergence",
    "last_steps": "median steps of the last 100 episodes",
    "greedy_steps": "steps of the greedy policy at the end",
    "optimal": "greedy policy at the end is optimal (1 or 0)",
    "env_steps": "environment steps until the greedy policy is good and stays so",
    "cpu_seconds": "processor seconds of learning until then",
    "arrives": "greedy path at the end reaches the goal (1 or 0)",
    "path_ratio": "greedy path at the end / shortest path",
    "mean_value": "mean discounted value of the greedy policy at the end over all starts",
    "mean_return": "the same without discount",
}
WINDOW = 50
SLACK = 36 / 32
"""How much longer than the optimum a converged walk may be, at epsilon 0.01."""
LAST = 100
LEAST_TAIL = 50
"""Fewer episodes after convergence say nothing of what comes after."""

Floats = NDArray[np.float64]


def most_steps(optimum: int, epsilon: float) -> float:
    """The most mean steps of a converged learner: 36 for the puzzle's optimum of 32 at epsilon 0.01.

    In a corridor an exploring move goes on and back equally often, so that the optimal policy takes
    optimum / (1 - epsilon) steps; the bound grows alike, or at epsilon 0.1 no learner could keep it.
    """
    return round(optimum * SLACK * (1 - 0.01) / (1 - epsilon), 9)


def episodes_until_converged(steps: NDArray[np.int64], most: float, window: int = WINDOW) -> int:
    """The last episode at which the mean steps of ``window`` episodes were above ``most``; all if that is the last."""
    if len(steps) < window:
        return len(steps)
    means = np.convolve(steps, np.full(window, 1 / window), "valid")
    late = np.flatnonzero(means > most + 1e-9)
    return int(late[-1]) + window if len(late) else 0


def measured(run: LearningRun, optimum: int) -> dict[Measure, float]:
    """All measures of a run; NaN where there is nothing to measure."""
    most = most_steps(optimum, run.settings.epsilon)
    converged = episodes_until_converged(run.steps, most)
    before, after = run.steps[:converged], run.steps[converged:]
    settled = len(after) >= LEAST_TAIL
    greedy = run.greedy_steps
    return {
        "converged": float(converged),
        "converges": float(converged < len(run.steps)),
        "steps_until": float(before.sum()),
        "mean_before": float(before.mean()) if len(before) else float("nan"),
        "mean_after": float(after.mean()) if settled else float("nan"),
        "sd_after": float(after.std()) if settled else float("nan"),
        "last_steps": float(np.median(run.steps[-LAST:])),
        "greedy_steps": float("nan") if greedy is None else float(greedy),
        "optimal": float(greedy == optimum),
    }


def thinned(steps: NDArray[np.int64], points: int) -> Floats:
    """Means of up to ``points`` equal stretches of a curve; the last one may be shorter."""
    size = stretch(len(steps), points)
    starts = np.arange(0, len(steps), size)
    sums = np.add.reduceat(steps.astype(np.float64), starts)
    return np.asarray(sums / np.diff(np.append(starts, len(steps))), np.float64)


def stretch(episodes: int, points: int) -> int:
    """Episodes to a point of a thinned curve."""
    return -(-episodes // points)
