"""A plan for a world some of whose doorways may turn out shut, and where it is not known how long things take.

The robot follows its way; where that leads through an uncertain doorway, it sees in front of it whether it is open.
If it is not, it goes on by the best way that is left, as if all doorways that it has not seen yet were open, but for
those that never are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from qualrl.answers.uncertain import Span, Uncertain
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.planning.legs import legs_of
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.outlook import Number, Outlook
from qualrl.solving.exact import ExactValues, exact_values

Names = frozenset[str]


@dataclass
class Contingent:
    """Makes plans of walks; remembers what it solved, and the numbers that the plans hang on."""

    model: HybridMDP
    uncertain: Uncertain
    box: dict[str, Span] = field(default_factory=dict)
    """The interval of each number."""
    measured: dict[str, int] = field(default_factory=dict)
    """The steps of each leg whose time was measured, by the key of its number."""
    together: dict[str, str] = field(default_factory=dict)
    """By the same keys the region, whose law of times decides all numbers of its legs."""
    stranded: set[Names] = field(default_factory=set)
    """Doorways that leave no way, when they are shut."""
    _solved: dict[Names, tuple[HybridMDP, ExactValues]] = field(default_factory=dict)
    _blocks: dict[str, set[tuple[int, int]]] = field(default_factory=dict)

    def outlook(self, walk: Sequence[int]) -> Outlook | None:
        """What a walk to the goal is worth, and what is done where a doorway on it is shut."""
        return self._onward(walk, frozenset(), frozenset())

    def _onward(self, walk: Sequence[int], opened: Names, shut: Names) -> Outlook | None:
        """The same from the walk's first state on.  opened, shut: doorways that were seen so."""
        for at, step in enumerate(pairwise(walk)):
            for door in self.uncertain.doors:
                if door not in opened and step in self._blocked(door):
                    self.box[door] = self.uncertain.door(door)
                    beyond = self._onward(walk[at:], opened | {door}, shut)
                    fork = Outlook(
                        then=beyond, number=Number(door), instead=self._round(walk[at], opened, shut | {door})
                    )
                    return self._legs(walk[: at + 1], fork)
        return self._legs(walk, None)

    def _round(self, state: int, opened: Names, shut: Names) -> Outlook | None:
        """From where a doorway was found shut; None where no way is left.  What is never open is known to be shut."""
        shut |= {name for name in self.uncertain.doors if self.uncertain.door(name)[1] == 0} - opened
        if shut not in self._solved:
            changed = self.model.with_closed(shut)
            self._solved[shut] = changed, exact_values(changed.world)
        changed, exact = self._solved[shut]
        if not changed.can_reach[state]:
            self.stranded.add(shut)
            return None
        return self._onward(exact_walk(changed, exact, state), opened, shut)

    def _legs(self, walk: Sequence[int], after: Outlook | None) -> Outlook | None:
        """The walk leg by leg, and then ``after``."""
        legs = legs_of(self.model, walk)
        ends = [*(leg.first for leg in legs[1:]), len(walk) - 1]
        for leg, end in zip(reversed(legs), reversed(ends), strict=True):
            if end > leg.first:
                after = self._leg(self.model.region_names[leg.region], walk[leg.first : end + 1], after)
        return after

    def _leg(self, region: str, walk: Sequence[int], after: Outlook | None) -> Outlook:
        world, steps = self.model.grid, len(walk) - 1
        states = np.array(walk)
        moves = (world.successor[states[:-1]] == states[1:, None]).argmax(axis=1)
        rewards = world.move_reward[moves] - world.step_reward
        amounts = abs(rewards)
        if walk[-1] == world.goal:
            still = world.step_reward / (1 - world.gamma)
            rewards[-1], amounts[-1] = world.goal_reward - still, abs(world.goal_reward) + abs(still)
        number = None
        if (found := self.uncertain.leg(region, world.gamma, steps)) is not None:
            number, self.box[found[0].key] = found
            if number.leg is None:
                self.measured[number.key], self.together[number.key] = steps, region
        weights = world.gamma ** np.arange(steps)
        return Outlook(
            float(rewards @ weights), world.gamma**steps, after, number, amounts=float(amounts @ weights)
        )  # fmt: skip

    def _blocked(self, door: str) -> set[tuple[int, int]]:
        """The steps that a shut doorway does not let pass."""
        if door not in self._blocks:
            before, after = self.model.grid.successor, self.model.with_closed([door]).grid.successor
            states, moves = np.nonzero(before != after)
            self._blocks[door] = set(zip(states.tolist(), before[states, moves].tolist(), strict=True))
        return self._blocks[door]
