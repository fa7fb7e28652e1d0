"""Slow textbook twins: plain Python, sharing no code with what they check."""

import math
from collections.abc import Iterator
from fractions import Fraction

import networkx as nx
import numpy as np

MASK = 2**64 - 1
MOVES = {4: [(-1, 0), (1, 0), (0, -1), (0, 1)]}
MOVES[8] = [*MOVES[4], (-1, -1), (-1, 1), (1, -1), (1, 1)]


def xoshiro(seed: int) -> Iterator[int]:
    """xoshiro256++ seeded by splitmix64, after the authors' C code."""
    state = []
    for _ in range(4):
        seed = (seed + 0x9E3779B97F4A7C15) & MASK
        z = seed
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        state.append(z ^ (z >> 31))

    def rotate(x: int, k: int) -> int:
        return ((x << k) | (x >> (64 - k))) & MASK

    while True:
        yield (rotate((state[0] + state[3]) & MASK, 23) + state[0]) & MASK
        shifted = (state[1] << 17) & MASK
        state[2] ^= state[0]
        state[3] ^= state[1]
        state[1] ^= state[2]
        state[0] ^= state[3]
        state[2] ^= shifted
        state[3] = rotate(state[3], 45)


class GridTwin:
    """A grid world by dictionaries: cells as states, moves as pairs."""

    def __init__(self, free, goal, directions=4, slip=0.0, step=-1.0, prize=100.0):
        self.free = {(int(r), int(c)) for r, c in np.argwhere(free)}
        self.cells = sorted(self.free)
        self.goal, self.slip, self.prize, self.step = goal, slip, prize, step
        self.moves = MOVES[directions]

    def lands(self, cell, move):
        row, column = cell
        dr, dc = self.moves[move]
        corner_free = (row + dr, column) in self.free and (row, column + dc) in self.free
        to = (row + dr, column + dc)
        if to not in self.free or (dr and dc and not corner_free):
            return cell
        return to

    def outcomes(self, cell, action):
        """[(probability, cell, reward)] of an action."""
        found = []
        for move in range(len(self.moves)):
            p = 1 - self.slip if move == action else self.slip / (len(self.moves) - 1)
            to = self.lands(cell, move)
            found.append((p, to, self.prize if to == self.goal else self.step * math.hypot(*self.moves[move])))
        return found

    def graph(self):
        """The moves as a networkx digraph with lengths."""
        graph = nx.DiGraph()
        graph.add_nodes_from(self.cells)
        for cell in self.cells:
            for move, offset in enumerate(self.moves):
                to = self.lands(cell, move)
                if to != cell:
                    graph.add_edge(cell, to, length=math.hypot(*offset))
        return graph

    def values(self, gamma, sweeps=4000):
        """Jacobi value iteration from 0, a dictionary by cell."""
        value = dict.fromkeys(self.cells, 0.0)
        rows = {c: [self.outcomes(c, a) for a in range(len(self.moves))] for c in self.cells}
        for _ in range(sweeps):
            new = {
                c: 0.0 if c == self.goal else max(sum(p * (r + gamma * value[t]) for p, t, r in row) for row in rows[c])
                for c in self.cells
            }
            if max(abs(new[c] - value[c]) for c in self.cells) < 1e-13:
                break
            value = new
        return value


def exact_policy_values(twin, gamma, policy):
    """Values of a policy {cell: action} on a grid twin, by one exact linear solve."""
    index = {cell: i for i, cell in enumerate(twin.cells)}
    matrix, reward = np.eye(len(index)), np.zeros(len(index))
    for cell, i in index.items():
        if cell == twin.goal:
            continue
        for p, to, r in twin.outcomes(cell, policy[cell]):
            reward[i] += p * r
            if to != twin.goal:
                matrix[i, index[to]] -= p * gamma
    return dict(zip(twin.cells, np.linalg.solve(matrix, reward), strict=True))


