"""The section ``learn`` of a scenario: which learner, and the numbers it is told.

gamma, alpha, epsilon, eta are the paper's letters.  What each does is said in ``learning.settings``.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, WithJsonSchema

from qualrl.errors import SettingError, UnknownNameError, shown
from qualrl.learning.rules import RULES, rule_named
from qualrl.learning.settings import MOST_EPISODES, MOST_PLANNING_STEPS


class Strict(BaseModel):
    """Unknown keys are errors, text is no number, true is no number, and nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def whole(value: object) -> object:
    """1e5 is a whole number too, as in JSON Schema."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _algorithm(value: str) -> str:
    try:
        return rule_named(value).name
    except UnknownNameError as problem:
        raise ValueError(str(problem)) from None


def _rate(value: object) -> float | str:
    from qualrl.learning.schedule import schedule_of

    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (isinstance(value, str) or (number and 0 < value <= 1)):  # type: ignore[operator]
        raise ValueError(f"must be a number above 0 and at most 1, or a formula in k, got {shown(value)}")
    assert isinstance(value, int | float | str)
    try:
        schedule_of(value)
    except SettingError as problem:
        raise ValueError(str(problem).removeprefix("alpha").lstrip(": ")) from None
    return value if isinstance(value, str) else float(value)


RATE_SCHEMA = {"anyOf": [{"type": "number", "exclusiveMinimum": 0, "maximum": 1}, {"type": "string", "minLength": 1}]}
Count = Annotated[int, Field(ge=1, lt=2**63), BeforeValidator(whole)]
Rate = Annotated[float | str, PlainValidator(_rate), WithJsonSchema(RATE_SCHEMA)]
Algorithm = Annotated[str, AfterValidator(_algorithm), WithJsonSchema({"enum": list(RULES)})]


class LearnSettings(Strict):
    """How the robot learns."""

    algorithm: Algorithm = Field(default="hql-replay", description="q-learning, hql, hql-replay, q-lambda and others")
    episodes: Count = Field(default=2000, le=MOST_EPISODES, description="number of episodes")
    gamma: float = Field(default=0.99, ge=0, lt=1, description="discount of a step, below 1")
    alpha: Rate = Field(default=0.1, description="learning rate: a number up to 1, or a formula in k")
    epsilon: float = Field(default=0.1, ge=0, le=1, description="probability of an exploring move")
    max_steps: Count | None = Field(default=None, description="most steps in an episode; null = no limit set here")
    eta0: float = Field(default=0.1, ge=0, lt=1, description="first weight of the qualitative level")
    eta_power: float = Field(default=1.2, gt=1, description="how fast that weight fades (the paper's m), above 1")
    eta_counter: Literal["run", "pair", "episode"] = Field(
        default="run", description="what it fades with: run, pair or episode"
    )
    upper_alpha: Rate | None = Field(default=None, description="learning rate of hql's upper level; null = alpha")
    macro_return: Literal["departure", "stay"] = Field(
        default="departure", description="hql: an arc's return starts at the departure, or with the stay"
    )
    macro_discount: Literal["gamma_tau", "gamma"] = Field(
        default="gamma_tau", description="hql: what follows an arc of tau steps: gamma_tau or gamma"
    )
    trace: float = Field(default=0.9, ge=0, le=1, description="lambda of sarsa-lambda and q-lambda")
    policy: Literal["random", "optimal"] = Field(default="random", description="the policy that td evaluates")
    planning_steps: Count = Field(
        default=20, le=MOST_PLANNING_STEPS, description="backups a step of learners that plan"
    )
    planning_threshold: float = Field(
        default=1e-3, gt=0, description="prioritized-sweeping lets smaller changes of a value go"
    )
    tries: Count = Field(default=5, description="hql-replay: tries until an action is known")
    primitives: bool = Field(default=False, description="whether options and tasks may be left for single moves")
