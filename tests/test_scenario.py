"""Scenario files: defaults, strictness, errors with positions, settings from the command line, round trips."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import QualrlError, ScenarioError
from qualrl.io.scenario import (
    MadeWith,
    MotionSettings,
    RewardSettings,
    Scenario,
    SegmentSettings,
    dump_scenario,
    load_scenario,
    scenario_schema,
)
from qualrl.io.scenario_learn import LearnSettings
from qualrl.io.scenario_zones import SIDES, DistanceSettings, MaskImage, Outline
from qualrl.learning.rules import RULES
from qualrl.spatial.place import Place, PlaceCell, PlaceMetres, PlaceName, read_place

LEAST = "map: office.yaml\ngoal: room C\n"


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write s.yaml into the current folder, a fresh one."""
    monkeypatch.chdir(tmp_path)
    return lambda text: Path("s.yaml").write_text(text, encoding="utf-8")


def complaint(what: Any, *arguments: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        what(*arguments)
    return str(caught.value)


def test_all_but_map_and_goal_has_a_default(write: Any) -> None:
    write(LEAST)
    scenario = load_scenario("s.yaml")
    assert scenario.goal == PlaceName("room C")
    assert (scenario.start, scenario.seed, scenario.names, scenario.resolution_m) == (None, 0, {}, None)
    assert (scenario.motion.directions, scenario.motion.slip) == (4, 0.0)
    assert (scenario.reward.step, scenario.reward.goal) == (-1.0, 100.0)
    learn = scenario.learn
    assert (learn.algorithm, learn.episodes, learn.gamma, learn.alpha) == ("hql-replay", 2000, 0.99, 0.1)
    assert (learn.epsilon, learn.max_steps, learn.eta0, learn.eta_power) == (0.1, None, 0.1, 1.2)
    assert (learn.eta_counter, scenario.segment.min_area_m2, scenario.made_with) == ("run", None, None)


def test_a_full_scenario(write: Any) -> None:
    write(
        "map: m.png\nstart: [120, 45]\ngoal: 3.5, 2\nseed: 1e3\nnames: {room A: no}\nresolution_m: 1\n"
        "motion: {directions: 8, slip: 1e-2}\nreward: {step: -2, goal: 0}\nsegment: {min_area_m2: 2}\n"
        "learn: {algorithm: q-learning, episodes: 10, max_steps: 5, eta_counter: run}\n"
        'made_with: {qualrl: "0.1.0"}\n'
    )
    scenario = load_scenario("s.yaml")
    assert scenario.start == PlaceCell(120, 45)
    assert scenario.goal == PlaceMetres(3.5, 2.0)
    assert (scenario.seed, scenario.names, scenario.resolution_m) == (1000, {"room A": "no"}, 1.0)
    assert type(scenario.seed) is int
    assert scenario.motion == MotionSettings(directions=8, slip=0.01)
    assert scenario.made_with == MadeWith(qualrl="0.1.0", map_sha256=None)


def test_all_errors_at_once_in_the_order_of_the_file(write: Any) -> None:
    write(
        "map: office.yaml\n"
        "goal: 12\n"
        "seed: -1\n"
        "learn:\n"
        '  alpha: "0.1 k j"\n'
        "  gama: 0.9\n"
        "  gamma: 1.5\n"
        "  epsilon: .inf\n"
        "  seed: 4\n"
        "  max_steps: 2.5\n"
        "  algorithm: sarza\n"
        "motion: 8\n"
        "alpha: 1\n"
        'names: {a: "", b: "1,2", c: 3}\n'
        "reward: {step: true, gaol: 1}\n"
        "segment:\n"
        "resolution_m: 0\n"
    )
    assert complaint(load_scenario, "s.yaml").split("\n") == [
        "s.yaml:2:7: goal: must be a name, [row, column] in whole numbers, or [x, y] in metres with a decimal point, "
        "got 12; quote a name that looks like a number",
        "s.yaml:3:7: seed: must be at least 0, got -1",
        "s.yaml:5:10: learn.alpha: column 5: 'k' does not fit here; one of + - * / ** belongs here",
        "s.yaml:6:3: learn.gama: unknown key; did you mean 'gamma'?",
        "s.yaml:7:10: learn.gamma: must be less than 1, got 1.5",
        "s.yaml:8:12: learn.epsilon: must be finite, got inf",
        "s.yaml:9:3: learn.seed: unknown key; it belongs to the top level, without indentation",
        "s.yaml:10:14: learn.max_steps: must be a whole number, got 2.5",
        "s.yaml:11:14: learn.algorithm: no algorithm is called 'sarza'; did you mean 'sarsa'?",
        "s.yaml:12:9: motion: must hold keys (directions, slip), got 8; leave it out for the defaults",
        "s.yaml:13:1: alpha: unknown key; it belongs into 'learn', as learn.alpha",
        "s.yaml:14:12: names.a: must not be empty",
        "s.yaml:14:19: names.b: must not read as two numbers, got '1,2'",
        "s.yaml:14:29: names.c: must be text, got 3; put text in quotes",
        "s.yaml:15:16: reward.step: must be a number, got true",
        "s.yaml:15:22: reward.gaol: unknown key; did you mean 'goal'?",
        "s.yaml:16:9: segment: must hold keys (min_area_m2), got nothing; leave it out for the defaults",
        "s.yaml:17:15: resolution_m: must be greater than 0, got 0",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "s.yaml:1:1: the file is empty; write at least 'map: MAP FILE' and 'goal: PLACE'"),
        ("- a\n", "s.yaml:1:1: expected keys, got ['a']; write at least 'map: MAP FILE' and 'goal: PLACE'"),
        ("map\n", "s.yaml:1:1: expected keys, got 'map'; write at least 'map: MAP FILE' and 'goal: PLACE'"),
        ("\n\nmap: x\n", "s.yaml:3:1: goal: missing; add a line 'goal: ...'"),
        ("goal: x\nmap: 3\n", "s.yaml:2:6: map: must be text, got 3; put text in quotes"),
        ("goal: x\nmap: ''\n", "s.yaml:2:6: map: must not be empty"),
        ("goal:\nmap: x\n", "goal: must be a name, [row, column]"),
        ("goal: ''\nmap: x\n", "s.yaml:1:7: goal: a place needs a name, got ''"),
        ("goal: [1, 2, 3]\nmap: x\n", "got [1, 2, 3]"),
        ("goal: [true, 2]\nmap: x\n", "got [True, 2]"),
        ("goal: [.inf, 2]\nmap: x\n", "s.yaml:1:7: goal: a point needs two finite numbers, got inf, 2.0"),
        ("map: x\ngoal: y\ngoal: z\n", "s.yaml:3:1: 'goal' was given before, at 2:1; keep one of the two"),
        (LEAST + "seed: 9223372036854775808\n", "seed: must be less than 2**63, got 9223372036854775808"),
        (
            LEAST + f"learn: {{alpha: 1{'0' * 390}}}\n",
            "learn.alpha: must be a number above 0 and at most 1, or a formula in k, got 1000",
        ),
        (LEAST + "motion: {directions: true}\n", "motion.directions: must be 4 or 8, got true"),
        (LEAST + "motion: {slip: 1}\n", "motion.slip: must be less than 1, got 1"),
        (
            LEAST + "learn: {alpha: 0}\n",
            "learn.alpha: must be a number above 0 and at most 1, or a formula in k, got 0",
        ),
        (
            LEAST + "learn: {alpha: 1.1}\n",
            "learn.alpha: must be a number above 0 and at most 1, or a formula in k, got 1.1",
        ),
        (LEAST + "learn: {eta_power: 1}\n", "learn.eta_power: must be greater than 1, got 1"),
        (LEAST + "names: [a]\n", "names: must be a mapping 'name: ...', got ['a']; leave it out for none"),
        (LEAST + f"names: {{a: {'b' * 101}}}\n", "names.a: must have at most 100 characters, got 101"),
        (LEAST + f"names: {{{'b' * 101}: a}}\n", "must have at most 100 characters, got 101"),
    ],
)
def test_wrong_files(write: Any, text: str, said: str) -> None:
    write(text)
    told = complaint(load_scenario, "s.yaml")
    assert said in told
    assert told.startswith("s.yaml:")
    assert "\n" not in told


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "map.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")
    assert "no such scenario file" in complaint(load_scenario, tmp_path / "none.yaml")
    assert "is a folder" in complaint(load_scenario, tmp_path)
    assert "is not a text file" in complaint(load_scenario, tmp_path / "map.png")


