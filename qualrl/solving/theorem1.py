"""Theorem 1, audited: is a qualitative abstraction of this world really a semi-MDP with the same values?

The paper says that it is and skips the proof.  Entered by two doors, a region has two laws of tau for the same action,
so the region's name alone is a Markov state only where these happen to be equal.  Three abstractions are compared:
the part alone ("door-blind"), the part with the doorway it was entered by, and with the very state it was entered at,
which is exact always.

N macro states, P pairs.  Values are shifted inside (see ``kernels.bellman``), plain in all results.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.semi_mdp import SemiMDP
from qualrl.solving.fold import Fold, factorised, fold
from qualrl.solving.lumping import ALIKE, Lumping
from qualrl.solving.semi_mdp_values import SemiValues

KINDS = ("region", "wing", "floor")


@dataclass(frozen=True)
class Entry:
    """One qualitative action from one state by which its part is entered."""

    state: str
    door: str
    """The exit by which the part was entered."""
    discount: float
    """E[gamma^tau]."""
    mean_steps: float | None
    """E[tau]; None where the action may never end."""
    is_certain: bool
    """Whether tau is a certain number of steps."""
    reward: float
    """Expected r_1 + gamma r_2 + ... of the action."""
    worth: float
    """That, and the exact value of what follows."""
    value: float
    """Exact value of the state, of its best action."""


@dataclass(frozen=True)
class Counterexample:
    """Two entries of one group with different laws of the same action: no single state can stand for both."""

    group: str
    action: str
    first: Entry
    second: Entry
    value: float
    """Value of the group when all of its entries count alike."""
    least: float
    """No weighing of the entries, even a new one for every action, gives less."""
    greatest: float
    """Nor more."""

    @property
    def error(self) -> float:
        """How far the group's value is off at the worse of the two entries."""
        return max(abs(self.value - self.first.value), abs(self.value - self.second.value))


@dataclass(frozen=True)
class Abstraction:
    """How far the values of an abstraction are from the exact ones."""

    states: int
    laws_differ: int
    """Pairs of a state and an action whose law depends on how the state was entered."""
    pairs: int
    largest_error: float
    """Of a state's value, all entries counting alike, against the exact values of these entries."""
    where: str
    counterexample: Counterexample | None

    @property
    def holds(self) -> bool:
        """Whether the abstraction is exact."""
        return self.laws_differ == 0


@dataclass(frozen=True)
class Refined:
    """The abstraction to entry states against the flat MDP."""

    states: int
    pairs: int
    arcs: int
    flat_gap: float
    """Largest amount by which the flat optimum is better, over all macro states."""
    relative_gap: float
    where: str
    reaches_optimum: bool
    """Whether flat and SMDP optimum are equal (to 1e-9, relatively); under slip they need not be."""
    same_policy_difference: float
    """Largest difference to the value, in the flat chain, of the very policy that the SMDP chose."""
    residual: float
    """How far the values of all cells together are from solving the flat chain's equations: the difference to their
    exact solution is at most this over 1 - gamma."""
    scale: float
    """The size of values that differences are measured by: K of the shift, or the largest shifted value."""

    @property
    def holds(self) -> bool:
        """Whether the SMDP's values are those of the flat chain under the same policy."""
        return self.same_policy_difference <= ALIKE * self.scale and self.residual <= ALIKE * self.scale


@dataclass(frozen=True)
class Theorem1Audit:
    """What was found.  ``holds`` speaks of the door-blind abstraction, the one that the paper describes."""

    kind: str
    """What the parts are: "region", "wing" or "floor"."""
    parts: int
    gamma: float
    slip: float | None
    """None without a grid."""
    start: str | None
    start_values: tuple[float, float] | None
    """Of the start: flat optimum, refined SMDP."""
    blind: Abstraction
    by_door: Abstraction
    refined: Refined

    @property
    def holds(self) -> bool:
        """Whether Theorem 1 holds for the parts by name alone."""
        return self.blind.holds and self.refined.holds

    def to_dict(self) -> dict[str, Any]:
        """The audit as JSON."""
        found = asdict(self) | {"holds": self.holds}
        for name in ("blind", "by_door", "refined"):
            found[name]["holds"] = getattr(self, name).holds
        return found


