"""The learning curve: steps of every episode, their moving mean, and the optimum."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from qualrl.learning.run import LearningRun

WINDOW = 50


def draw_learning_curve(run: LearningRun, file: Path) -> None:
    """Write the curve as PNG, in the axes of the paper's Figure 7 but with steps on a logarithmic scale."""
    figure = Figure(figsize=(9, 5), dpi=120, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    episodes = np.arange(1, len(run.steps) + 1)
    axes.plot(episodes, run.steps, color="#9ecae1", linewidth=0.8, label="each episode")
    window = min(WINDOW, len(run.steps))
    mean = np.convolve(run.steps, np.full(window, 1 / window), "valid")
    axes.plot(episodes[window - 1 :], mean, color="#08519c", linewidth=2, label=f"mean of {window}")
    if run.optimal_steps is not None:
        axes.axhline(run.optimal_steps, color="#e31a1c", linestyle="--", label=f"optimum: {run.optimal_steps} steps")
    for number, event in enumerate(run.changes):
        axes.axvline(event.after, color="#636363", linestyle=":", label="a change" if number == 0 else None)
    axes.set(xlabel="episode", ylabel="steps", yscale="log", title=f"{run.algorithm}, seed {run.seed}")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    figure.savefig(file, metadata={"Software": None})
