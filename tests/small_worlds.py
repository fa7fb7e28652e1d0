"""Small tables for the tests of semi-MDPs, and exact linear algebra that shares no code with the project."""

from fractions import Fraction

import numpy as np
from hypothesis import strategies as st

from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP


def two_corridors(gamma: float, stay: float, lengths: tuple[int, int] = (3, 6)) -> HybridMDP:
    """A hub with a short and a long corridor to the goal; every step succeeds with probability 1 - stay."""
    ways, n = [], 1
    for length in lengths:
        ways.append(list(range(n, n + length)))
        n += length
    goal = n
    after = {way[i]: [*way[1:], goal][i] for way in ways for i in range(len(way))}

    def row(here: int, there: int) -> list[tuple[float, int, float, bool]]:
        reward = 100.0 if there == goal else -1.0
        return [(1 - stay, there, reward, there == goal), (stay, here, -1.0, False)]

    outcomes = {0: {action: row(0, way[0]) for action, way in enumerate(ways)}}
    for here, there in after.items():
        outcomes[here] = {0: row(here, there), 1: row(here, there)}
    outcomes[goal] = {0: [(1.0, goal, 0.0, True)], 1: [(1.0, goal, 0.0, True)]}
    table = TabularMDP.from_outcomes(dict(sorted(outcomes.items())), gamma, ["short", "long"])
    names = ["hub", *["short corridor"] * lengths[0], *["long corridor"] * lengths[1], "end"]
    return HybridMDP.from_table(table, names, start=0)


def two_doors(gamma: float, far: int = 5, near: int = 2) -> HybridMDP:
    """A corridor to the goal that is entered ``far`` steps (from A) or ``near`` steps (from C) before its end."""
    goal = far + 2
    outcomes = {cell: {0: [(1.0, cell + 1, -1.0, False)]} for cell in range(far)}
    outcomes[far - 1] = {0: [(1.0, goal, 100.0, True)]}
    outcomes[far] = {0: [(1.0, 0, -1.0, False)]}
    outcomes[far + 1] = {0: [(1.0, far - near, -1.0, False)]}
    outcomes[goal] = {0: [(1.0, goal, 0.0, True)]}
    table = TabularMDP.from_outcomes(outcomes, gamma, ["go"])
    return HybridMDP.from_table(table, [*["corridor"] * far, "room A", "room C", "end"])


@st.composite
def tables(draw, most_states: int = 8):
    """Random hybrid MDPs without a map: any outcomes, any regions, the last state the goal."""
    n, n_actions = draw(st.integers(2, most_states)), draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    gamma = draw(st.sampled_from([0.0, 0.5, 0.9, 0.99]))
    outcomes = {}
    for s in range(n):
        outcomes[s] = {}
        for a in range(n_actions):
            targets = rng.choice(n, size=rng.integers(1, min(3, n) + 1), replace=False)
            p = rng.dirichlet(np.ones(len(targets)))
            rewards = rng.normal(size=len(targets)).round(2)
            outcomes[s][a] = [
                (float(q), int(t), float(r), bool(t == n - 1)) for q, t, r in zip(p, targets, rewards, strict=True)
            ]
    table = TabularMDP.from_outcomes(outcomes, gamma)
    names = [f"region {i}" for i in rng.integers(0, draw(st.integers(1, 3)), size=n)]
    return HybridMDP.from_table(table, names)


def solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Gauss elimination in exact fractions."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for i in range(len(rows)):
        pivot = next(r for r in range(i, len(rows)) if rows[r][i] != 0)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in range(len(rows)):
            if r != i:
                rows[r] = [a - rows[r][i] * b for a, b in zip(rows[r], rows[i], strict=True)]
    return [row[-1] for row in rows]
