"""The numbers of a learning run, checked once."""

from dataclasses import dataclass, fields
from functools import lru_cache

from qualrl.errors import SettingError
from qualrl.learning.schedule import schedule_of

ETA_COUNTERS = ("run", "pair", "episode")
MACRO_RETURNS = ("departure", "stay")
MACRO_DISCOUNTS = ("gamma_tau", "gamma")
POLICIES = ("random", "optimal")
MOST_EPISODES = 10_000_000
MOST_WEIGHTS = 1_000_000
MOST_PLANNING_STEPS = 100_000


@dataclass(frozen=True)
class LearnSettings:
    """What a learner may be told.  Raises SettingError for a number out of its range.

    Symbols are the paper's: alpha_k of equation (6), eta_n = eta_0 ** (m ** n) of Algorithm 2.
    """

    episodes: int = 1000
    alpha: float | str = 0.1
    """Learning rate: a number in (0, 1], which keeps learning for ever but breaks Theorem 2, or a formula in k.

    k = 0, 1, ... counts the updates of each state and action, as Theorem 2 asks: ``"1/(1+k)**0.6"``; of each value
    where a learner has others.
    """
    epsilon: float = 0.1
    """Probability of a random action, in [0, 1]."""
    max_steps: int | None = None
    """Most steps of an episode; None = until the goal."""
    eta0: float = 0.1
    """First weight of the landmark step, in [0, 1)."""
    eta_power: float = 1.2
    """The paper's m > 1: how fast the weight falls."""
    eta_counter: str = "run"
    """What n counts: landmark steps of the whole "run", of each landmark and action ("pair"), or of the "episode".

    "run" and "pair" are the paper read literally: HQL is then hardly more than Q-learning, and ends where it does.
    "episode" starts again at eta_0 in every episode, which is what speeds learning up; it breaks the premise of
    Theorem 2, and what exploring detours hand down may then keep the values, even the policy, off the optimum.
    """
    upper_alpha: float | str | None = None
    """Learning rate of the arcs between landmarks, k counting an arc's travels; None = like ``alpha``.

    1.0 lets the upper level follow at once where nothing slips, and not settle where moves do.
    """
    macro_return: str = "departure"
    """Where the return of an arc begins: at the last "departure" from the landmark, or when it was reached ("stay").

    "stay" charges the way onward with the wandering at the landmark, so its values stay below the optimum's.
    """
    macro_discount: str = "gamma_tau"
    """What follows an arc of tau steps is discounted by gamma ** tau (equation 11), or by "gamma" as step (i) of
    Algorithm 2 is printed; that values what lies behind a landmark as if it were one step off, and what is handed
    down misleads the lower level for as long as eta lasts.
    """
    trace: float = 0.9
    """lambda of the learners with eligibility traces, in [0, 1]."""
    policy: str = "random"
    """The policy that td evaluates: "random", or "optimal"; with a share epsilon of random actions."""
    planning_steps: int = 20
    """Backups a step of the learners that plan: exactly (dyna-q), at most (prioritized-sweeping), or on average."""
    planning_threshold: float = 1e-3
    """Changes of a value up to this are let go by prioritized-sweeping."""
    tries: int = 5
    """How often hql-replay tries an action before it counts as known, once it has seen moves slip; before, once."""
    primitives: bool = False
    """Whether learners over options, tasks or sub-agents may also make single moves from the top, everywhere.

    With them their limit is the flat optimum, without them the best of what the hierarchy allows.
    """

    def __post_init__(self) -> None:
        self._check("episodes", 1 <= self.episodes <= MOST_EPISODES, f"from 1 to {MOST_EPISODES:,}")
        schedule_of(self.alpha)
        if self.upper_alpha is not None:
            schedule_of(self.upper_alpha)
        self._check("epsilon", 0 <= self.epsilon <= 1, "from 0 to 1")
        self._check("max_steps", self.max_steps is None or self.max_steps >= 1, "at least 1, or None")
        self._check("eta0", 0 <= self.eta0 < 1, "at least 0 and less than 1")
        self._check("eta_power", self.eta_power > 1, "above 1")
        self._check("eta_counter", self.eta_counter in ETA_COUNTERS, f"one of {', '.join(ETA_COUNTERS)}")
        self._check("macro_return", self.macro_return in MACRO_RETURNS, f"one of {', '.join(MACRO_RETURNS)}")
        self._check("macro_discount", self.macro_discount in MACRO_DISCOUNTS, f"one of {', '.join(MACRO_DISCOUNTS)}")
        self._check("trace", 0 <= self.trace <= 1, "from 0 to 1")
        self._check("policy", self.policy in POLICIES, f"one of {', '.join(POLICIES)}")
        self._check(
            "planning_steps", 1 <= self.planning_steps <= MOST_PLANNING_STEPS, f"from 1 to {MOST_PLANNING_STEPS:,}"
        )
        self._check("planning_threshold", self.planning_threshold > 0, "above 0")
        self._check("tries", self.tries >= 1, "at least 1")

    def eta_weights(self) -> list[float]:
        """eta_n = eta_0 ** (m ** n) for n = 0, 1, ... until it is 0 in float64, or MOST_WEIGHTS of them."""
        return list(_falling(self.eta0, self.eta_power))

    def _check(self, name: str, good: bool, must: str) -> None:
        if not good:
            raise SettingError(f"{name} must be {must}, got {getattr(self, name)!r}")


def setting_names() -> tuple[str, ...]:
    """Names of all settings."""
    return tuple(field.name for field in fields(LearnSettings))


@lru_cache(maxsize=64)
def _falling(first: float, power: float) -> tuple[float, ...]:
    weights: list[float] = []
    exponent = 1.0
    while len(weights) < MOST_WEIGHTS and (weight := first**exponent) > 0:
        weights.append(weight)
        exponent *= power
    return tuple(weights)