def test_the_map_lies_relative_to_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(LEAST)
    scenario = load_scenario(tmp_path / "s.yaml")
    assert scenario.path == tmp_path / "s.yaml"
    assert scenario.map_path == tmp_path / "office.yaml"
    assert scenario.map == "office.yaml"
    assert scenario.with_settings(["map=/maps/other.png"]).map_path == Path("/maps/other.png")
    assert scenario.with_settings(["map=other.png"]).map_path == tmp_path / "other.png"
    assert Scenario(map="m.png", goal=PlaceName("x")).map_path == Path("m.png")


def test_bundled_scenarios_go_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_scenario("office").map_path.name == "office.yaml"
    (tmp_path / "office").write_text("map: mine.yaml\ngoal: here\n")  # but what is there comes first
    assert load_scenario("office").map_path.name == "mine.yaml"
    assert "ofice: no such scenario file" in complaint(load_scenario, "ofice")


def test_scenarios_are_equal_by_their_settings_and_do_not_change(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(LEAST)
    scenario, same = load_scenario(tmp_path / "s.yaml"), Scenario(map="office.yaml", goal=PlaceName("room C"))
    assert scenario == same
    assert hash(scenario) == hash(same)
    assert scenario != scenario.with_settings(["seed=1"])
    assert scenario.with_settings(["goal=[1, 2]"]) != scenario.with_settings(["goal=[1.0, 2.0]"])
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 3  # type: ignore[misc]


def test_settings_from_the_command_line() -> None:
    scenario = Scenario(map="office.yaml", goal=PlaceName("room C"))
    changed = scenario.with_settings(
        [
            "learn.alpha=0.05",
            "start=room B",
            "goal=3.5,2",
            "seed=1",
            "seed=2",
            "names.room 1.5=a.b",
            "made_with.qualrl=x",
        ]
    )
    assert (changed.learn.alpha, changed.seed, changed.start) == (0.05, 2, PlaceName("room B"))
    assert changed.goal == PlaceMetres(3.5, 2.0)
    assert changed.names == {"room 1.5": "a.b"}
    assert changed.made_with == MadeWith(qualrl="x")
    assert changed.learn.gamma == scenario.learn.gamma
    assert changed.with_settings(["start="]).start is None
    assert scenario.with_settings([]) == scenario
    assert scenario.names == {}


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["learn.alhpa=1"], "--set learn.alhpa: unknown key; did you mean 'alpha'?"),
        (["lern.alpha=1"], "--set lern.alpha: lern: unknown key; did you mean 'learn'?"),
        (["alpha=1"], "--set alpha: unknown key; it belongs into 'learn', as learn.alpha"),
        (["learn.goal=1"], "--set learn.goal: unknown key; it belongs into 'reward', as reward.goal"),
        (["learn.gamma=1.5"], "--set learn.gamma: must be less than 1, got 1.5"),
        (
            ["learn.alpha='k'"],
            "--set learn.alpha: must be above 0 and at most 1, but k is 0 at k = 0 (k counts from 0)",
        ),
        (
            ["learn.alpha.x=1"],
            "--set learn.alpha.x: learn.alpha: must be a number above 0 and at most 1, or a formula in k, "
            "got a mapping of 1 keys",
        ),
        (["learn"], "--set learn: expected KEY=VALUE, for example learn.alpha=0.1"),
        (["=3"], "--set =3: expected KEY=VALUE, for example learn.alpha=0.1"),
        (["goal="], "--set goal: must be a name, [row, column] in whole numbers"),
        (["goal=[1"], "--set goal:1:1: this list is not closed"),
        (["seed=x", "goal="], "--set seed: must be a whole number, got 'x'"),
    ],
)
def test_wrong_settings(settings: list[str], said: str) -> None:
    told = complaint(Scenario(map="m", goal=PlaceName("x")).with_settings, settings).split("\n")
    assert any(line.startswith(said) for line in told)
    assert len(told) == len(settings)


