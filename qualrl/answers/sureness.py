"""What was learned state by state against exact values, and whether the order of the two best actions holds.

S states, A actions.  Values are shifted (see ``kernels.bellman``), so errors keep their digits far from the goal too.

The order of the two actions that the learner holds for best in a state, of which both were tried, is
    wrong      when the one it holds for best is not, by exact values: the one it holds for second is worth more, or a
               third one is, tried or not; where it holds both for as good, when neither is best;
    equal      when both are best (to a relative 1e-9), so that there is no order;
    settled    when it is right, and the learned values differ by more than the errors of both together: then errors of
               that size could not turn the order, whichever way they went;
    unsettled  otherwise: it is right, or learned values are the same, but errors of that size could turn it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qualrl.answers.depth import Depth
from qualrl.learning.run import LearningRun
from qualrl.planning.values import PlanValues, learned_plan_values
from qualrl.solving.exact import all_action_values

ALIKE = 1e-9
"""Values that differ by less than this share are the same."""
IN_WORDS = {
    "settled": "settled", "unsettled": "not settled", "wrong": "wrong", "equal": "equal", "untried": "not both known",
}  # fmt: skip
ORDERS = tuple(IN_WORDS)
SETTLED, UNSETTLED, WRONG, EQUAL, UNTRIED = range(5)


@dataclass(frozen=True)
class Sureness:
    """Of some states from which the goal can be reached, where the episode is not over."""

    name: str
    states: int
    visited: int
    """How many of them were visited; all that follows is about those."""
    fewest_visits: int | None
    """Of a visited state; None from learners that do not count."""
    mean_error: float | None
    """Mean difference of learned and exact value; None where no state was visited."""
    worst_error: float | None
    optimal: int | None
    """In how many all actions that the learner holds for best are optimal (ties counted as right); None for a learner
    that evaluates a policy, as are the five that follow.
    """
    settled: int | None
    """In how many the order of the two best actions is settled; see above."""
    unsettled: int | None
    wrong: int | None
    equal: int | None
    untried: int | None
    """In how many not both of them were ever tried."""

    def in_words(self, depth: Depth) -> str:
        """As a line of the answer."""
        if depth != Depth.NUMBERS:
            return f"{self.name}: {'; '.join(self._in_signs(depth))}"
        if not self.visited:
            return f"{self.name}: none of {self.states} states visited"
        times = "" if self.fewest_visits is None else f", each at least {_times(self.fewest_visits)}"
        parts = [
            f"{self.name}: {self.visited} of {self.states} states visited{times}",
            f"error {self.mean_error:.3g} on average, {self.worst_error:.3g} at most",
        ]
        if self.optimal is not None:
            orders = ", ".join(f"{count} {words}" for count, words in self._orders())
            parts += [f"best action optimal in {self.optimal}", f"order of the two best: {orders}"]
        return "; ".join(parts)

    def _orders(self) -> list[tuple[int, str]]:
        """How many states there are of each kind of order that occurs."""
        counts = [(getattr(self, order), words) for order, words in IN_WORDS.items()]
        return [(count, words) for count, words in counts if count]

    def _in_signs(self, depth: Depth) -> Iterator[str]:
        """The parts of a line without numbers."""
        yield f"{_some(self.visited, self.states)} of the states visited"
        if self.visited and self.optimal is not None and depth == Depth.SIGNS:
            orders = sorted(self._orders(), key=lambda order: -order[0])
            yield f"best action optimal in {_some(self.optimal, self.visited)} of them"
            most = "" if len(orders) == 1 else ", the most frequent first"
            yield f"order of the two best{most}: {', '.join(words for _, words in orders)}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True, eq=False)
class Judged:
    """All states, judged one by one."""

    visits: NDArray[np.int64] | None
    """(S,)"""
    visited: NDArray[np.bool_]
    """(S,)"""
    error: NDArray[np.float64]
    """(S,)"""
    optimal: NDArray[np.bool_] | None
    """(S,) whether all actions held for best are."""
    order: NDArray[np.int64] | None
    """(S,) index into ORDERS."""

    def part(self, name: str, states: NDArray[np.int64]) -> Sureness:
        """What holds of some states."""
        seen = states[self.visited[states]]
        error = self.error[seen]
        fewest = int(self.visits[seen].min()) if self.visits is not None and len(seen) else None
        optimal = orders = None
        if self.optimal is not None and self.order is not None:
            optimal = int(self.optimal[seen].sum())
            orders = np.bincount(self.order[seen], minlength=len(ORDERS)).tolist()
        return Sureness(
            name, len(states), len(seen), fewest, float(error.mean()) if len(seen) else None,
            float(error.max()) if len(seen) else None, optimal, *(orders or [None] * len(ORDERS)),
        )  # fmt: skip


def judged(run: LearningRun) -> tuple[Judged, PlanValues]:
    """All states of a run judged, and the learned values as plans follow them."""
    learned = learned_plan_values(run)
    q = run.q if run.shifted_q is None else run.shifted_q
    made = np.asarray(np.isfinite(q) & (q != 0) if run.visits is None else run.visits > 0)
    visits = None if run.visits is None else run.visits.sum(axis=1, dtype=np.int64)
    visited: NDArray[np.bool_] = np.logical_or.reduce(made, axis=1)
    tried = made & np.isfinite(q)  # a move may be made where no greedy way of a hierarchy begins with it
    if not run.chooses:
        return Judged(visits, visited, np.abs(run.q[:, 0] - run.exact_values), None, None), learned
    held = run.q + run.exact.shift if run.shifted_q is None else run.shifted_q
    exact = all_action_values(run.model.world, run.exact.shifted, run.exact.shift)
    error = np.abs(learned.shifted - run.exact.shifted)
    return Judged(visits, visited, error, _optimal(held, exact), _order(held, exact, tried)), learned


def _optimal(held: NDArray[np.float64], exact: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(S,) whether all actions of the largest learned value (S, A) have the largest exact one."""
    best, most = held.max(axis=1, keepdims=True), exact.max(axis=1, keepdims=True)
    right: NDArray[np.bool_] = ((held < best) | (exact >= most - ALIKE * np.abs(most))).all(axis=1)
    return right


def _order(held: NDArray[np.float64], exact: NDArray[np.float64], tried: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(S,) how firm the order of the two best actions by learned values (S, A) is: an index into ORDERS."""
    if held.shape[1] < 2:
        return np.full(len(held), UNTRIED)
    two = np.argsort(-held, axis=1, kind="stable")[:, :2]
    first, second = np.take_along_axis(held, two, axis=1).T
    worth, other = np.take_along_axis(exact, two, axis=1).T
    with np.errstate(invalid="ignore"):  # actions that are never taken are worth -inf
        errors = np.abs(first - worth) + np.abs(second - other)
        order = np.where(first - second > errors, SETTLED, UNSETTLED)
    alike = np.abs(worth - other) <= ALIKE * np.maximum(np.abs(worth), np.abs(other))
    best = exact.max(axis=1)
    held_best = np.where(first > second, worth, np.maximum(worth, other))
    order[alike] = EQUAL
    order[held_best < best - ALIKE * np.abs(best)] = WRONG
    order[~np.take_along_axis(tried, two, axis=1).all(axis=1)] = UNTRIED
    return order


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _some(count: int, of: int) -> str:
    return "all" if count == of else "some" if count else "none"
