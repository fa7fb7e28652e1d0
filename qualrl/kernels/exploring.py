"""Where hql-replay looks for something new: the nearest action tried too seldom, where a way to the goal may pass.

S states, A actions.  It is looked for as long as the best that it could bring beats what is known.
"""

from typing import Any

from numba import int64, uint64

from qualrl.kernels.experience import likeliest
from qualrl.kernels.jit import compiled_inline, compiled_part
from qualrl.kernels.replay import CAME_BY, CAME_FROM, CLOCK, NEEDED, PATH_LEFT, PATIENCE, RETRY_AT, STAMP
from qualrl.kernels.stepping import below, is_end

MOST_PATIENCE = 64
NEVER = 2**60


@compiled_inline
def asked_for(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, value: Any, s: Any, by_chance: Any, u: Any,
    n_actions: Any,
) -> Any:  # fmt: skip
    """The action that exploring asks for in state s, or -1 for the best one known; ``by_chance``: any other way."""
    notes = levels.notes
    notes[CLOCK] += 1
    left = notes[PATH_LEFT]
    if by_chance or (left > 0 and uint64(levels.path[left - 1]) // uint64(n_actions) != s):
        notes[PATH_LEFT] = 0  # a slip, or chance, led off the path
    if by_chance:
        return -1
    wanted = -1
    if notes[PATH_LEFT] == 0:
        if levels.relevant[levels.region_of[s]] and levels.promise > value[s]:
            wanted = untried(seen.tries, notes[NEEDED], s, u, n_actions)
        if wanted < 0 and notes[CLOCK] >= notes[RETRY_AT]:
            wanted = _look_further(grid, slip, table, seen, levels, gamma, value, s, u, n_actions)
    if notes[PATH_LEFT] > 0:
        notes[PATH_LEFT] -= 1
        wanted = int64(uint64(levels.path[notes[PATH_LEFT]]) % uint64(n_actions))
    return wanted


@compiled_inline
def note_move(levels: Any, s: Any, a: Any, s2: Any, n_actions: Any) -> Any:
    """Remember how the robot came, and which action undid which."""
    notes = levels.notes
    if s2 == uint64(notes[CAME_FROM]) and s2 != s:
        levels.undoes[uint64(notes[CAME_BY]) * uint64(n_actions) + a] += 1
    notes[CAME_FROM], notes[CAME_BY] = s, a


@compiled_part
def _look_further(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, value: Any, s: Any, u: Any, n_actions: Any
) -> Any:
    """Look for a path to something worth trying; where there is none, the action to take meanwhile, or -1."""
    notes = levels.notes
    notes[PATH_LEFT], looked = _search(grid, slip, table, seen, levels, gamma, value, s, n_actions)
    if notes[PATH_LEFT] > 0:
        return -1
    if value[s] <= 0:
        return _way_back(levels.undoes, seen.tries, notes[NEEDED], s, uint64(notes[CAME_BY]), u, n_actions)
    patience = 2 * notes[PATIENCE]
    notes[PATIENCE] = patience if patience < MOST_PATIENCE else MOST_PATIENCE
    # So looking in vain costs next to nothing; but not always after as many steps, or it might be at one state alone.
    notes[RETRY_AT] = notes[CLOCK] + notes[PATIENCE] * looked + int64(below(u, uint64(notes[PATIENCE])))
    return -1


@compiled_part
def untried(tries: Any, needed: Any, s: Any, u: Any, n_actions: Any) -> Any:
    """An action of a state that was tried too seldom, each as likely; -1 if there is none."""
    row = s * uint64(n_actions)
    n = 0
    for a in range(n_actions):
        if tries[row + uint64(a)] < needed:
            n += 1
    if n == 0:
        return -1
    skip = int64(below(u, uint64(n)))
    for a in range(n_actions):
        if tries[row + uint64(a)] < needed:
            if skip == 0:
                return a
            skip -= 1
    return -1


@compiled_part
def _way_back(undoes: Any, tries: Any, needed: Any, s: Any, came_by: Any, u: Any, n_actions: Any) -> Any:
    """The action that most often undid the one by which the robot came, if it was tried too seldom here; else any."""
    first = came_by * uint64(n_actions)
    back = uint64(0)
    for b in range(1, n_actions):
        if undoes[first + uint64(b)] > undoes[first + back]:
            back = uint64(b)
    if undoes[first + back] > 0 and tries[s * uint64(n_actions) + back] < needed:
        return int64(back)
    return untried(tries, needed, s, u, n_actions)


@compiled_part
def _search(
    grid: Any, slip: Any, table: Any, seen: Any, levels: Any, gamma: Any, value: Any, s: Any, n_actions: Any
) -> Any:
    """Look, breadth first over moves that were seen, for the nearest state with something worth trying.

    Writes the way there into ``levels.path``; returns (its length, how many states were looked at).  The length
    is 0 where nothing found could beat what is known.  Where nothing is known, anything untried will do: in the same
    region what was passed by first, for a robot that strayed there finds out again where it came in.
    """
    notes = levels.notes
    needed = notes[NEEDED]
    notes[STAMP] += 1
    levels.mark[s] = notes[STAMP]
    levels.queue[0] = s
    head, n, layer_end = 0, 1, 1
    gained, discount = 0.0, 1.0
    anything, first_seen = s, NEVER + NEVER
    while head < n:
        if head == layer_end:
            gained += discount * levels.best_step
            discount *= gamma
            layer_end = n
            if gained + discount * levels.promise <= value[s]:
                return 0, n
        x = uint64(levels.queue[head])
        head += 1
        if is_end(grid, table, x):
            continue  # nothing is ever tried there, and nothing to be
        if untried(seen.tries, needed, x, uint64(0), n_actions) >= 0:
            if levels.relevant[levels.region_of[x]] and levels.promise > value[x]:
                return _lay_path(levels, s, x, n_actions), n
            since = levels.since[x] if levels.since[x] > 0 else NEVER
            if levels.region_of[x] != levels.region_of[s]:
                since = NEVER + NEVER - 1
            if since < first_seen:
                anything, first_seen = x, since
        for a in range(n_actions):
            row = x * uint64(n_actions) + uint64(a)
            if seen.tries[row] > 0:
                y = likeliest(grid, slip, table, seen, row, uint64(a), n_actions)
                if levels.mark[y] != notes[STAMP]:
                    levels.mark[y] = notes[STAMP]
                    levels.parent[y] = row
                    levels.queue[n] = y
                    n += 1
    return (_lay_path(levels, s, anything, n_actions) if value[s] <= 0 else 0), n


@compiled_part
def _lay_path(levels: Any, s: Any, found: Any, n_actions: Any) -> Any:
    """Write down the rows that lead to a state found, the first one last; returns how many."""
    n = 0
    while found != s:
        row = uint64(levels.parent[found])
        levels.path[n] = row
        n += 1
        found = row // uint64(n_actions)
    return n
