"""What a learner keeps when its qualitative level is found anew: values that belong to places still there.

S states, L landmarks, E arcs, R regions.  Values of states and actions are not touched: states keep their numbers.
"""

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import replay
from qualrl.kernels.learning import Upper
from qualrl.models.landmarks import LandmarkLevel


def same_landmarks(now: LandmarkLevel, before: LandmarkLevel) -> NDArray[np.int64]:
    """(L,) number that each landmark had before: that of the landmark at exactly the same states, or -1."""
    known = {cells: mark for mark, cells in enumerate(_cells(before)) if cells}
    return np.array([known.get(cells, -1) for cells in _cells(now)], np.int64)


def _cells(level: LandmarkLevel) -> list[bytes]:
    """The states of each landmark, as something to compare by."""
    at = np.flatnonzero(level.landmark_of >= 0)
    at = at[np.argsort(level.landmark_of[at], kind="stable")]
    ends = np.cumsum(np.bincount(level.landmark_of[at], minlength=len(level.names)))
    return [part.tobytes() for part in np.split(at, ends[:-1])] if len(level.names) else []


def upper_anew(upper: Upper, now: LandmarkLevel, kept: NDArray[np.int64], n_actions: int) -> Upper:
    """The level of landmarks as it is now; arcs between two landmarks that were kept go on with their values.

    kept (L,): see ``same_landmarks``.
    """
    source = np.repeat(np.arange(len(now.names)), np.diff(now.arc_start))
    sources_before = np.repeat(np.arange(len(upper.arc_start) - 1), np.diff(upper.arc_start))
    arcs = {ends: arc for arc, ends in enumerate(zip(sources_before.tolist(), upper.arc_target.tolist(), strict=True))}
    was = [arcs.get((int(kept[a]), int(kept[b])), -1) for a, b in zip(source, now.arc_target, strict=True)]
    arc = np.array(was, np.int64)
    pairs = np.append(upper.pair_count, np.zeros(n_actions, np.int64)).reshape(-1, n_actions)
    return upper._replace(
        landmark_of=now.landmark_of, arc_start=now.arc_start, arc_target=now.arc_target,
        arc_q=np.append(upper.arc_q, 0.0)[arc], arc_visits=np.append(upper.arc_visits, 0)[arc],
        pair_count=pairs[kept].ravel(),
    )  # fmt: skip


def regions_anew(
    levels: replay.Levels, region_of: NDArray[np.int32], landmark_of: NDArray[np.int32], relevant: NDArray[np.bool_],
    change: NDArray[np.float64],
) -> replay.Levels:  # fmt: skip
    """The regions as they are now; states that wait for a replay wait on in the region they are in now.

    relevant (R,) regions; change (S,) by how much each state's value is to change.
    """
    n_regions = len(relevant)
    ring_start = np.zeros(n_regions + 1, np.int64)
    np.cumsum(np.bincount(region_of, minlength=n_regions), out=ring_start[1:])
    waiting = np.flatnonzero(levels.waits)
    waiting = waiting[np.argsort(region_of[waiting], kind="stable")]
    length = np.bincount(region_of[waiting], minlength=n_regions)
    nth = np.arange(len(waiting)) - np.repeat(np.cumsum(length) - length, length)
    ring, due = np.zeros(len(region_of), np.uint32), np.zeros(n_regions)
    ring[ring_start[region_of[waiting]] + nth] = waiting
    np.maximum.at(due, region_of[waiting], change[waiting])
    return levels._replace(
        region_of=region_of, landmark_of=landmark_of, relevant=relevant, ring=ring, ring_start=ring_start,
        head=np.zeros(n_regions, np.int64), length=length.astype(np.int64), due=due,
    )  # fmt: skip