def audit_theorem1(model: HybridMDP, level: int = 2, start: int | None = None) -> Theorem1Audit:
    """Audit a level of a model at its optimal policy: 2 = the regions, 3 = the wings, where the model has them.

    Raises SettingError for a level that there is not, NoPlanError when no way leads from the start to the goal.
    """
    if not 2 <= level <= len(model.levels) + 1:
        raise SettingError(f"this model has the qualitative levels 2 to {len(model.levels) + 1}, got {level}")
    folded = fold(model, model.levels[level - 2], start)
    values = folded.solve()
    start = model.start if start is None else start
    at = -1 if start is None else int(folded.ways.macro_of[start])
    shift = folded.exact.shift
    return Theorem1Audit(
        kind=KINDS[min(level, len(KINDS) + 1) - 2],
        parts=len(np.unique(folded.ways.part[:-1])),
        gamma=model.gamma,
        slip=model.grid.slip if model.regions is not None else None,
        start=None if start is None else model.describe(start),
        start_values=None if start is None else (float(folded.exact.value[start]), float(values.value[at] - shift)),
        blind=_compared(folded, values, blind_lumping(folded)),
        by_door=_compared(folded, values, door_lumping(folded)),
        refined=_refined(folded, values),
    )


def door_blind(folded: Fold) -> SemiMDP:
    """The semi-MDP over parts by name alone, all entries of a part counting alike: what the paper's Figure 3 draws."""
    return blind_lumping(folded).averaged()[0]


def blind_lumping(folded: Fold) -> Lumping:
    """Macro states lumped by part.  A start that is not an entry is left out, unless its part has no other."""
    part = folded.ways.part.copy()
    entered = np.unique(part[:-1][folded.ways.entry[:-1] >= 0])
    part[:-1][(folded.ways.entry[:-1] < 0) & np.isin(part[:-1], entered)] = -1
    names = folded.crossings.level.names
    return _lumping(folded, part, [names[p] for p in np.unique(part[:-1][part[:-1] >= 0]).tolist()])


def door_lumping(folded: Fold) -> Lumping:
    """Macro states lumped by part and doorway: the cells of a doorway count as one."""
    ways, exits = folded.ways, folded.crossings.exit_names
    key = ways.part * (len(exits) + 1) + ways.entry + 1
    key[-1] = -1
    names = []
    for value in np.unique(key[:-1]).tolist():
        part, door = divmod(value, len(exits) + 1)
        by = f"entered by {exits[door - 1]}" if door else "at the start"
        names.append(f"{folded.crossings.level.names[part]} {by}")
    return _lumping(folded, key, names)


def _lumping(folded: Fold, key: NDArray[np.int64], names: list[str]) -> Lumping:
    """Groups by key, -1 left out; the goal is the last group."""
    group = np.full(len(key), -1, np.int64)
    kept = np.flatnonzero(key[:-1] >= 0)
    group[kept] = np.unique(key[kept], return_inverse=True)[1].ravel()
    group[-1] = len(names)
    goal = folded.smdp.state_names[-1]
    return Lumping(folded.smdp, folded.shifted_reward, folded.exact.shift, group, (*names, goal))


def _compared(folded: Fold, values: SemiValues, lumping: Lumping) -> Abstraction:
    """An abstraction against the exact values of the macro states."""
    inside = np.flatnonzero(lumping.group[:-1] >= 0)
    lumped = lumping.values()
    error = np.abs(lumped[lumping.group[inside]] - values.value[inside])
    exact = lumping.is_exact()
    worst = int(inside[error.argmax()]) if len(inside) else -1
    return Abstraction(
        states=len(lumping.names) - 1,
        laws_differ=int((~exact).sum()),
        pairs=len(exact),
        largest_error=float(error.max(initial=0.0)),
        where=folded.smdp.state_names[worst],
        counterexample=None if exact.all() else _counterexample(folded, values, lumping, lumped, exact),
    )