def deterministic_value(steps, gamma, step=Fraction(-1), prize=Fraction(100)):
    """Exact value of a goal that many steps away: steps - 1 costs, then the prize."""
    gamma = Fraction(gamma)
    return sum((gamma**k * step for k in range(steps - 1)), Fraction(0)) + gamma ** (steps - 1) * prize


def learn(
    step,
    terminal,
    starts,
    n_states,
    n_actions,
    *,
    gamma,
    alpha,
    epsilon,
    episodes,
    seed,
    max_steps=None,
    landmarks=None,
    eta0=0.1,
    power=1.2,
    counter="run",
    upper_alpha=None,
    macro_return="departure",
    macro_discount="gamma_tau",
):
    """Algorithm 1 of the paper, and Algorithm 2 when ``landmarks`` = (landmark of each state, arcs by landmark).

    step(state, action, draws) -> (next state, reward).  Draws are used in the order: start (if there are several),
    choice, outcome.  alpha and upper_alpha are numbers, or functions of the number of earlier updates.
    Returns (q, steps, returns).
    """
    rate, arc_rate = (
        given if callable(given) else (lambda _, given=given: given)
        for given in (alpha, alpha if upper_alpha is None else upper_alpha)
    )
    updates, travels = {}, {}
    draws = xoshiro(seed)
    q = [[0.0] * n_actions for _ in range(n_states)]
    upper = {}
    counts = {}
    run_count = 0
    all_steps, all_returns = [], []
    for _ in range(episodes):
        s = starts[0] if len(starts) == 1 else starts[((next(draws) & 0xFFFFFFFF) * len(starts)) >> 32]
        at_landmark = landmarks[0][s] if landmarks else -1
        left = None
        if counter == "episode":
            run_count = 0
        t, total = 0, 0.0
        while True:
            u = next(draws)
            if (u >> 32) < int(epsilon * 2**32):
                a = ((u & 0xFFFFFFFF) * n_actions) >> 32
            else:
                best = [b for b in range(n_actions) if q[s][b] == max(q[s])]
                a = best[((u & 0xFFFFFFFF) * len(best)) >> 32] if len(best) > 1 else best[0]
            s2, reward = step(s, a, draws)
            over = terminal(s2)
            target = reward if over else reward + gamma * max(q[s2])
            q[s][a] += rate(updates.get((s, a), 0)) * (target - q[s][a])
            updates[s, a] = updates.get((s, a), 0) + 1
            t, total = t + 1, total + reward
            if landmarks:
                home = at_landmark >= 0 and landmarks[0][s] == at_landmark
                if home and (macro_return == "departure" or left is None):
                    left = {"at": s, "by": a, "gain": 0.0, "discount": 1.0}
                if left is not None:
                    left["gain"] += left["discount"] * reward
                    left["discount"] *= gamma
                here = landmarks[0][s2]
                if here >= 0 and here != at_landmark:
                    if at_landmark >= 0 and here in landmarks[1][at_landmark]:
                        onward = [v for (i, _), v in upper.items() if i == here]
                        macro = left["gain"]
                        if not over:
                            fades = left["discount"] if macro_discount == "gamma_tau" else gamma
                            macro += fades * (max(onward) if onward else 0.0)
                        arc = (at_landmark, here)
                        new = arc_rate(travels.get(arc, 0))
                        travels[arc] = travels.get(arc, 0) + 1
                        upper[arc] = upper.get(arc, 0.0) + new * (macro - upper.get(arc, 0.0))
                        pair = (at_landmark, left["by"])
                        n = counts.get(pair, 0) if counter == "pair" else run_count
                        counts[pair] = counts.get(pair, 0) + 1
                        run_count += 1
                        eta = eta0 ** math.prod([power] * n) if n < 400 else 0.0
                        old = q[left["at"]][left["by"]]
                        q[left["at"]][left["by"]] = old + eta * (upper[arc] - old)
                    at_landmark, left = here, None
            s = s2
            if over or (max_steps is not None and t >= max_steps):
                break
        all_steps.append(t)
        all_returns.append(total)
    return q, all_steps, all_returns
