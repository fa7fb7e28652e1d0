"""The level of landmarks: the joints at which the qualitative level touches the metric one (paper, section 4.1.1).

S states, L landmarks, E arcs.  An arc leads from a landmark to another one of the same region.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class LandmarkLevel:
    """Landmarks by name, the states that count as being at them, and the arcs between them."""

    names: tuple[str, ...]
    """(L,)"""
    landmark_of: NDArray[np.int32]
    """(S,) landmark of each state, -1 for none."""
    regions: tuple[tuple[int, ...], ...]
    """(L,) the regions each landmark lies in or joins."""
    arc_start: NDArray[np.int64]
    """(L + 1,) arcs of landmark l are arc_start[l] .. arc_start[l + 1]."""
    arc_target: NDArray[np.int32]
    """(E,)"""

    @property
    def arcs(self) -> list[tuple[str, str]]:
        """(E,) names of both ends of each arc."""
        source = np.repeat(np.arange(len(self.names)), np.diff(self.arc_start))
        return [(self.names[a], self.names[b]) for a, b in zip(source, self.arc_target, strict=True)]


def landmark_level(
    names: Sequence[str], landmark_of: NDArray[np.int32], regions: Sequence[Sequence[int]]
) -> LandmarkLevel:
    """The level with an arc for every two landmarks that share a region."""
    members: dict[int, list[int]] = {}
    for mark, joined in enumerate(regions):
        for region in joined:
            members.setdefault(region, []).append(mark)
    start, targets = [0], list[int]()
    for mark, joined in enumerate(regions):
        near = sorted({other for region in joined for other in members[region]} - {mark})
        targets.extend(near)
        start.append(len(targets))
    return LandmarkLevel(
        tuple(names),
        landmark_of,
        tuple(tuple(joined) for joined in regions),
        np.array(start, np.int64),
        np.array(targets, np.int32),
    )
