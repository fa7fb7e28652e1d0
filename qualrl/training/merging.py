"""Train the trees that tell which zones of a map are one place, on floor plans generated here and on nothing else.

    python -m qualrl.training.merging --out merging.npz

Each plan is cut into zones, and zones are merged as the trees so far would do it, the likeliest pair first, but only
where the truth agrees: so the trees meet pairs as they look on the way to the right answer.  Each pair met is a
sample.  Rounds after the first one add the samples that the trees of the round before lead to.

Trees of plain plans and trees of crowded ones are averaged, which does better than trees of both: where the two do
not agree, the mean says that little is known.
"""

import argparse
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import merging as kernels
from qualrl.kernels.trees import Questions, questions_of
from qualrl.spatial.floor_plans import FloorPlan, random_floor_plan
from qualrl.spatial.merging import ZoneGraph, unpacked, zone_graph_of
from qualrl.spatial.occupancy_grid import OccupancyGrid
from qualrl.spatial.view import look

FIRST_SEED = 1_000_000
"""Tests use smaller seeds."""
BAGS = 4
"""So many sets of trees of each kind of plan are averaged."""
ROUGH_TREES, ROUGH_RATE = 120, 0.1
"""Trees by which the next round's zones are merged, and their rate."""
SAMPLES = 30_000
"""At most so many of a plan are kept."""
NOISY, COARSER = 0.2, 0.25
"""Shares of the plans with noise in single cells, and with cells twice as large."""
FURNITURE_M = 0.35
"""As ``segment`` looks past it."""
LEAST_ODDS = -1.0
"""Pairs that are one place are merged from these odds on."""

Samples = NDArray[np.float32]
Stored = dict[str, NDArray[Any]]


def samples_of(seed: int, stored: Stored, crowded: bool) -> Samples:
    """(N, F + 2) what is met on one plan: features, whether the two are one place, the smaller area."""
    plan = random_floor_plan(seed, crowded=crowded)
    grid, place = varied(plan, np.random.default_rng([seed, 1]))
    view = look(grid.free, grid.resolution_m, FURNITURE_M)
    graph, _ = zone_graph_of(view, grid.occupied, lambda: None)
    return samples_on(graph, truth_of(graph, view.of_grid(place, -1)), questions_of(unpacked(stored)))


def varied(plan: FloorPlan, rng: np.random.Generator) -> tuple[OccupancyGrid, NDArray[np.int32]]:
    """The map of a plan and the place of each cell: some coarser, some with noise in single cells."""
    free, occupied, cell_m = plan.grid.free, plan.grid.occupied, plan.grid.resolution_m
    if rng.random() < NOISY:
        flipped = rng.random(free.shape) < rng.uniform(0.002, 0.015)
        salt = flipped & (rng.random(free.shape) < 0.5)
        free, occupied = (free & ~flipped) | salt, (occupied & ~flipped) | (flipped & ~salt)
    step = 2 if rng.random() < COARSER else 1
    free, occupied = free[::step, ::step], occupied[::step, ::step]
    return OccupancyGrid(free, occupied, cell_m * step), plan.place[::step, ::step]


def samples_on(graph: ZoneGraph, truth: NDArray[np.int32], questions: Questions) -> Samples:
    """The samples on one graph whose zones have known places (Z,); the graph is used up."""
    samples = kernels.Samples(truth, np.zeros((SAMPLES, len(kernels.FEATURES) + 2)), np.zeros(1, np.int64))
    every = np.arange(len(graph.places.parent))
    kernels.merge(graph.places, graph.bonds, every, questions, graph.about, LEAST_ODDS, 0.0, samples)
    return samples.found[: samples.size[0]].astype(np.float32)


def truth_of(graph: ZoneGraph, place: NDArray[np.int32]) -> NDArray[np.int32]:
    """(Z,) the place (h, w) that has most of each zone, -1 where most of it lies in none."""
    inside = graph.zone >= 0
    count, places = len(graph.places.parent), int(place.max()) + 2
    shares = np.bincount(graph.zone[inside] * places + place[inside] + 1, minlength=count * places).astype(np.float64)
    table = shares.reshape(count, places)
    table[:, 0] *= 0.5
    return np.asarray(table.argmax(axis=1) - 1, np.int32)


