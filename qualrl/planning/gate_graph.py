"""The search over doorways: which regions a way has to be looked for in, and how long it is at most.

N gates (doorways as seen from one side), K gates of a region.

Why a way found so is at most 3 % longer than the shortest
----------------------------------------------------------
A first search, through the middles of doorways, finds a real way; say it takes U steps.  Two more, from either end,
find for each doorway how long a way through it is at least: there a walk through a region counts as the least from
any cell of the one doorway to any of the other.  Every doorway by which some way might take less than U / 1.03 is
kept, with the regions on both its sides, and so are the regions of the first way.  The shortest way over the cells of
the regions kept, of P steps, is the answer.  P <= U, since the first way is one of those.  A way that leaves the
regions kept takes at least U / 1.03, and therefore at least P / 1.03; one that does not takes at least P.  For the
shortest way of all, what might take less than U is kept.

One thing no way needs: to go through a doorway and back by it at once, where the cells on the first side are a row or
a staircase.  Between any two of these the straight steps lead over that side and are not more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels import routing

LONGER = 3
"""By how many hundredths a way may be longer than the shortest."""

Ints = NDArray[np.int32]


def too_long(known: int, exact: bool) -> int:
    """A way has to take fewer steps than this to be looked for beside a known one."""
    return -(-100 * known // (100 + (0 if exact else LONGER)))


@dataclass(frozen=True, eq=False)
class GateGraph:
    """All that a search over the doorways of a map needs."""

    gates: routing.Gates
    boxes: Ints
    """(4, N), see ``gates.boxes_of``."""
    steps: Ints
    """From the middle of each gate to those of all gates of its region; see ``routing.Gates.row``."""
    least: Ints
    """From any cell of each gate to any of each of these.  From a gate to itself: 0, or -1 where no way needs that."""

    def on_the_way(
        self, start: routing.End, goal: routing.End, most: int, exact: bool
    ) -> tuple[NDArray[np.bool_], int]:
        """(R,) the regions to look for a way in, and how many steps it takes at most.

        most: steps of a way that is known already.  exact: for the shortest way, not for one at most 3 % longer.
        """
        wanted, most = routing.on_the_way(
            self.gates, self.boxes, self.steps, self.least, start, goal, most, 0 if exact else LONGER
        )
        return wanted, int(most)