NASTY = [
    "no",
    "1e3",
    "a: b",
    "a #b",
    "- a",
    "ü é 😀",
    'say "x"',
    "it's",
    "two\nlines",
    "\\",
    "null",
    "~",
    "0x1F",
    " a ",
]
NASTY += [
    "\u2028\x85\ufeff",
    "[1",
    "{a}",
    "*a",
    "&a",
    "!a",
    "%a",
    "@a",
    "`a",
    "a:",
    "?",
    "12:30",
    "yes",
    "\t",
    "\x7f\0",
]
NAMES = (st.sampled_from(NASTY) | st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)).filter(
    lambda name: name.strip() and isinstance(read_place(name), PlaceName)
)
NUMBERS = st.floats(-1e300, 1e300)
PLACES: st.SearchStrategy[Place] = (
    NAMES.map(PlaceName)
    | st.builds(PlaceCell, st.integers(-(10**9), 10**9), st.integers(-(10**9), 10**9))
    | st.builds(PlaceMetres, NUMBERS, NUMBERS)
)
POSITIVE = st.floats(0, 1e300, exclude_min=True)
COUNTS = st.integers(1, 2**63 - 1)
SHARES = st.floats(0, 1, exclude_max=True)
METRES = st.floats(0.01, 1e9)
CORNERS = st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
ZONES = st.lists(CORNERS, min_size=3, max_size=5).map(lambda corners: Outline(tuple(corners))) | st.builds(
    MaskImage,
    st.text(st.characters(exclude_categories=["Cs"]), min_size=1),
    st.sampled_from(SIDES),
)
SCENARIOS = st.builds(
    Scenario,
    map=st.sampled_from(NASTY) | st.text(st.characters(exclude_categories=["Cs"]), min_size=1),
    start=st.none() | PLACES,
    goal=PLACES,
    seed=st.integers(0, 2**63 - 1),
    names=st.dictionaries(NAMES, NAMES.filter(str.isprintable), max_size=4),
    resolution_m=st.none() | POSITIVE,
    motion=st.builds(MotionSettings, directions=st.sampled_from([4, 8]), slip=SHARES),
    reward=st.builds(RewardSettings, step=POSITIVE.map(lambda paid: -paid), goal=NUMBERS),
    segment=st.builds(SegmentSettings, min_area_m2=st.none() | POSITIVE),
    learn=st.builds(
        LearnSettings,
        algorithm=st.sampled_from(sorted(RULES)),
        episodes=st.integers(1, 10_000_000),
        gamma=SHARES,
        alpha=st.floats(0, 1, exclude_min=True),
        epsilon=st.floats(0, 1),
        max_steps=st.none() | COUNTS,
        eta0=SHARES,
        eta_power=st.floats(1, 1e300, exclude_min=True),
        eta_counter=st.sampled_from(["run", "pair", "episode"]),
    ),
    zones=st.dictionaries(NAMES.filter(str.isprintable), ZONES, max_size=3),
    claims=st.lists(st.sampled_from(["a north of b", "'near it' is not inside \"x\"", "a: b touches #c"]), max_size=3),
    distance=st.builds(lambda near, more: DistanceSettings(near_m=near, far_m=near + more), METRES, METRES),
    made_with=st.none() | st.builds(MadeWith, qualrl=st.none() | st.text(st.characters(exclude_categories=["Cs"]))),
)


