"""The settings of a study: what is run, and what the paper says of it.  One YAML file a figure."""

from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError, field_validator

from qualrl.errors import SettingError, UnknownNameError, did_you_mean
from qualrl.io.positioned_yaml import read_yaml
from qualrl.learning.settings import setting_names
from qualrl.studies.claims import Claim, Strict

STUDIES = ("fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "law", "taxi")
NEED_GYMNASIUM = ("taxi",)
OF_THE_WORLD = ("gamma",)
"""What a reading may set besides the learner's settings."""

Chosen = dict[str, bool | float | str]
"""Settings that make a reading."""


class Series(Strict):
    """Runs of one learner, for every combination of alpha, epsilon and reading."""

    algorithm: str
    alpha: list[float] = Field(min_length=1)
    epsilon: list[float] = Field(default=[0.01], min_length=1)
    readings: dict[str, Chosen] = Field(default={}, validate_default=True)
    """What the paper leaves open: name of each reading -> the learner's settings (qualrl.learning) that make it.

    gamma is the world's own; alpha and epsilon take the stead of the series'.
    """

    @field_validator("readings")
    @classmethod
    def _known(cls, readings: dict[str, Chosen]) -> dict[str, Chosen]:
        for name in (name for chosen in readings.values() for name in chosen):
            if name not in (*setting_names(), *OF_THE_WORLD):
                raise ValueError(f"no setting is called {name!r}; {did_you_mean(name, setting_names())}")
        return readings


class Law(Strict):
    """What episodes x alpha is fitted to: learning rates on the puzzle, and straight corridors of many kinds.

    A corridor has landmarks at equal distances, from one end to the other.
    """

    most_alpha: float
    """Larger learning rates are drawn, to show where the law breaks, but not fitted."""
    flat: str
    """The learner whose cost should be the depth of the maze."""
    layered: str
    """The learner whose cost should be the longest stretch between landmarks."""
    alpha: float
    """Learning rate in the corridors."""
    epsilon: float = 0.01
    eta_counter: Literal["run", "pair", "episode"]
    """The reading that is fitted."""
    episodes: int
    """Episodes in a corridor."""
    most_stretches: int
    """Corridors of more stretches are fitted apart: the landmark step's weights are spent before their end."""
    lengths: list[int]
    """Steps from end to end."""
    spacings: list[int]
    """Steps from landmark to landmark; only those that divide a length, at least twice."""


class Budget(Strict):
    """Runs are given environment steps instead of episodes, and their greedy policy is looked at on the way."""

    world: Literal["map", "taxi"]
    scenario: str = "office.scenario.yaml"
    """Of a map: a bundled scenario, or the path of one."""
    steps: int = Field(ge=1)
    """Of each run."""
    first: int = Field(default=10_000, ge=1)
    """Steps before the first look."""
    looks_per_tenfold: int = Field(default=12, ge=1)
    even_looks: int = Field(default=50, ge=1)
    """Looks at equal distances, over the whole budget, besides those."""
    within: float = Field(gt=0, lt=1)
    """How much worse than the optimum a good policy may be."""


class Picture(Strict):
    """How a study is drawn."""

    kind: Literal["curves", "surface", "law", "navigation", "values"]
    panels: Literal["alpha", "reading"] | None = None
    """Of curves: what gets a panel for each of its values."""
    most_steps: float | None = None
    """Upper end of the steps axis, as in the paper."""
    most_episodes: int | None = None


class StudySettings(Strict):
    """A study.  Symbols are the paper's: gamma, eta_0, m (here eta_power)."""

    title: str
    source: str
    episodes: int = Field(default=6000, ge=1)
    seeds: int = Field(default=30, ge=2)
    gamma: float = 0.9
    eta0: float = 0.1
    eta_power: float = 1.2
    points: int = Field(default=1000, ge=1)
    """At most so many points of each curve are kept."""
    series: dict[str, Series] = Field(default={})
    law: Law | None = None
    budget: Budget | None = None
    picture: Picture | None = None
    claims: list[Claim]
    notes: list[str] = Field(default=[])


def load_study(name: str, folder: Path | None = None) -> StudySettings:
    """The settings of a study.  Raises UnknownNameError for an unknown one, SettingError for a wrong file."""
    if name not in STUDIES:
        raise UnknownNameError(f"no study is called {name!r}; {did_you_mean(name, (*STUDIES, 'all'))}")
    file = (folder or Path(__file__).parent) / name / "settings.yaml"
    content = read_yaml(file, what="settings", error=SettingError)
    try:
        return StudySettings.model_validate(content.data)
    except ValidationError as problems:
        lines = (f"{file}: {'.'.join(map(str, each['loc']))}: {each['msg']}" for each in problems.errors())
        raise SettingError("\n".join(lines)) from None
