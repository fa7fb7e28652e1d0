"""The learners: rows of a table, told apart by what the one compiled loop does for them."""

from dataclasses import dataclass

from qualrl.errors import UnknownNameError, did_you_mean


@dataclass(frozen=True)
class LearningRule:
    """One learner."""

    name: str
    title: str
    source: str
    uses_landmarks: bool = False
    """Whether the landmark level learns too and hands its values down (Algorithm 2)."""


RULES = {
    rule.name: rule
    for rule in (
        LearningRule("q-learning", "Q-learning", "Watkins and Dayan 1992; paper, Algorithm 1"),
        LearningRule("hql", "hierarchical Q-learning", "Chen et al. 2011, Algorithm 2", uses_landmarks=True),
    )
}


def rule_named(name: str) -> LearningRule:
    """The learner of a name; UnknownNameError when there is none."""
    if name not in RULES:
        raise UnknownNameError(f"no algorithm is called {name!r}; {did_you_mean(name, RULES)}")
    return RULES[name]