def _counterexample(
    folded: Fold, values: SemiValues, lumping: Lumping, lumped: NDArray[np.float64], exact: NDArray[np.bool_]
) -> Counterexample:
    """The two entries of a group whose action is worth the most different.

    Entries by different doors are preferred, and of these such as do not turn back through the door they came by.
    """
    worth = folded.shifted_reward + folded.smdp.discounted @ values.value
    used, keys, entry = lumping.used, lumping.keys, folded.ways.entry
    found: tuple[int, float, int, int] | None = None
    for key in np.flatnonzero(~exact).tolist():
        pairs = used[keys == key]
        doors = entry[folded.smdp.source[pairs]]
        ends = {int(d): pairs[doors == d][[worth[pairs[doors == d]].argmin(), worth[pairs[doors == d]].argmax()]]
                for d in np.unique(doors)}  # fmt: skip
        way = folded.ways.exit_of_pair[int(pairs[0])]
        for one, (low, _) in ends.items():
            for other, (_, high) in ends.items():
                rank = 0 if one == other else 1 if way in (one, other) else 2
                candidate = (rank, float(worth[high] - worth[low]), int(high), int(low))
                found = candidate if found is None else max(found, candidate)
    assert found is not None
    _, _, high, low = found
    group, shift = int(lumping.group[folded.smdp.source[high]]), folded.exact.shift
    return Counterexample(
        lumping.names[group],
        folded.smdp.action_names[high],
        _entry(folded, values, worth, high),
        _entry(folded, values, worth, low),
        float(lumped[group] - shift),
        float(lumping.least_values()[group] - shift),
        float(lumping.greatest_values()[group] - shift),
    )


def _entry(folded: Fold, values: SemiValues, worth: NDArray[np.float64], pair: int) -> Entry:
    smdp, macro = folded.smdp, int(folded.smdp.source[pair])
    discount, steps = (
        float(smdp.discount[smdp.arc_start[pair] : smdp.arc_start[pair + 1]].sum()),
        float(smdp.duration[pair]),
    )
    door, shift = int(folded.ways.entry[macro]), folded.exact.shift
    certain = math.isfinite(steps) and discount > 0 and abs(discount - smdp.gamma**steps) <= ALIKE * discount
    return Entry(
        state=smdp.state_names[macro],
        door=folded.crossings.exit_names[door] if door >= 0 else "the start",
        discount=discount,
        mean_steps=steps if math.isfinite(steps) else None,
        is_certain=certain and abs(steps - round(steps)) <= ALIKE * steps,
        reward=float(smdp.reward[pair]),
        worth=float(worth[pair] - shift),
        value=float(values.value[macro] - shift),
    )


def _refined(folded: Fold, values: SemiValues) -> Refined:
    """The entry states' SMDP against the flat optimum, and against its own policy in the flat chain."""
    flat = folded.exact.shifted[folded.ways.state[:-1]]
    gap = flat - values.value[:-1]
    relative = np.abs(gap) / np.maximum(np.abs(flat), np.finfo(float).tiny)
    worst = int(gap.argmax()) if len(gap) else -1
    scale = max(folded.exact.shift, float(flat.max(initial=0.0)))  # nothing is shifted where no reward is below 0
    difference, residual = flat_check(folded, values)
    return Refined(
        states=len(gap),
        pairs=len(folded.smdp.action_names),
        arcs=len(folded.smdp.target),
        flat_gap=float(gap.max(initial=0.0)),
        relative_gap=float(relative.max(initial=0.0)),
        where=folded.smdp.state_names[worst],
        reaches_optimum=bool(np.all((relative <= ALIKE) | (np.abs(gap) <= 1e-12 * scale))),
        same_policy_difference=difference,
        residual=residual,
        scale=scale,
    )


def flat_check(folded: Fold, values: SemiValues) -> tuple[float, float]:
    """(difference, residual) of the SMDP's policy carried out in the flat world, step by step.

    A state of the flat chain is a cell and the qualitative action being carried out there.  Its value follows from the
    values of the macro states; then every one of its equations v = r + gamma P v is checked.
    """
    ways, gamma = folded.ways, folded.model.gamma
    chosen = values.pair[:-1]
    way = np.array(ways.exit_of_pair, np.int64)[chosen] if len(chosen) else chosen
    flat = np.append(np.zeros(len(chosen)), folded.exact.shift)
    chains = []
    for part, exit_index in sorted(set(zip(ways.part[:-1].tolist(), way.tolist(), strict=True))):
        macros = np.flatnonzero((ways.part[:-1] == part) & (way == exit_index))
        chain = ways.chain_of(part, exit_index, ways.state[macros])
        value = factorised(chain.inside * gamma).solve(chain.reward + gamma * (chain.out @ values.value))
        flat[macros] = value[chain.at]
        chains.append((chain, value))
    residual = 0.0
    for chain, value in chains:
        again = chain.reward + gamma * (chain.inside @ value + chain.out @ flat)
        residual = max(residual, float(np.abs(value - again).max()))
    return float(np.abs(flat - values.value).max()), residual
