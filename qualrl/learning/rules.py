"""The learners: rows of a table.  Each names the compiled loop that runs it and what it does differently there."""

from dataclasses import dataclass
from enum import Enum, auto

from qualrl.errors import UnknownNameError, did_you_mean


class Loop(Enum):
    """The compiled loops, one for each way to go about a step."""

    ONE_STEP = auto()
    """``kernels.learning``: choose, step, update."""


@dataclass(frozen=True)
class LearningRule:
    """One learner."""

    name: str
    title: str
    source: str
    loop: Loop
    limit: str
    """What its values converge to."""
    uses_landmarks: bool = False
    """Whether the landmark level learns too and hands its values down (Algorithm 2)."""


FLAT = "the optimal values of the flat MDP"

RULES = {
    rule.name: rule
    for rule in (
        LearningRule("q-learning", "Q-learning", "Watkins and Dayan 1992; paper, Algorithm 1", Loop.ONE_STEP, FLAT),
        LearningRule(
            "hql", "hierarchical Q-learning", "Chen et al. 2011, Algorithm 2", Loop.ONE_STEP, FLAT, uses_landmarks=True
        ),
    )
}


def rule_named(name: str) -> LearningRule:
    """The learner of a name; UnknownNameError when there is none."""
    if name not in RULES:
        raise UnknownNameError(f"no algorithm is called {name!r}; {did_you_mean(name, RULES)}")
    return RULES[name]
