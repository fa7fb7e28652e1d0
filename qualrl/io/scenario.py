"""Scenarios: one YAML file that says which map, from where to where, and how to learn.

Every setting but ``map`` and ``goal`` has a default, so a scenario is complete once those two are there.
Suffixes are units: ``_m`` metres, ``_m2`` square metres.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    PlainSerializer,
    PlainValidator,
    PrivateAttr,
    ValidationError,
    WithJsonSchema,
)

from qualrl.errors import MapError, PlaceError, QualrlError, ScenarioError, UnknownNameError, shown
from qualrl.io.bundled import SCENARIO_SUFFIX, found
from qualrl.io.positioned_yaml import KeyPath, PositionedYaml, parse_yaml, read_yaml
from qualrl.io.scenario_errors import dotted, explained
from qualrl.io.scenario_learn import LearnSettings, Strict, whole
from qualrl.io.scenario_world import ChangeSetting, OnlineSettings, changes_of
from qualrl.io.scenario_writing import written
from qualrl.io.scenario_zones import DistanceSettings, ZoneField, zone_on
from qualrl.qualitative.statements import read_statement
from qualrl.spatial.place import MOST_CHARACTERS, Place, PlaceCell, PlaceMetres, PlaceName, read_place

if TYPE_CHECKING:  # what builds models is heavy, and loads when a model is built
    from qualrl.learning.changes import Change
    from qualrl.models.hybrid_mdp import HybridMDP
    from qualrl.qualitative.checking import Checked
    from qualrl.spatial.region_map import RegionMap
    from qualrl.spatial.relations import Relations


NO_OPTIONS: Mapping[str, str] = MappingProxyType({})


def _place(value: object) -> Place:
    try:
        return read_place(value)
    except PlaceError as problem:
        raise ValueError(str(problem)) from None


def _plain_place(place: Place) -> str | list[int] | list[float]:
    if isinstance(place, PlaceCell):
        return [place.row, place.column]
    return [place.x_m, place.y_m] if isinstance(place, PlaceMetres) else place.name


def _name(value: str) -> str:
    place = _place(value)
    if not value.isprintable():
        raise ValueError(f"must hold printable characters only, got {value!r}")
    if not isinstance(place, PlaceName):
        raise ValueError(f"must not read as two numbers, got {value!r}")
    return value


def _claim(value: str) -> str:
    read_statement(value)
    return value


PLACE_SCHEMA = {
    "anyOf": [
        {"type": "string", "minLength": 1, "maxLength": MOST_CHARACTERS},
        {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
    ]
}
Seed = Annotated[int, Field(ge=0, lt=2**63), BeforeValidator(whole)]
PlaceField = Annotated[Place, PlainValidator(_place), PlainSerializer(_plain_place), WithJsonSchema(PLACE_SCHEMA)]
Claim = Annotated[str, AfterValidator(_claim)]
OldName = Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS)]
Name = Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS), AfterValidator(_name)]


class MotionSettings(Strict):
    """How the robot moves from cell to cell."""

    directions: Annotated[Literal[4, 8], BeforeValidator(whole)] = Field(
        default=4, description="4, or 8 to allow diagonal moves"
    )
    slip: float = Field(default=0.0, ge=0, lt=1, description="probability that a move goes astray")


class RewardSettings(Strict):
    """What the robot is paid."""

    step: float = Field(default=-1.0, lt=0, description="for every step, below 0")
    goal: float = Field(default=100.0, description="once, for reaching the goal")


class SegmentSettings(Strict):
    """How the map is cut into regions."""

    min_area_m2: float | None = Field(
        default=None, gt=0, description="least area of a region; null = chosen from the map"
    )


class MadeWith(Strict):
    """What a result was made with; written into copies of the scenario beside results."""

    qualrl: str | None = Field(default=None, description="version of qualrl")
    map_sha256: str | None = Field(default=None, description="SHA-256 of the map image's bytes")


class Scenario(Strict):
    """A checked scenario. Two are equal when their settings are, wherever they were read from."""

    map: str = Field(min_length=1, description="ROS map YAML, image or MovingAI .map, relative to this file")
    start: PlaceField | None = Field(
        default=None, description="a name, [row, column], or [x, y] in metres with a decimal point; null = random"
    )
    goal: PlaceField = Field(description="a place, written like start")
    seed: Seed = Field(default=0, description="the same seed gives the same result")
    names: dict[OldName, Name] = Field(
        default={}, description="new names for regions, doorways and landmarks, old: new"
    )
    landmarks: dict[Name, PlaceField] | None = Field(
        default=None,
        description="landmarks placed by hand, name: place; null = those found on the map",
    )
    resolution_m: float | None = Field(
        default=None, gt=0, description="side of a cell, for an image without a map YAML"
    )
    radius_m: float = Field(
        default=0.0, ge=0, description="of the robot, which fits where no wall or unknown cell is nearer; 0 = a point"
    )
    motion: MotionSettings = Field(default=MotionSettings(), description="how the robot moves")
    reward: RewardSettings = Field(default=RewardSettings(), description="what the robot is paid")
    segment: SegmentSettings = Field(default=SegmentSettings(), description="how the map is cut into regions")
    learn: LearnSettings = Field(default=LearnSettings(), description="how the robot learns")
    changes: list[ChangeSetting] = Field(
        default=[], description="doorways that close or open, as {after: EPISODES, close: DOORWAY}"
    )
    online: OnlineSettings | None = Field(
        default=None, description="for a robot that does not know the map; null = it does"
    )
    zones: dict[Name, ZoneField] = Field(
        default={}, description="parts of the map, name: [[x, y], ...] in metres or {image: FILE}"
    )
    distance: DistanceSettings = Field(default=DistanceSettings(), description="what near and far mean")
    claims: list[Claim] = Field(
        default=[], description='what should be true of the map, in words, as "kitchen north of lab"'
    )
    made_with: MadeWith | None = Field(default=None, description="what a result was made with")

    _path: Path | None = PrivateAttr(None)
    _asked: dict[str, str] = PrivateAttr(default_factory=dict)
    _stood: dict[KeyPath, tuple[int, int]] = PrivateAttr(default_factory=dict)

    @property
    def path(self) -> Path | None:
        """The file this was read from; None for a scenario made in memory."""
        return self._path

    @property
    def map_path(self) -> Path:
        """Where the map lies: relative to the scenario's file, or to the current folder without one."""
        return Path(os.path.normpath(self.folder / self.map))

    @property
    def folder(self) -> Path:
        """What the names of files are relative to."""
        return Path() if self._path is None else self._path.parent

    def regions(self) -> "RegionMap":
        """The map, read, cut into regions, renamed as ``names`` says and marked as ``landmarks`` says."""
        from qualrl.io.read_map import read_map
        from qualrl.spatial.segmentation import segment

        grid = read_map(self.map_path, resolution_m=self.resolution_m)
        area_m2 = self.segment.min_area_m2
        area = {} if area_m2 is None else {"min_area_m2": area_m2}
        try:
            found = segment(grid, radius_m=self.radius_m, **area)
        except MapError as problem:
            raise MapError(f"{self._where('radius_m')}: {problem}") from None
        for name in self.names:
            if name in (self.landmarks or {}) and name not in found.all_names:
                where = self._where("names")
                raise UnknownNameError(
                    f"{where}: {shown(name)} is a landmark of this scenario; name it under landmarks"
                )
        found = found.renamed(self.names)
        return found if self.landmarks is None else self._marked(found)

    def _marked(self, regions: "RegionMap") -> "RegionMap":
        from qualrl.spatial.placed_landmarks import with_landmarks

        try:
            return with_landmarks(regions, self.landmarks or {})
        except QualrlError as problem:
            where = f"{self.path}: " if self.path else ""
            raise type(problem)(f"{where}{problem}") from None

    def build(self, regions: "RegionMap | None" = None) -> "HybridMDP":
        """The hybrid MDP of this scenario; of ``regions`` if they are at hand already, else of its map."""
        from qualrl.models.hybrid_mdp import NOTHING_TO_LEARN, hybrid_mdp
        from qualrl.spatial.place import resolve_cell

        found = self.regions() if regions is None else regions
        cells = []
        for key, place in (("goal", self.goal), ("start", self.start)):
            try:
                if place is not None:
                    cells.append(resolve_cell(place, found))
            except (PlaceError, UnknownNameError) as problem:
                raise type(problem)(f"{self._where(key)}: {problem}") from None
        if len(set(cells)) < len(cells):
            raise PlaceError(f"{self._where('start')}: {NOTHING_TO_LEARN}")
        model = hybrid_mdp(
            found,
            self.goal,
            start=self.start,
            gamma=self.learn.gamma,
            slip=self.motion.slip,
            directions=self.motion.directions,
            step_reward=self.reward.step,
            goal_reward=self.reward.goal,
        )
        self._check_changes(model)
        return model

    def relations(self, regions: "RegionMap") -> "Relations":
        """How the regions of its map lie to each other and to its zones."""
        from qualrl.spatial.relations import Relations

        zones = []
        for name, drawn in self.zones.items():
            try:
                zones.append(zone_on(regions, name, drawn, self.folder))
            except PlaceError as problem:
                raise PlaceError(f"{self._where('zones', name)}: {problem}") from None
        return Relations(regions, zones)

    def check(self, regions: "RegionMap | None" = None) -> "Checked":
        """Its claims, checked against its map (``regions``, if they are at hand already) and against each other."""
        from qualrl.qualitative.checking import check

        relations = self.relations(self.regions() if regions is None else regions)
        where = [self._where("claims", at) for at in range(len(self.claims))]
        return check(relations, [read_statement(claim) for claim in self.claims], self.distance.cuts, where)

    def _where(self, *path: str | int) -> str:
        """Where a key, or one of its items, was set: in the file, or on the command line."""
        key = str(path[0])
        if key in self._asked or not self.path:
            return self._asked.get(key, dotted(path))
        line, column = self._stood.get(path, (0, 0))
        return f"{self.path}:{line}:{column}: {dotted(path)}" if line else f"{self.path}: {dotted(path)}"

    def door_changes(self) -> "tuple[Change, ...]":
        """The changes of the world, as ``qualrl.train`` takes them."""
        return changes_of(self.changes)

    def _check_changes(self, model: "HybridMDP") -> None:
        if self.changes:
            from qualrl.learning.changes import world_changes

            try:
                world_changes(model, self.door_changes(), self.learn.episodes)
            except QualrlError as problem:
                where = f"{self.path}: " if self.path else ""
                raise type(problem)(f"{where}{problem}") from None

    def with_settings(self, settings: Sequence[str], options: Mapping[str, str] = NO_OPTIONS) -> Self:
        """The same scenario with some settings changed, each "KEY=VALUE" with a dotted key and YAML value.

        options: for a setting that came by another way than --set, what to call that way where it is wrong.

        >>> Scenario(map="office.yaml", goal="room C").with_settings(["learn.alpha=0.05"]).learn.alpha
        0.05
        """
        data = self.model_dump()
        asked: dict[KeyPath, str] = {}
        for setting in settings:
            key, path, value = _read_setting(setting)
            asked[path] = options.get(setting, f"--set {dotted((key,))}")
            _put(data, path, value)
        try:
            changed = type(self).model_validate(data)
        except ValidationError as problems:
            lines = [f"{_asked_at(problem.path, asked)}: {problem.what}" for problem in explained(problems, Scenario)]
            raise ScenarioError("\n".join(lines)) from None
        changed._path, changed._stood = self._path, self._stood
        changed._asked = self._asked | {str(path[0]): told for path, told in asked.items()}
        return changed

    def __eq__(self, other: object) -> bool:
        """Whether all settings are equal; dict() leaves out the file."""
        return isinstance(other, Scenario) and dict(self) == dict(other)

    def __hash__(self) -> int:
        """Equal scenarios have equal hashes."""
        return hash((self.map, self.goal, self.seed))


