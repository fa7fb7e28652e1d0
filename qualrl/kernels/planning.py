"""The loop of the learners that plan with what they have seen: Dyna-Q, prioritized sweeping, and hql-replay.

S states, A actions, K outcomes.  Each is one of the parts passed as None or not (see ``stepping``):
``dyna`` replays outcomes drawn at random, ``heap`` sweeps states in the order of how much they may change,
``levels`` replays regions at qualitative transitions (see ``replay``) and steers exploration (see ``exploring``).
"""

from typing import Any

from numba import uint64

from qualrl.kernels.dyna import imagine, learn_dyna
from qualrl.kernels.experience import remember
from qualrl.kernels.exploring import asked_for, note_move
from qualrl.kernels.jit import compiled_bare
from qualrl.kernels.replay import take_in
from qualrl.kernels.stepping import OWN_WHOLE, below, draw, ended, greedy, happened, left_off, resumed, started
from qualrl.kernels.sweeping import learn_by_sweeping

TRIED, HEAPED = range(OWN_WHOLE, OWN_WHOLE + 2)


@compiled_bare
def run_planning(
    grid: Any,
    slip: Any,
    table: Any,
    seen: Any,
    dyna: Any,
    heap: Any,
    levels: Any,
    visits: Any,
    rates: Any,
    actions: Any,
    starts: Any,
    q: Any,
    value: Any,
    progress: Any,
    n_steps: Any,
) -> Any:
    """Run up to n_steps steps of the planner that is not None; see ``learning.run_steps`` for the rest."""
    n_actions = len(actions)
    gamma, max_steps = rates.gamma, rates.max_steps
    explored = uint64(rates.epsilon * 4294967296.0)
    r0, r1, r2, r3, at_first, t, episode, total = resumed(progress)
    whole = progress.whole
    s, tried, size = uint64(at_first), whole[TRIED], whole[HEAPED]
    episodes = progress.steps.size
    done = 0
    while done < n_steps and episode < episodes:
        if t == 0:
            s, r0, r1, r2, r3 = started(starts, r0, r1, r2, r3)
            total = 0.0
        row = s * uint64(n_actions)
        until, over = t + n_steps - done, False
        if until > max_steps:
            until = max_steps
        done -= t
        while not over and t < until:
            u, r0, r1, r2, r3 = draw(r0, r1, r2, r3)
            by_chance = (u >> uint64(32)) < explored
            a = below(u, uint64(n_actions))
            wanted = -1
            if levels is not None:
                wanted = asked_for(grid, slip, table, seen, levels, gamma, value, s, by_chance, u, n_actions)
            if not by_chance:
                a = uint64(wanted) if wanted >= 0 else greedy(q, row, n_actions, u)
            s2, row2, over, reward, outcome, r0, r1, r2, r3 = happened(
                grid, slip, table, s, a, n_actions, r0, r1, r2, r3
            )
            differs, changed = remember(grid, slip, table, seen, row + a, outcome, s2, n_actions)
            if dyna is not None:
                tried = learn_dyna(seen, dyna, visits, rates, q, tried, row + a, s2, over, reward, n_actions)
                r0, r1, r2, r3 = imagine(
                    grid, slip, table, seen, dyna, visits, rates, q, tried, n_actions, r0, r1, r2, r3
                )
            if heap is not None:
                size = learn_by_sweeping(grid, slip, table, seen, heap, gamma, q, value, size, s, row + a, a, n_actions)
            if levels is not None:
                note_move(levels, s, a, s2, n_actions)
                last = over or t + 1 >= max_steps
                take_in(grid, slip, table, seen, levels, gamma, q, value, s, a, s2, last, differs, changed, n_actions)
            total += reward
            t += 1
            s, row = s2, row2
        done += t
        if over or t >= max_steps:
            t, episode = ended(progress, t, episode, total)
    left_off(progress, r0, r1, r2, r3, s, t, episode, total)
    whole[TRIED], whole[HEAPED] = tried, size
    return done
