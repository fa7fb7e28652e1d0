"""A walk over cells, cut into legs: one for each region it passes."""

from collections.abc import Sequence
from dataclasses import dataclass

from qualrl.models.hybrid_mdp import HybridMDP

EXCURSION_STEPS = 4
"""A visit to a neighbouring region shorter than this, and back, is no leg: borders are ragged."""


@dataclass(frozen=True)
class Leg:
    """The part of a walk that lies in one region: walk[first] .. walk[last]."""

    region: int
    first: int
    last: int


def legs_of(model: HybridMDP, walk: Sequence[int]) -> list[Leg]:
    """The legs of a walk, brief excursions over a border and back left out."""
    return legs_through(model.region_of[list(walk)].tolist())


def legs_through(regions: Sequence[int]) -> list[Leg]:
    """The same of a walk by the region that each of its places lies in."""
    runs: list[Leg] = []
    for index, region in enumerate(regions):
        if runs and runs[-1].region == region:
            runs[-1] = Leg(region, runs[-1].first, index)
        else:
            runs.append(Leg(region, index, index))
    return _without_excursions(runs)


def _without_excursions(runs: list[Leg]) -> list[Leg]:
    legs: list[Leg] = []
    for run in runs:
        if len(legs) > 1 and legs[-2].region == run.region and legs[-1].last - legs[-1].first < EXCURSION_STEPS - 1:
            legs.pop()
        if legs and legs[-1].region == run.region:
            legs[-1] = Leg(run.region, legs[-1].first, run.last)
        else:
            legs.append(run)
    return legs