@settings(deadline=None)
@given(SCENARIOS)
def test_what_is_dumped_is_read_back(tmp_path_factory: pytest.TempPathFactory, scenario: Scenario) -> None:
    path = tmp_path_factory.getbasetemp() / "round.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario


@settings(deadline=None)
@given(SCENARIOS)
def test_scenarios_fit_the_published_schema(scenario: Scenario) -> None:
    VALIDATOR.validate(json.loads(json.dumps(scenario.model_dump())))


SCHEMA = scenario_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)  # jsonschema.validate would check the schema at each call


def test_the_schema_helps_an_editor() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["required"] == ["map", "goal"]
    assert SCHEMA["additionalProperties"] is False
    for model in [SCHEMA, *SCHEMA["$defs"].values()]:
        assert all(field.get("description") for field in model["properties"].values())
    max_steps = SCHEMA["$defs"]["LearnSettings"]["properties"]["max_steps"]["anyOf"][0]
    assert max_steps["minimum"] == 1


@pytest.mark.parametrize(
    "wrong", [{"learn": {"alpha": 0}}, {"lern": {}}, {"goal": 3}, {"seed": 0.5}, {"names": {"a": ""}}, {"motion": 4}]
)
def test_the_schema_refuses_what_the_reader_refuses(wrong: dict[str, Any]) -> None:
    data = {"map": "m", "goal": "x", **wrong}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, SCHEMA)
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Scenario.model_validate(data)


def test_a_dump_is_readable() -> None:
    text = dump_scenario(Scenario(map="office.yaml", goal=PlaceName("room C"), names={"room A": "no"}))
    assert "\ngoal: room C  # a place" in text
    assert '\n  room A: "no"\n' in text
    assert "\n  alpha: 0.1  # learning rate: a number up to 1, or a formula" in text
    assert "made_with" not in text
    assert max(len(line) for line in text.split("\n")) <= 100


KEYS = [
    "map",
    "goal",
    "start",
    "seed",
    "names",
    "learn",
    "motion",
    "reward",
    "made_with",
    "alpha",
    "episodes",
    "x",
    "",
    "\n",
]
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(KEYS),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4),
    max_leaves=10,
)


@settings(deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=6))
def test_any_mapping_is_a_scenario_or_refused_line_by_line(
    tmp_path_factory: pytest.TempPathFactory, data: dict[str, Any]
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    text = json.dumps(data).replace("-Infinity", "-.inf").replace("Infinity", ".inf").replace("NaN", ".nan")
    path.write_text(text, encoding="utf-8")
    try:
        load_scenario(path)
    except QualrlError as problem:
        positions = [tuple(map(int, line[len(str(path)) + 1 :].split(":")[:2])) for line in str(problem).split("\n")]
        assert positions == sorted(positions)


@settings(deadline=None)
@given(st.text(max_size=30), st.text(max_size=30))
def test_any_setting_is_taken_or_refused(key: str, value: str) -> None:
    scenario = Scenario(map="m", goal=PlaceName("x"))
    for setting in (f"{key}={value}", f"learn.{key}={value}", f"goal={value}", f"names.{key}={value}", key):
        told = "--set"
        try:
            scenario.with_settings([setting])
        except QualrlError as problem:
            told = str(problem)
        assert all(line.startswith("--set") for line in told.split("\n"))
