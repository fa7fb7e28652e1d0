"""Worlds of Gymnasium's toy text kind, and its taxi (Dietterich 2000) with a qualitative level and a task graph.

Needs the extra ``qualrl[rl]``; nothing else of qualrl imports Gymnasium.
"""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError, UnknownNameError
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import Outcome, TabularMDP
from qualrl.models.task_graph import Task, TaskGraph

MISSING = "Gymnasium is not installed; run: pip install 'qualrl[rl]'"
TAXI = "Taxi-v4"
TAXI_ACTIONS = ("south", "north", "east", "west", "pickup", "dropoff")
TAXI_STANDS: dict[str, tuple[int, int]] = {"R": (0, 0), "G": (0, 4), "Y": (4, 0), "B": (4, 3)}
"""(row, column) of the stands, in the order of their numbers."""
RIDING = len(TAXI_STANDS)
"""The passenger's place when in the taxi."""
OVER = "over"


def has_gymnasium() -> bool:
    """Whether the extra is installed."""
    return find_spec("gymnasium") is not None


def from_gymnasium(environment: Any, gamma: float, action_names: Sequence[str] = ()) -> TabularMDP:
    """The table of an environment, or of the name of one, that knows its own ``P[state][action]``.

    States keep their numbers.  Where a state ends the episode when entered in one way but not in another, entering
    it in the first way leads to one more state at the end of the numbers, so that no episode goes on or ends that
    would not.  A time limit around the environment is left out.
    Raises SettingError when Gymnasium is missing or the environment has no table, UnknownNameError for a name it
    does not know.
    """
    name = environment if isinstance(environment, str) else type(environment).__name__
    made = _made(environment) if isinstance(environment, str) else environment
    outcomes = getattr(getattr(made, "unwrapped", made), "P", None)
    if not isinstance(outcomes, Mapping):
        raise SettingError(f"{name} has no table P of its outcomes; toy text worlds such as {TAXI} have one")
    return TabularMDP.from_outcomes(_with_end(outcomes), gamma, action_names)


def _made(name: str) -> Any:
    try:
        gymnasium = importlib.import_module("gymnasium")
    except ModuleNotFoundError:
        raise SettingError(MISSING) from None
    try:
        return gymnasium.make(name)
    except gymnasium.error.Error as problem:
        raise UnknownNameError(f"Gymnasium does not make {name!r}: {str(problem).splitlines()[0]}") from None


Table = dict[int, dict[int, list[Outcome]]]


def _with_end(outcomes: Mapping[Any, Mapping[Any, Sequence[Any]]]) -> Table:
    """The outcomes in plain numbers, with one more state if entering some state ends an episode but not always."""
    table: Table = {
        int(s): {int(a): [(float(p), int(t), float(r), bool(over)) for p, t, r, over in found]
                 for a, found in actions.items()}
        for s, actions in outcomes.items()
    }  # fmt: skip
    entries = [(s, *one[1::2]) for s, actions in table.items() for found in actions.values() for one in found if one[0]]
    ending = {target for _, target, over in entries if over}
    if not any(target in ending and not over and source not in ending for source, target, over in entries):
        return table
    end = len(table)
    moved: Table = {
        s: {a: [(p, end if over else t, r, over) for p, t, r, over in found] for a, found in actions.items()}
        for s, actions in table.items()
    }
    return moved | {end: {a: [(1.0, end, 0.0, True)] for a in table[0]}}


@dataclass(frozen=True, eq=False)
class StartingModel(HybridMDP):
    """A hybrid MDP whose episodes start in one of some states, each as likely as another."""

    start_states: tuple[int, ...] = ()

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """States in which episodes start.  Raises NoPlanError when the goal cannot be reached from one."""
        for state in self.start_states:
            self.check_reachable(state)
        return np.array(self.start_states, np.int64)


def taxi_model(gamma: float) -> StartingModel:
    """The taxi, with errands as its qualitative states, its 300 starts, and Dietterich's task graph.

    An errand is where the passenger is and wants to go: "fetch at R for G", "carry to G".  The landmarks are then
    the single states in which one errand becomes another: the taxi at R with the passenger just in.
    Raises SettingError when Gymnasium is missing.
    """
    environment = _made(TAXI)
    table = replace(from_gymnasium(environment, gamma, TAXI_ACTIONS), state_names=_names())
    plain = replace(HybridMDP.from_table(table, taxi_errands()), tasks=TaskGraph.from_tasks(taxi_tasks(), table))
    starts = np.flatnonzero(environment.unwrapped.initial_state_distrib)
    parts = {part.name: getattr(plain, part.name) for part in fields(plain)}
    return StartingModel(**parts, start_states=tuple(starts.tolist()))


def decoded(state: int) -> tuple[int, int, int, int]:
    """(row, column, the passenger's stand or RIDING, the destination's stand) of a state's number."""
    rest, destination = divmod(state, len(TAXI_STANDS))
    rest, passenger = divmod(rest, RIDING + 1)
    return rest // 5, rest % 5, passenger, destination


N_TAXI = 25 * (RIDING + 1) * len(TAXI_STANDS)


def taxi_errands() -> list[str]:
    """The errand of each state."""
    stands, errands = list(TAXI_STANDS), []
    for state in range(N_TAXI):
        _, _, passenger, destination = decoded(state)
        to = stands[destination]
        errands.append(f"carry to {to}" if passenger == RIDING else f"fetch at {stands[passenger]} for {to}")
    return [*errands, OVER]


def _names() -> tuple[str, ...]:
    named = (decoded(state) for state in range(N_TAXI))
    return (*(f"row {row}, column {column}" for row, column, _, _ in named), OVER)


def taxi_tasks() -> list[Task]:
    """Dietterich's graph: the root gets the passenger, then puts the passenger; both navigate to a stand."""
    riding = [state for state in range(N_TAXI) if decoded(state)[2] == RIDING]
    waiting = [state for state in range(N_TAXI) if decoded(state)[2] != RIDING]
    ways = tuple(f"navigate to {name}" for name in TAXI_STANDS)
    return [
        Task("root", ("get", "put")),
        Task("get", ("pickup", *ways), ends=riding),
        Task("put", ("dropoff", *ways), ends=waiting),
        *(
            Task(way, TAXI_ACTIONS[:4], ends=[state for state in range(N_TAXI) if decoded(state)[:2] == place])
            for way, place in zip(ways, TAXI_STANDS.values(), strict=True)
        ),
    ]
