"""What every compiled learning loop is made of: a random stream, a choice, and one step of a world.

S states, A actions, E table entries.  ``q`` is flat: Q(s, a) is q[s * A + a].
Randomness is xoshiro256++ (Blackman and Vigna 2021) kept in local variables: one stream per seed.
What a world does not have is passed as None; numba compiles a loop anew for each such combination and
drops the branches, so nothing is decided a hundred million times.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int64, uint64
from numpy.typing import NDArray

from qualrl.kernels.jit import compiled_inline, compiled_part

Floats = NDArray[np.float64]

# Slots of Progress.whole and Progress.real that every loop has; a loop's own come after them
STATE, STEPS, EPISODE, OWN_WHOLE = range(4)
RETURN, OWN_REAL = range(2)
SLOTS = 16

# How alpha_k is tabulated: k below EXACT has an entry of its own, later ones grow by 1/1024
EXACT = 65536
LOG_STEP = np.log1p(1 / 1024)


class Grid(NamedTuple):
    """A grid world without matrices."""

    next_row: NDArray[np.uint32]
    """(S * A,) A times the state that each move leads to, which is where its values begin; a blocked one leads back."""
    step_reward: Floats
    """(A,) reward of a move that does not reach the goal."""
    goal: int
    goal_reward: float


class Table(NamedTuple):
    """A tabular MDP in compressed rows: row s * A + a holds entries row_start[row]..row_start[row + 1]."""

    row_start: NDArray[np.int64]
    target: NDArray[np.uint32]
    cumulative: Floats
    """(E,) probabilities summed up within each row."""
    reward: Floats
    """(E,) reward of each transition."""
    terminal: NDArray[np.bool_]


class Rates(NamedTuple):
    """Numbers of the learning rule."""

    alpha: float
    gamma: float
    epsilon: float
    max_steps: int


class Visits(NamedTuple):
    """A learning rate that changes with how often a row was visited."""

    counts: NDArray[np.uint32]
    """(rows,) updated."""
    rate: Floats
    """alpha_k, as ``learning.schedule`` tabulates it; a single number for a constant."""


class Progress(NamedTuple):
    """Where a run stands; read and written by each call."""

    stream: NDArray[np.uint64]
    """(4,) state of the random stream."""
    whole: NDArray[np.int64]
    real: Floats
    steps: NDArray[np.int64]
    """(episodes,) steps of each finished episode."""
    returns: Floats
    """(episodes,) undiscounted sum of rewards of each finished episode."""


@compiled_part
def rate_at(rate: Any, k: Any) -> Any:
    """alpha_k of a table; see ``learning.schedule`` for its spacing."""
    if rate.size == 1:
        return rate[0]
    if k < EXACT:
        return rate[k]
    at = EXACT + int(np.log(k / EXACT) / LOG_STEP)
    return rate[at if at < rate.size else rate.size - 1]


@compiled_part
def next_rate(visits: Any, row: Any) -> Any:
    """The learning rate of a row, whose visit is counted."""
    k = visits.counts[row]
    visits.counts[row] = k + 1
    return rate_at(visits.rate, k)


@compiled_part
def draw(r0: Any, r1: Any, r2: Any, r3: Any) -> Any:
    """64 random bits and the next state of the stream."""
    w = r0 + r3
    u = ((w << uint64(23)) | (w >> uint64(41))) + r0
    t = r1 << uint64(17)
    r2 ^= r0
    r3 ^= r1
    r1 ^= r2
    r0 ^= r3
    r2 ^= t
    return u, r0, r1, r2, (r3 << uint64(45)) | (r3 >> uint64(19))


@compiled_part
def below(u: Any, n: Any) -> Any:
    """A whole number below n from the low 32 bits of a draw; both are unsigned, so that it is compiled only once."""
    return ((u & uint64(0xFFFFFFFF)) * n) >> uint64(32)


@compiled_part
def unit(u: Any) -> Any:
    """A float in [0, 1) from the high 53 bits of a draw."""
    return (u >> uint64(11)) * (1.0 / 9007199254740992.0)


@compiled_part
def largest(q: Any, row: Any, n_actions: Any) -> Any:
    """The largest of the A values from ``row`` on: two chains side by side, for the next step waits for it."""
    best = q[row]
    other = q[row + uint64(n_actions - 1)]
    for a in range(1, n_actions - 1):
        value = q[row + uint64(a)]
        if a % 2 == 0:
            if value > best:
                best = value
        elif value > other:
            other = value
    return other if other > best else best


@compiled_part
def greedy(q: Any, row: Any, n_actions: Any, u: Any) -> Any:
    """The best action; ties are broken evenly by the draw u."""
    best = q[row]
    chosen = uint64(0)
    ties = 1
    for a in range(1, n_actions):
        value = q[row + uint64(a)]
        if value > best:
            best = value
            chosen = uint64(a)
            ties = 1
        elif value == best:
            ties += 1
    if ties == 1:
        return chosen
    skip = int64(below(u, uint64(ties)))
    chosen = uint64(0)
    while True:
        if q[row + chosen] == best:
            if skip == 0:
                break
            skip -= 1
        chosen += uint64(1)
    return chosen


@compiled_part
def slipped(a: Any, slip: Any, n_actions: Any, u: Any) -> Any:
    """The move that happens: a, or with probability slip one of the others, each as likely."""
    x = unit(u)
    if x >= slip:
        return a
    other = uint64(x / slip * (n_actions - 1))
    if other > uint64(n_actions - 2):
        other = uint64(n_actions - 2)
    return (a + uint64(1) + other) % uint64(n_actions)


@compiled_part
def entry_of(table: Any, row: Any, u: Any) -> Any:
    """The table entry of a row that a draw falls on."""
    x = unit(u)
    entry = table.row_start[row]
    last = table.row_start[row + uint64(1)] - 1
    while entry < last and x >= table.cumulative[entry]:
        entry += 1
    return entry


@compiled_part
def happened(
    grid: Any, slip: Any, table: Any, s: Any, a: Any, n_actions: Any, r0: Any, r1: Any, r2: Any, r3: Any
) -> Any:
    """One step of the world: (next state, A times it, whether the episode is over, reward, the outcome's number, the
    stream).

    grid: Grid, or None when table: Table is given.  slip: float, or None for moves that never fail.
    Outcomes are numbered over all rows: row * A + move where moves slip, the entry in a table, else the row.
    """
    row = s * uint64(n_actions)
    if grid is not None:  # not "else" below: only what is compared with None is left out
        moved = a
        outcome = row + a
        if slip is not None:
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            moved = slipped(a, slip, n_actions, u)
            outcome = (row + a) * uint64(n_actions) + moved
        row2 = uint64(grid.next_row[row + moved])
        s2 = row2 // uint64(n_actions)
        over = row2 == uint64(grid.goal) * uint64(n_actions)
        reward = grid.goal_reward if over else grid.step_reward[moved]
    if table is not None:
        u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        outcome = uint64(entry_of(table, row + a, u))
        s2 = uint64(table.target[outcome])
        row2 = s2 * uint64(n_actions)
        over = table.terminal[s2]
        reward = table.reward[outcome]
    return s2, row2, over, reward, outcome, r0, r1, r2, r3


@compiled_part
def moved_on(
    grid: Any, slip: Any, table: Any, s: Any, a: Any, n_actions: Any, r0: Any, r1: Any, r2: Any, r3: Any
) -> Any:
    """One step of the world: (next state, whether the episode is over, reward, the stream)."""
    s2, _, over, reward, _, r0, r1, r2, r3 = happened(grid, slip, table, s, a, n_actions, r0, r1, r2, r3)
    return s2, over, reward, r0, r1, r2, r3


@compiled_part
def is_end(grid: Any, table: Any, s: Any) -> Any:
    """Whether an episode ends in a state."""
    if grid is not None:
        ends = s == uint64(grid.goal)
    if table is not None:
        ends = table.terminal[s]
    return ends


@compiled_part
def started(starts: Any, r0: Any, r1: Any, r2: Any, r3: Any) -> Any:
    """Where an episode starts: (state, the stream).  No draw where there is but one."""
    s = uint64(starts[0])
    if starts.size > 1:
        u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
        s = uint64(starts[below(u, uint64(starts.size))])
    return s, r0, r1, r2, r3


@compiled_inline
def resumed(progress: Any) -> Any:
    """Where a run stands: (the stream, state, step of the episode, number of the episode, its return so far)."""
    stream, whole = progress.stream, progress.whole
    return (
        stream[0], stream[1], stream[2], stream[3], whole[STATE], whole[STEPS], whole[EPISODE], progress.real[RETURN]
    )  # fmt: skip


@compiled_inline
def ended(progress: Any, t: Any, episode: Any, total: Any) -> Any:
    """Write an episode down.  Returns the step and the number that the next one begins with."""
    progress.steps[episode] = t
    progress.returns[episode] = total
    return 0, episode + 1


@compiled_inline
def left_off(progress: Any, r0: Any, r1: Any, r2: Any, r3: Any, s: Any, t: Any, episode: Any, total: Any) -> Any:
    """Write down where a run stands, for ``resumed``."""
    progress.stream[0], progress.stream[1], progress.stream[2], progress.stream[3] = r0, r1, r2, r3
    progress.whole[STATE], progress.whole[STEPS], progress.whole[EPISODE] = s, t, episode
    progress.real[RETURN] = total
