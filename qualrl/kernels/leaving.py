"""Where the best way out of a region leads, for all states at once.

S states, A moves.  A walk is a state and a move; what follows depends on both, since among moves that are equally
good it keeps to the last one.  ``memo`` (S * A,) holds what is known of such pairs already.
"""

from typing import Any

import numpy as np

from qualrl.kernels.bellman import grid_backup
from qualrl.kernels.jit import compiled

GOAL_HERE, NO_WAY, ASTRAY, UNKNOWN = -1, -2, -3, -4


@compiled
def best_moves(
    successor: Any, reward: Any, goal: Any, goal_value: Any, gamma: Any, slip: Any, value: Any, dislike: Any
) -> Any:
    """(S,) uint8: bit a is set where move a is as good as any (to 1e-12) and leads to a state disliked least."""
    moves = np.zeros(value.size, np.uint8)
    q = np.empty(successor.shape[1])
    for s in range(value.size):
        best = grid_backup(successor, reward, goal, goal_value, gamma, slip, value, s, q)
        limit = best - 1e-12 * abs(best)
        least = np.int32(2**31 - 1)
        for a in range(q.size):
            if q[a] >= limit:
                least = min(least, dislike[successor[s, a]])
        for a in range(q.size):
            if q[a] >= limit and dislike[successor[s, a]] == least:
                moves[s] |= np.uint8(1 << a)
    return moves


@compiled
def next_move(moves: Any, s: Any, last: Any) -> Any:
    """The move that a walk makes in a state: the last one again if that is good, else the first good one."""
    if last >= 0 and (moves[s] >> last) & 1:
        return last
    a = 0
    while not (moves[s] >> a) & 1:
        a += 1
    return a


@compiled
def comes_back(successor: Any, moves: Any, goal: Any, region_of: Any, s: Any, a: Any, longest: Any) -> Any:
    """Whether a step over a border is but an excursion: (state, move) where the walk is back, or (-1, -1).

    It is one when the walk comes back by the region it went to, at most ``longest`` states outside.
    """
    home, other = region_of[s], region_of[successor[s, a]]
    for _ in range(longest + 1):
        last = s
        s = np.int64(successor[s, a])
        if region_of[s] == home:
            if region_of[last] != other:
                break
            return s, (np.int64(-1) if s == goal else np.int64(next_move(moves, s, a)))
        if s == goal:
            break
        a = next_move(moves, s, a)
    return np.int64(-1), np.int64(-1)


@compiled
def exit_of(
    successor: Any, moves: Any, goal: Any, region_of: Any, door_of: Any, memo: Any, s: Any, a: Any, longest: Any
) -> Any:
    """The exit of a state and a move, from that of what follows, which ``memo`` knows."""
    n_actions = successor.shape[1]
    t = np.int64(successor[s, a])
    b = np.int64(-1) if t == goal else np.int64(next_move(moves, t, a))
    if region_of[t] != region_of[s]:
        t, b = comes_back(successor, moves, goal, region_of, s, a, longest)
        if t < 0:
            return door_of[s * n_actions + a]
    if t == goal:
        return np.int32(GOAL_HERE)
    return memo[t * n_actions + b]


@compiled
def leave_by(
    successor: Any, moves: Any, value: Any, goal: Any, region_of: Any, door_of: Any, starts: Any, longest: Any,
    found: Any,
) -> Any:  # fmt: skip
    """Follow the walk from each of the starts to the goal; write to found (S,) the doorway by which it first leaves.

    moves (S,): see ``best_moves``; door_of (S * A,) doorway of each step that changes region; longest: most states of
    an excursion over a border.  GOAL_HERE where the walk ends in its region, ASTRAY where it comes back to a state.
    Where values rise no walk comes back, so what is known of where it leads is used again; after a step that does not
    rise nothing is known beforehand, and nothing that holds for this walk only is kept.
    """
    n, n_actions = successor.shape
    memo = np.full(n * n_actions, UNKNOWN, np.int32)
    seen = np.full(n, -1, np.int64)
    path = np.empty(n, np.int64)
    for start in starts:
        s, a, length, rising_from, astray = np.int64(start), np.int64(-1), 0, 0, False
        while s != goal:
            a = np.int64(next_move(moves, s, a))
            if seen[s] == start:
                astray = True
                break
            if rising_from == 0 and memo[s * n_actions + a] != UNKNOWN:
                break
            seen[s], path[length] = start, s * n_actions + a
            length += 1
            t = np.int64(successor[s, a])
            if t != goal and not value[t] > value[s]:
                rising_from = length
            s = t
        if astray:
            found[start] = ASTRAY
            continue
        found[start] = GOAL_HERE if length == 0 and s == goal else memo[s * n_actions + a]
        for k in range(length - 1, -1, -1):
            s, a = path[k] // n_actions, path[k] % n_actions
            found[start] = exit_of(successor, moves, goal, region_of, door_of, memo, s, a, longest)
            memo[path[k]] = found[start]
        for k in range(rising_from):
            memo[path[k]] = UNKNOWN
