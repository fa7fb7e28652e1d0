"""Algebraic closure of a network of qualitative relations.

N things, B base relations.  A relation is a whole number with a bit for each base relation that is possible.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled

Relations = NDArray[np.int32]


@compiled
def close(network: Any, after: Any, converse: Any) -> bool:
    """Cut a network (N, N) down to what every third thing leaves possible; False, and it is spoilt, when nothing is.

    after (B, 2**B): what can follow a base relation and then a relation; converse (2**B,).
    """
    things = len(network)
    for a in range(things):
        for b in range(things):
            if network[a, b] == 0:
                return False
    # A pair is looked at again when it has changed since it was last in the middle of a triple.
    is_new = np.ones((things, things), np.bool_)
    waits = True
    while waits:
        waits = False
        for a in range(things):
            for b in range(things):
                if not is_new[a, b]:
                    continue
                is_new[a, b] = False
                first = network[a, b]
                for c in range(things):
                    possible, bit = np.int32(0), 0
                    left = first
                    while left:
                        if left & 1:
                            possible |= after[bit, network[b, c]]
                        left >>= 1
                        bit += 1
                    kept = network[a, c] & possible
                    if kept != network[a, c]:
                        if kept == 0:
                            return False
                        network[a, c], network[c, a] = kept, converse[kept]
                        is_new[a, c] = is_new[c, a] = waits = True
    return True
