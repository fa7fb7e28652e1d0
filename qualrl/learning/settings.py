"""The numbers of a learning run, checked once."""

from dataclasses import dataclass, fields

from qualrl.errors import SettingError

ETA_COUNTERS = ("run", "pair", "episode")
MOST_EPISODES = 10_000_000
MOST_WEIGHTS = 1_000_000


@dataclass(frozen=True)
class LearnSettings:
    """What a learner may be told.  Raises SettingError for a number out of its range.

    Symbols are the paper's: alpha_k of equation (6), eta_n = eta_0 ** (m ** n) of Algorithm 2.
    """

    episodes: int = 1000
    alpha: float = 0.1
    """Learning rate, in (0, 1]; constant, which keeps learning for ever but breaks Theorem 2."""
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

    def __post_init__(self) -> None:
        self._check("episodes", 1 <= self.episodes <= MOST_EPISODES, f"from 1 to {MOST_EPISODES:,}")
        self._check("alpha", 0 < self.alpha <= 1, "above 0 and at most 1")
        self._check("epsilon", 0 <= self.epsilon <= 1, "from 0 to 1")
        self._check("max_steps", self.max_steps is None or self.max_steps >= 1, "at least 1, or None")
        self._check("eta0", 0 <= self.eta0 < 1, "at least 0 and less than 1")
        self._check("eta_power", self.eta_power > 1, "above 1")
        self._check("eta_counter", self.eta_counter in ETA_COUNTERS, f"one of {', '.join(ETA_COUNTERS)}")

    def eta_weights(self) -> list[float]:
        """eta_n = eta_0 ** (m ** n) for n = 0, 1, ... until it is 0 in float64, or MOST_WEIGHTS of them."""
        weights: list[float] = []
        exponent = 1.0
        while len(weights) < MOST_WEIGHTS and (weight := self.eta0**exponent) > 0:
            weights.append(weight)
            exponent *= self.eta_power
        return weights

    def _check(self, name: str, good: bool, must: str) -> None:
        if not good:
            raise SettingError(f"{name} must be {must}, got {getattr(self, name)!r}")


def setting_names() -> tuple[str, ...]:
    """Names of all settings."""
    return tuple(field.name for field in fields(LearnSettings))
