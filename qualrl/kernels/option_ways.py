"""The shortest way of every option to its landmark within its region, counted from the landmark outward; compiled.

S states, A moves, O options, C kinds of states: see ``tasks``.
"""

from typing import Any

import numpy as np

from qualrl.kernels.jit import compiled_bare, compiled_part

NONE = 255
"""No move."""


def find_ways(
    likely: Any, sources: Any, source_start: Any, landmark: Any, terminal: Any, slot_start: Any, kind_of: Any,
    position: Any,
) -> Any:  # fmt: skip
    """(steps, move): for every state and option of it, how far its landmark is within the region, and the first move.

    likely (S, A): where each move leads most often.
    sources[source_start[l]..]: the states at landmark l.  slot_start (S + 1,): where the options of a state begin.
    steps int32 is 0 at the landmark and -1 where no way leads there; move uint8 is NONE for both.
    """
    steps = np.full(slot_start[-1], -1, np.int32)
    move = np.full(slot_start[-1], NONE, np.uint8)
    back_start, back = _backwards(likely)
    queue = np.empty(len(likely), np.int64)
    _write_ways(
        likely, back_start, back, sources, source_start, landmark, terminal, slot_start, kind_of, position, queue,
        steps, move,
    )  # fmt: skip
    return steps, move


@compiled_bare
def _write_ways(
    likely: Any,
    back_start: Any,
    back: Any,
    sources: Any,
    source_start: Any,
    landmark: Any,
    terminal: Any,
    slot_start: Any,
    kind_of: Any,
    position: Any,
    queue: Any,
    steps: Any,
    move: Any,
) -> None:
    """back[back_start[s]..]: the states with a move to s; queue (S,) is room to work in; the rest: ``find_ways``."""
    n_options = landmark.size
    for o in range(n_options):
        end = 0
        for i in range(source_start[landmark[o]], source_start[landmark[o] + 1]):
            s = sources[i]
            steps[slot_start[s] + position[kind_of[s] * n_options + o]] = 0
            queue[end] = s
            end += 1
        head = 0
        while head < end:
            t = queue[head]
            head += 1
            further = steps[slot_start[t] + position[kind_of[t] * n_options + o]] + 1
            for i in range(back_start[t], back_start[t + 1]):
                s = back[i]
                place = position[kind_of[s] * n_options + o]
                if place < 0 or terminal[s] or steps[slot_start[s] + place] >= 0:
                    continue
                steps[slot_start[s] + place] = further
                queue[end] = s
                end += 1
                a = 0
                while not _is_step_nearer(likely[s, a], further, steps, slot_start, kind_of, position, o, n_options):
                    a += 1
                move[slot_start[s] + place] = a


@compiled_part
def _is_step_nearer(
    t: Any, further: Any, steps: Any, slot_start: Any, kind_of: Any, position: Any, o: Any, n_options: Any
) -> Any:
    """Whether state t is one step nearer to the landmark of option o than ``further``."""
    place = position[kind_of[t] * n_options + o]
    return place >= 0 and steps[slot_start[t] + place] == further - 1


def _backwards(likely: Any) -> Any:
    """(back_start (S + 1,), back): for each state, those with a move that leads there most often."""
    start = np.zeros(len(likely) + 1, np.int64)
    np.cumsum(np.bincount(likely.ravel(), minlength=len(likely)), out=start[1:])
    back = np.empty(likely.size, np.int64)
    _write_back(likely, start[:-1].copy(), back)
    return start, back


@compiled_bare
def _write_back(likely: Any, filled: Any, back: Any) -> None:
    """Filled (S,): where the list of each state begins, and afterwards ends."""
    for s in range(likely.shape[0]):
        for a in range(likely.shape[1]):
            t = likely[s, a]
            back[filled[t]] = s
            filled[t] += 1