def load_scenario(path: str | Path) -> Scenario:
    """Read and check a scenario file; ScenarioError has one line for each problem, in the file's order.

    path: of a file, or the name of a bundled scenario, as "office".
    """
    file = found(str(path), SCENARIO_SUFFIX)
    content = read_yaml(file, what="scenario", error=ScenarioError)
    scenario = _checked(content)
    scenario._path = file
    scenario._stood = {path: at for path, at in content.value_at.items() if len(path) in (1, 2)}
    return scenario


def scenario_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files, for editors."""
    schema = Scenario.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "qualrl scenario"}


def dump_scenario(scenario: Scenario) -> str:
    """Commented YAML that reads back as an equal scenario."""
    lines = ["# A qualrl scenario: a map, a way to find on it, and how to learn it."]
    data = scenario.model_dump()
    for key, field in Scenario.model_fields.items():
        value, section = data[key], getattr(scenario, key)
        if key == "made_with" and value is None:
            continue
        if not isinstance(value, dict) or not value:
            lines.append(f"{key}: {written(value)}  # {field.description}")
            continue
        lines.append(f"{key}:  # {field.description}")
        fields = type(section).model_fields if isinstance(section, BaseModel) else {}
        for inner, setting in value.items():
            comment = f"  # {fields[inner].description}" if inner in fields else ""
            lines.append(f"  {written(inner)}: {written(setting)}{comment}")
    return "\n".join(lines) + "\n"


def _checked(content: PositionedYaml) -> Scenario:
    if not isinstance(content.data, dict):
        why = "the file is empty" if content.data is None else f"expected keys, got {shown(content.data)}"
        raise ScenarioError(content.line((), f"{why}; write at least 'map: MAP FILE' and 'goal: PLACE'"))
    try:
        return Scenario.model_validate(content.data)
    except ValidationError as problems:
        found = explained(problems, Scenario)
        found.sort(key=lambda problem: content.position(problem.where, of_key=problem.of_key))
        lines = [
            content.line(problem.where, f"{dotted(problem.path)}: {problem.what}", of_key=problem.of_key)
            for problem in found
        ]
        raise ScenarioError("\n".join(lines)) from None


def _read_setting(setting: str) -> tuple[str, KeyPath, object]:
    """The dotted key as given, its path, and the value."""
    key, equals, text = setting.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ScenarioError(f"--set {dotted((setting,))}: expected KEY=VALUE, for example learn.alpha=0.1")
    section, _, rest = key.partition(".")  # what stands in these sections is a name, dots and all
    path = (section, rest) if section in ("names", "landmarks", "zones") and rest else tuple(key.split("."))
    return key, path, parse_yaml(text, f"--set {dotted((key,))}", error=ScenarioError).data


def _put(data: dict[str, Any], path: KeyPath, value: object) -> None:
    *sections, last = path
    for section in sections:
        if not isinstance(data.get(str(section)), dict):
            data[str(section)] = {}
        data = data[str(section)]
    data[str(last)] = value


def _asked_at(path: KeyPath, asked: dict[KeyPath, str]) -> str:
    """The --set that led to a problem at ``path``; the last one, as later ones win."""
    for asked_path, told in reversed(asked.items()):
        if path[: len(asked_path)] == asked_path:
            return told if path == asked_path else f"{told}: {dotted(path)}"
        if asked_path[: len(path)] == path:
            return f"{told}: {dotted(path)}"
    return dotted(path)