def trained(samples: Samples, trees: int, rate: float = 0.08, seed: int = 0) -> Stored:
    """Boosted trees fitted to samples, as arrays; rate: how much of what is left each explains.

    Pairs of large places weigh more.  The seed chooses the samples that set the bounds of bins.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    count = len(kernels.FEATURES)
    weight = np.sqrt(np.minimum(samples[:, count + 1], 20)) + 0.05
    model = HistGradientBoostingClassifier(
        max_iter=trees, learning_rate=rate, max_leaf_nodes=24, l2_regularization=1.0, min_samples_leaf=80,
        early_stopping=False, random_state=seed,
    )  # fmt: skip
    model.fit(samples[:, :count], samples[:, count] > 0, sample_weight=weight)
    return packed([tree[0].nodes for tree in model._predictors], float(model._baseline_prediction[0, 0]))


def packed(trees: Iterable[Any], start: float) -> Stored:
    """The nodes of scikit-learn's trees as arrays, one tree after the other."""
    nodes = list(trees)
    root = np.cumsum([0] + [len(tree) for tree in nodes], dtype=np.int64)[:-1]
    names = ("is_leaf", "feature_idx", "left", "right", "num_threshold", "value")
    whole = {name: np.concatenate([tree[name] for tree in nodes] or [np.zeros(0)]) for name in names}
    shift = root.repeat([len(tree) for tree in nodes])
    leaf = np.asarray(whole["is_leaf"], bool)
    return {
        "root": root.astype(np.int32),
        "feature": np.where(leaf, -1, whole["feature_idx"]).astype(np.int8),
        "left": np.where(leaf, 0, whole["left"] + shift).astype(np.int32),
        "right": np.where(leaf, 0, whole["right"] + shift).astype(np.int32),
        "threshold": np.where(leaf, 0.0, whole["num_threshold"]).astype(np.float32),
        "leaf": np.where(leaf, whole["value"], 0.0).astype(np.float32),
        "start": np.array(start),
    }


def averaged(parts: Sequence[Stored]) -> Stored:
    """All trees in one, so that their sum is the mean of the parts' sums."""
    shift = np.cumsum([0] + [len(part["feature"]) for part in parts])
    moved = [
        part | {name: part[name] + by for name in ("root", "left", "right")} | {"leaf": part["leaf"] / len(parts)}
        for part, by in zip(parts, shift, strict=False)
    ]
    whole = {name: np.concatenate([part[name] for part in moved]) for name in parts[0] if name != "start"}
    whole |= {name: whole[name].astype(parts[0][name].dtype) for name in whole}
    return whole | {"start": np.array(np.mean([part["start"] for part in parts]))}


def train(plans: int, trees: int, jobs: int) -> Stored:
    """Trees trained on so many plans of each kind, plain and crowded: BAGS times for each, on half of its plans."""
    bags = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for crowded in (False, True):
            stored = packed([], 0.0)
            met: list[Samples] = []
            for count in (max(plans // 8, 1), max(plans // 3, 1), plans):
                if met:
                    stored = trained(np.concatenate(met), ROUGH_TREES, ROUGH_RATE)
                seeds = range(FIRST_SEED + len(met), FIRST_SEED + len(met) + count)
                met += pool.map(partial(samples_of, stored=stored, crowded=crowded), seeds, chunksize=8)
                print(f"crowded: {crowded}, {count} plans, {sum(map(len, met))} samples in all", flush=True)
            for bag in range(BAGS):
                chosen = np.random.default_rng(bag).choice(len(met), max(len(met) // 2, 1), replace=False)
                bags.append(trained(np.concatenate([met[plan] for plan in chosen]), trees, seed=bag))
    return averaged(bags)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plans", type=int, default=800)
    parser.add_argument("--trees", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("merging.npz"))
    chosen = parser.parse_args()
    np.savez_compressed(chosen.out, allow_pickle=False, **train(chosen.plans, chosen.trees, chosen.jobs))


if __name__ == "__main__":
    main()
