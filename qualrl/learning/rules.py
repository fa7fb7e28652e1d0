"""The learners: rows of a table.  Each names the compiled loop that runs it and what it does differently there."""

from dataclasses import dataclass
from enum import Enum, auto

from qualrl.errors import UnknownNameError, did_you_mean


class Loop(Enum):
    """The compiled loops, one for each way to go about a step."""

    ONE_STEP = auto()
    """``kernels.learning``: choose, step, update."""
    AHEAD = auto()
    """``kernels.traces``: step, choose the next action, update."""
    PLANNING = auto()
    """``kernels.planning``: choose, step, remember, and back up what was seen before."""
    TASKS = auto()
    """``kernels.tasks`` and ``kernels.task_graph``: choose where to go, then step."""


class Planner(Enum):
    """How a planning learner chooses what to back up."""

    DYNA = auto()
    """Anything seen, at random."""
    HEAP = auto()
    """States in the order of how much they may change."""
    REGIONS = auto()
    """Regions in that order, at qualitative transitions."""


class Hierarchy(Enum):
    """What stands between the top choice and a move; see ``learning.hierarchical``."""

    OPTION = auto()
    """A given way; it learns when it ends."""
    INTRA_OPTION = auto()
    """A given way; all that agree with a move learn from it."""
    MAXQ = auto()
    """A task graph, whose values are taken apart along it."""
    MACHINE = auto()
    """A machine with choices left open."""
    SWITCH = auto()
    """Sub-agents, one of which is picked by a learned switch."""
    W = auto()
    """Sub-agents that settle it among themselves."""


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
    evaluates: bool = False
    """Whether it learns what a given policy is worth, V (S,), and not what to do."""
    on_policy: bool = False
    """Whether the target is the action chosen next, not the best one."""
    traces: bool = False
    planner: Planner | None = None
    """How a learner of ``Loop.PLANNING`` plans."""
    hierarchy: Hierarchy | None = None
    """What a learner of ``Loop.TASKS`` has between the top choice and a move."""

    @property
    def averages(self) -> bool:
        """Whether it keeps counts of outcomes, whose means need no learning rate."""
        return self.planner in (Planner.HEAP, Planner.REGIONS)


FLAT = "the optimal values of the flat MDP"
SOFT = "the values of the best policy that explores with probability epsilon (the flat optimum as epsilon falls to 0)"
TOP_MOVES = "; with primitives, " + FLAT
HIERARCHY_ROWS = (
    LearningRule(
        "option-q", "SMDP Q-learning over options", "Sutton, Precup and Singh 1999", Loop.TASKS,
        "the best over the options between landmarks" + TOP_MOVES, hierarchy=Hierarchy.OPTION,
    ),
    LearningRule(
        "intra-option-q", "intra-option Q-learning", "Sutton, Precup and Singh 1998", Loop.TASKS,
        "the best over the options between landmarks" + TOP_MOVES, hierarchy=Hierarchy.INTRA_OPTION,
    ),
    LearningRule(
        "maxq-q", "MAXQ-Q", "Dietterich 2000", Loop.TASKS,
        "the recursive optimum of the task graph, as exploring fades" + TOP_MOVES + " (on the graph of landmarks)",
        hierarchy=Hierarchy.MAXQ,
    ),
    LearningRule(
        "hamq", "HAM Q-learning", "Parr and Russell 1998", Loop.TASKS,
        "the hierarchical optimum: the best of all policies of the machine" + TOP_MOVES, hierarchy=Hierarchy.MACHINE,
    ),
    LearningRule(
        "switch", "modular Q-learning with a switch", "paper, Figure 1; Wiering and Schmidhuber 1997", Loop.TASKS,
        "the best choice at each step among what the sub-agents would do" + TOP_MOVES, hierarchy=Hierarchy.SWITCH,
    ),
    LearningRule(
        "w-learning", "W-learning", "Humphrys 1997", Loop.TASKS,
        "for each sub-agent the optimum of its own task; their compromise carries no guarantee",
        hierarchy=Hierarchy.W,
    ),
)  # fmt: skip

RULES = {
    rule.name: rule
    for rule in (
        LearningRule(
            "td", "TD(0)", "Sutton 1988", Loop.ONE_STEP, "the values of the policy it evaluates", evaluates=True
        ),
        LearningRule("q-learning", "Q-learning", "Watkins and Dayan 1992; paper, Algorithm 1", Loop.ONE_STEP, FLAT),
        LearningRule(
            "hql", "hierarchical Q-learning", "Chen et al. 2011, Algorithm 2", Loop.ONE_STEP, FLAT, uses_landmarks=True
        ),
        LearningRule("sarsa", "SARSA", "Rummery and Niranjan 1994", Loop.AHEAD, SOFT, on_policy=True),
        LearningRule(
            "sarsa-lambda", "SARSA(lambda)", "Rummery and Niranjan 1994", Loop.AHEAD, SOFT, on_policy=True, traces=True
        ),
        LearningRule("q-lambda", "Watkins's Q(lambda)", "Watkins 1989", Loop.AHEAD, FLAT, traces=True),
        LearningRule("dyna-q", "Dyna-Q", "Sutton 1990", Loop.PLANNING, FLAT, planner=Planner.DYNA),
        LearningRule(
            "prioritized-sweeping",
            "prioritized sweeping",
            "Moore and Atkeson 1993",
            Loop.PLANNING,
            FLAT + ", but for changes up to planning_threshold, which it lets go",
            planner=Planner.HEAP,
        ),
        LearningRule(
            "hql-replay",
            "HQL with replay by regions",
            "this project; see learning/planners.py",
            Loop.PLANNING,
            FLAT,
            planner=Planner.REGIONS,
        ),
        *HIERARCHY_ROWS,
    )
}


def rule_named(name: str) -> LearningRule:
    """The learner of a name; UnknownNameError when there is none."""
    if name not in RULES:
        raise UnknownNameError(f"no algorithm is called {name!r}; {did_you_mean(name, RULES)}")
    return RULES[name]
