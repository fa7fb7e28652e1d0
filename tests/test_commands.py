"""The command as a user meets it, on files of its own.

In a process of its own where that may tell: each exit code, each kind of command, signals, the same bytes twice.
The rest is asked of the command in this process (``command_here``), for a process takes seconds to start.
"""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import jsonschema
import networkx as nx
import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from qualrl.commands.main import app
from qualrl.learning.rules import RULES
from tests import command_here, tracing
from tests.worlds import PUZZLE, TWO_ROOMS

ROOT = Path(__file__).parent.parent
SCENARIO = """\
map: rooms.yaml
start: room A
goal: room B
names: {room A: kitchen, door 1: red door}
learn:
  episodes: 300
  alpha: 0.5
"""


def qualrl(*arguments, cwd, expect=0, **environment):
    """Run the command in a process of its own; return (stdout, stderr)."""
    done = subprocess.run(
        [sys.executable, str(ROOT / "cli.py"), *map(str, arguments)],
        cwd=cwd, capture_output=True, text=True, timeout=300, env=tracing.environment_without() | environment,
    )  # fmt: skip
    assert done.returncode == expect, done.stderr
    if expect:
        assert "Traceback" not in done.stderr
    return done.stdout, done.stderr


def draw(folder: Path, name: str, text: str, resolution_m: float = 1.0) -> Path:
    """A ROS map of a drawing."""
    rows = text.strip().splitlines()
    pixels = np.array([[0 if c == "#" else 254 for c in row] for row in rows], np.uint8)
    cv2.imwrite(str(folder / f"{name}.png"), pixels)
    file = folder / f"{name}.yaml"
    file.write_text(
        f"image: {name}.png\nresolution: {resolution_m}\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return file


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a map of two rooms and a scenario on it."""
    draw(tmp_path, "rooms", TWO_ROOMS)
    (tmp_path / "rooms.scenario.yaml").write_text(SCENARIO.replace("room A: kitchen", "room A: kitchen").replace(
        "start: room A", "start: kitchen"))  # fmt: skip
    return tmp_path


def test_run_does_all_of_it(here):
    out, err = qualrl("run", "rooms.scenario.yaml", "-o", "out", "--json", cwd=here)
    document = json.loads(out)
    assert err == ""
    plan = document["plan"]
    assert plan["places"] == ["kitchen", "room B"]
    assert plan["steps"][0]["from"] == "kitchen"
    assert set(plan) >= {"start", "goal", "places", "steps", "path", "length_steps", "length_m", "value"}
    assert set(plan["steps"][0]) >= {"from", "action", "to", "value", "reason"}
    assert "red door" in plan["steps"][0]["action"]
    learned = document["learn"]
    assert set(learned) >= {
        "algorithm", "seed", "episodes", "total_steps", "steps_per_episode", "returns", "optimal_steps",
        "greedy_steps", "max_error", "seconds",
    }  # fmt: skip
    assert learned["greedy_steps"] == learned["optimal_steps"] == plan["length_steps"]
    assert sum(learned["steps_per_episode"]) == learned["total_steps"]
    names = sorted(os.listdir(here / "out"))
    assert names == sorted(Path(file).name for file in document["files"])
    assert json.loads((here / "out/plan.json").read_text()) == plan
    for picture in ("overlay.png", "learning_curve.png"):
        assert min(cv2.imread(str(here / "out" / picture)).shape[:2]) > 300


def test_the_same_command_gives_the_same_bytes_of_plan(here):
    qualrl("run", "rooms.scenario.yaml", "-o", "first", cwd=here)
    command_here.qualrl("run", "rooms.scenario.yaml", "-o", "deep/second", cwd=here)  # strings hash otherwise here
    command_here.qualrl("run", "first/scenario.yaml", "-o", "third", cwd=here)
    plan = (here / "first/plan.json").read_bytes()
    assert (here / "deep/second/plan.json").read_bytes() == plan
    assert (here / "third/plan.json").read_bytes() == plan
    copy = yaml.safe_load((here / "first/scenario.yaml").read_text())
    assert len(copy["made_with"]["map_sha256"]) == 64
    assert copy["made_with"]["qualrl"] == "0.1.0"
    assert copy["seed"] == 0


def test_convert_writes_files_that_other_tools_read(here):
    out, _ = qualrl("convert", "rooms.yaml", "-o", "out", "--json", cwd=here)
    document = json.loads(out)
    pixels = cv2.imread(str(here / "out/regions.png"), cv2.IMREAD_UNCHANGED)
    assert pixels.dtype == np.uint16
    drawn = np.array([list(row) for row in TWO_ROOMS.strip().splitlines()])
    np.testing.assert_array_equal(pixels == 0, drawn == "#")
    assert pixels.max() == len(document["regions"]) == 2
    for number, region in enumerate(document["regions"], 1):
        assert region["cells"] == (pixels == number).sum()
        assert region["area_m2"] == pytest.approx(region["cells"])
    graph = nx.node_link_graph(json.loads((here / "out/graph.json").read_text()), edges="edges")
    markup = nx.read_graphml(here / "out/graph.graphml", force_multigraph=True)
    assert set(graph) == set(markup) == {region["name"] for region in document["regions"]}
    assert sorted(graph.edges(keys=True)) == sorted(markup.edges(keys=True))
    assert len(document["edges"]) == 2 * len(document["doorways"]) == graph.number_of_edges()
    door = document["doorways"][0]
    assert door["between"] == ["room A", "room B"]
    assert door["cells"] == [[4, 9]]
    assert door["width_m"] == pytest.approx(1.0)
    assert set(document["landmarks"][0]) >= {"name", "kind", "cell"}
    ready, _ = command_here.qualrl("run", "out/scenario.yaml", "-o", "ran", "--json", cwd=here)
    assert json.loads(ready)["plan"]["places"] == ["room A", "room B"]


def test_results_of_a_converted_map_are_named_after_its_folder(here):
    for folder in ("lab", "hall"):
        command_here.qualrl("convert", "rooms.yaml", "-o", folder, cwd=here)
    command_here.qualrl("run", "lab/scenario.yaml", cwd=here)
    command_here.qualrl("run", "scenario.yaml", cwd=here / "hall")
    assert (here / "results/lab/training.npz").exists()
    assert (here / "hall/results/hall/training.npz").exists()
    _, err = command_here.qualrl("plan", "results/lab", "--from", "room A", "--to", "room B", cwd=here)
    assert "nothing has been learned" not in err


def test_a_scenario_among_results_is_not_written_over(here):
    command_here.qualrl("convert", "rooms.yaml", cwd=here)
    file = here / "results/rooms/scenario.yaml"
    edited = "# mine\n" + file.read_text()
    file.write_text(edited)
    command_here.qualrl("run", "results/rooms/scenario.yaml", cwd=here)
    assert file.read_text() == edited
    assert (here / "results/rooms/run/training.npz").exists()


def test_show_tells_the_same_of_map_and_scenario(here):
    of_map = json.loads(command_here.qualrl("show", "rooms.yaml", "--json", cwd=here)[0])
    of_scenario = json.loads(command_here.qualrl("show", "rooms.scenario.yaml", "--json", cwd=here)[0])
    assert [region["name"] for region in of_map["regions"]] == ["room A", "room B"]
    assert [region["name"] for region in of_scenario["regions"]] == ["kitchen", "room B"]
    (door,) = of_map["doorways"]
    assert door["midpoint"] in door["cells"]
    assert door["ends"][0] in door["cells"]
    x_m, y_m = door["midpoint_m"]
    assert [region["shape"]["degree"] for region in of_map["regions"]] == [1, 1]
    assert of_scenario["wings"] == {"wing A": ["kitchen", "room B"]}
    text, _ = qualrl("show", "rooms.yaml", cwd=here)
    assert f"{x_m:.2f},{y_m:.2f}" in text
    assert "room A" in text
    assert "19 x 9 cells" in text
    assert "8 corner, 2 centre" in text
    assert "\x1b" not in text


def test_route_tells_the_way_from_region_to_region(here):
    told, _ = qualrl("route", "rooms.yaml", "--from", "room A", "--to", "room B", cwd=here)
    asked = "route", "rooms.yaml", "--from", "room A", "--to", "room B", "--json"
    way = json.loads(command_here.qualrl(*asked, cwd=here)[0])
    assert way["regions"] == ["room A", "room B"]
    assert way["doors"] == ["door 1"]
    assert told.splitlines()[0] == f"from room A to room B: {way['steps']} steps, {way['length_m']:.2f} m"
    assert told.splitlines()[1:] == ["  in room A", "  through door 1 into room B"]
    for (row, column), (after_row, after_column) in itertools.pairwise(way["path"]):
        assert abs(row - after_row) + abs(column - after_column) == 1
    assert len(way["path"]) == way["steps"] + 1
    asked = "route", "rooms.scenario.yaml", "--from", "kitchen", "--to", "room B", "--json"
    named = json.loads(command_here.qualrl(*asked, cwd=here)[0])
    assert named["doors"] == ["red door"]
    assert named["steps"] == way["steps"]


def test_a_route_that_cannot_be_is_refused_in_one_line(here):
    for asked, told in (
        (("--from", "room A", "--to", "room X"), "room X"),
        (("--from", "room A"), "--to"),
        (("--from", "room A", "--to", "99,99"), "99"),
        (("--from", "room A", "--to", "room B", "--robot-radius", "40"), "--robot-radius"),
    ):
        out, err = command_here.qualrl("route", "rooms.yaml", *asked, cwd=here, expect=2)
        assert out == ""
        assert told in err
        assert len(err.splitlines()) == 1


def test_show_lists_wings(here):
    """Two corridors with four rooms each, and a door between them."""
    rooms = ["#" + 8 * ("." * 12 + "#")] * 13 + ["#" + 8 * "#####..######"]
    corridors = ["#" + "." * 51 + middle + "." * 51 + "#" for middle in "##..#"]
    draw(here, "wings", "\n".join(["#" * 105, *rooms, *corridors, "#" * 105]), 0.3)
    told, _ = command_here.qualrl("show", "wings.yaml", cwd=here)
    assert [line for line in told.splitlines() if line.startswith("wing ")] == [
        "wing A: room A, room C, room E, room G, corridor 1",
        "wing B: room B, room D, room F, room H, corridor 2",
    ]


def test_learn_then_plan_from_its_folder(here):
    out, _ = qualrl("learn", "rooms.scenario.yaml", "-o", "out", "--seed", 3, "--episodes", 500, "--algorithm",
                    "q-learning", "--set", "learn.alpha=0.25", "--json", cwd=here)  # fmt: skip
    document = json.loads(out)
    assert (document["seed"], document["episodes"], document["algorithm"]) == (3, 500, "q-learning")
    assert document["settings"]["alpha"] == 0.25
    learned = json.loads(qualrl("plan", "out", "--json", cwd=here)[0])
    assert learned["source"] == "q-learning"
    exact = json.loads(command_here.qualrl("plan", "out", "--exact", "--json", cwd=here)[0])
    assert exact["source"] == "exact"
    assert exact["length_steps"] == learned["length_steps"]
    back = json.loads(command_here.qualrl("plan", "out", "--from", "room B", "--to", "kitchen", "--json", cwd=here)[0])
    assert back["places"] == ["room B", "kitchen"]
    assert back["source"] == "exact"


def test_places_are_names_landmarks_metres_or_cells(here):
    # origin 1, 2 and 9 rows of 1 m: the centre of row 4, column 9 is x = 10.5, y = 2 + 4.5
    for place in ("4,9", "10.5,6.5", "door 1"):
        asked = "plan", "rooms.scenario.yaml", "--from", place, "--set", "names={}", "--set", "start=room A", "--json"
        out, err = command_here.qualrl(*asked, cwd=here)
        assert json.loads(out)["path"][0] == [4, 9]
        assert "nothing has been learned" in err


def test_quiet_says_nothing_and_json_goes_nowhere_else(here):
    out, err = command_here.qualrl("run", "rooms.scenario.yaml", "-o", "out", "--quiet", cwd=here)
    assert (out, err) == ("", "")


def test_learners_are_listed_with_what_they_converge_to(here):
    rows = json.loads(command_here.qualrl("learners", "--json", cwd=here)[0])["learners"]
    assert [row["name"] for row in rows] == list(RULES)
    told, _ = qualrl("learners", cwd=here, COLUMNS="60")  # columns narrower than some words
    assert "…" not in told
    assert all(row["name"] in told for row in rows)


def test_schema_accepts_the_bundled_scenarios_and_refuses_others(here):
    schema = json.loads(command_here.qualrl("schema", "--json", cwd=here)[0])
    jsonschema.Draft202012Validator.check_schema(schema)
    for file in sorted((ROOT / "maps").glob("*.scenario.yaml")):
        jsonschema.validate(yaml.safe_load(file.read_text()), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"map": "m.png", "goal": "room A", "gaol": 1}, schema)


def test_bundled_scenarios_are_found_by_name(here):
    by_name = json.loads(command_here.qualrl("show", "puzzle", "--json", cwd=here)[0])
    by_path = json.loads(command_here.qualrl("show", ROOT / "maps/puzzle.scenario.yaml", "--json", cwd=here)[0])
    assert by_name["regions"] == by_path["regions"]


WRONG = {
    "no such scenario file": ("run", "nothing.yaml"),
    "did you mean 'gamma'": ("run", "unknown-key.yaml"),
    "unknown-key.yaml:4:3: learn.gama": ("run", "unknown-key.yaml"),
    "did you mean 'room B'": ("plan", "rooms.scenario.yaml", "--to", "rom B"),
    "in a wall": ("plan", "rooms.scenario.yaml", "--from", "0,0"),
    "outside the map": ("plan", "rooms.scenario.yaml", "--from", "0,500"),
    "empty": ("run", "empty.yaml"),
    "no pixel is free": ("convert", "black.png"),
    "holds no hybrid_mdp.npz": ("plan", "."),
    "--set learn.alhpa": ("learn", "rooms.scenario.yaml", "--set", "learn.alhpa=1"),
    "must be": ("learn", "rooms.scenario.yaml", "--episodes", "0"),
    "is a map, not a scenario; 'qualrl convert rooms.yaml'": ("run", "rooms.yaml"),
    "is a scenario, not a map": ("convert", "rooms.scenario.yaml"),
    "--set goal: no place is called 'lab'": ("run", "rooms.scenario.yaml", "--set", "goal=lab"),
    "rooms.scenario.yaml:2:8: start: no place is called": ("run", "rooms.scenario.yaml", "--set", "names={}"),
    "start and goal are the same": ("learn", "rooms.scenario.yaml", "--set", "start=room B"),
    "qualrl: --episodes: must be at least 1, got -3": ("run", "rooms.scenario.yaml", "--episodes", "-3"),
    "--set learn.planning_steps: must be at most": ("run", "puzzle", "--set", "learn.planning_steps=1e12"),
    "--set names: 'S8' is a landmark of this scenario": ("run", "puzzle", "--set", "names={S8: gate}"),
    "no bundled scenario; did you mean 'office'?": ("run", "ofice"),
    "missing argument 'SCENARIO'": ("run",),
    "what begins with - goes after --": ("prove", "schedule", "-1/(1+k)"),
    "printable": ("run", "rooms.scenario.yaml", "--set", 'names={room A: "A\\x1b]0;x"}'),
    "values would exceed": ("run", "rooms.scenario.yaml", "--set", "reward.step=-1e308"),
    "resolution must be": ("convert", "rooms.png", "--resolution", "1e-320"),
    "--size: '600' is not WIDTHxHEIGHT": ("convert", "rooms.png", "--size", "600"),
    "each side must be from 200": ("run", "rooms.scenario.yaml", "--size", "10x400"),
    "no such command 'lern'": ("lern",),
    "no such option: --hurry": ("run", "--hurry"),
}


@pytest.mark.parametrize("expected", WRONG)
def test_bad_input_is_one_clear_line_and_exit_code_2(here, expected):
    (here / "unknown-key.yaml").write_text("map: rooms.yaml\ngoal: room B\nlearn:\n  gama: 0.9\n")
    (here / "empty.yaml").write_text("")
    cv2.imwrite(str(here / "black.png"), np.zeros((5, 5), np.uint8))
    before = sorted(os.listdir(here))
    out, err = command_here.qualrl(*WRONG[expected], cwd=here, expect=2)
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1
    assert sorted(os.listdir(here)) == before


@pytest.mark.parametrize("words", [(), ("prove",)])
def test_a_command_line_that_asks_for_nothing_is_shown_the_help(here, words):
    assert qualrl(*words, cwd=here, expect=2)[1] == qualrl(*words, "--help", cwd=here)[0]


def test_every_mistake_in_a_scenario_is_told_at_once(here):
    (here / "bad.yaml").write_text("map: 7\ngaol: room B\nlearn:\n  gamma: 1.5\n  alpha: fast\n")
    _, err = command_here.qualrl("run", "bad.yaml", cwd=here, expect=2)
    assert [line for line in ("bad.yaml:1:", "bad.yaml:2:1", "bad.yaml:4:", "bad.yaml:5:") if line not in err] == []
    assert "did you mean 'goal'" in err


def test_no_plan_is_exit_code_1_and_leaves_no_folder(here):
    draw(here, "islands", "#######\n#..#..#\n#..#..#\n#######")
    (here / "islands.scenario.yaml").write_text("map: islands.yaml\nstart: [1, 1]\ngoal: [1, 5]\n")
    _, err = qualrl("run", "islands.scenario.yaml", "-o", "out", cwd=here, expect=1)
    assert "no way leads" in err
    assert not (here / "out").exists()


def test_our_fault_is_exit_code_3_and_debug_shows_where(here, tmp_path, monkeypatch):
    plant = tmp_path / "sitecustomize.py"
    plant.write_text(
        "import sys\nclass Broken:\n    def find_spec(self, name, *rest):\n"
        "        if name == 'qualrl.spatial.segmentation':\n            raise RuntimeError('planted')\n"
        "sys.meta_path.insert(0, Broken())\n"
    )
    _, err = qualrl("show", "rooms.yaml", cwd=here, expect=3, PYTHONPATH=str(tmp_path))
    assert "our fault: RuntimeError: planted" in err
    monkeypatch.setitem(sys.modules, "qualrl.commands.documents", None)
    done = CliRunner().invoke(app, ["show", str(here / "rooms.yaml"), "--debug"])
    assert done.exit_code == 3
    assert "Traceback" in done.stderr
    assert "our fault: ModuleNotFoundError" in done.stderr


def test_output_is_never_half_written(here):
    (here / "taken").write_text("mine")
    _, err = qualrl("run", "rooms.scenario.yaml", "-o", "taken", cwd=here, expect=2)
    assert "is a file" in err
    assert (here / "taken").read_text() == "mine"
    assert not [name for name in os.listdir(here) if name.endswith(".part")]


def test_names_from_a_scenario_cannot_leave_the_folder_or_break_markup(here, monkeypatch):
    nasty = "<script>[bold]../../x\\ \" '"
    text = SCENARIO.replace("kitchen", json.dumps(nasty)).replace("start: room A", f"start: {json.dumps(nasty)}")
    (here / "nasty.yaml").write_text(text)
    monkeypatch.setenv("COLUMNS", "200")
    document = json.loads(command_here.qualrl("run", "nasty.yaml", "-o", "out", "--json", cwd=here)[0])
    assert document["plan"]["places"][0] == nasty
    assert nasty in command_here.qualrl("show", "nasty.yaml", cwd=here)[0]
    assert nasty in nx.read_graphml(here / "out/graph.graphml")
    assert sorted(os.listdir(here)) == ["nasty.yaml", "out", "rooms.png", "rooms.scenario.yaml", "rooms.yaml"]


def test_results_of_an_earlier_command_do_not_mix_with_new_ones(here):
    command_here.qualrl("run", "rooms.scenario.yaml", "-o", "out", cwd=here)
    (here / "out" / "mine.txt").write_text("kept")
    command_here.qualrl("convert", "rooms.yaml", "-o", "out", cwd=here)
    left = set(os.listdir(here / "out"))
    assert "mine.txt" in left
    assert not left & {"training.npz", "learn.json", "learning_curve.png", "plan.json"}


def test_conflicts_in_the_output_folder_are_told_before_learning(here):
    (here / "out" / "plan.json").mkdir(parents=True)
    asked = "run", "rooms.scenario.yaml", "-o", "out", "--episodes", 9_000_000
    _, err = command_here.qualrl(*asked, cwd=here, expect=2)
    assert "holds a folder 'plan.json'" in err


def test_being_told_to_stop_leaves_nothing_behind(here):
    process = subprocess.Popen(
        [sys.executable, str(ROOT / "cli.py"), "run", "rooms.scenario.yaml", "-o", "a/b", "--episodes", "9000000"],
        cwd=here, stderr=subprocess.PIPE,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not (here / "a").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert (here / "a").exists()
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 143
    assert not (here / "a").exists()


SOLVING = """
from qualrl.solving.exact import exact_values
office = qualrl.load_scenario("office").with_settings(["motion.slip=0.75", "learn.gamma=0.99999"]).build()
exact_values(qualrl.load_scenario("puzzle").with_settings(["motion.slip=0.7"]).build().world)
print("at it", flush=True)
exact_values(office.world)
"""
LEARNING = """
puzzle = qualrl.load_scenario("puzzle").build()
qualrl.train(puzzle, algorithm="dyna-q", episodes=1)
print("at it", flush=True)
qualrl.train(puzzle, algorithm="dyna-q", episodes=100_000, planning_steps=100_000)
"""
SEEDS = LEARNING.replace("train(puzzle, algorithm", "train_seeds(puzzle, 9, algorithm")


@pytest.mark.parametrize("work", [SOLVING, LEARNING, SEEDS], ids=["solving", "learning", "seeds"])
def test_ctrl_c_is_answered_at_once(work):
    """Both would go on for a while; what they need is compiled before they say that they are at it."""
    with subprocess.Popen(
        [sys.executable, "-c", "import qualrl\n" + work], cwd=ROOT, text=True, env=tracing.environment_without(),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "at it\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=1)
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert time.monotonic() - begun < 5
    assert err.endswith("KeyboardInterrupt\n")


def test_a_reader_who_has_gone_is_no_failed_check(here):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as gone:
        done = subprocess.run(
            [sys.executable, str(ROOT / "cli.py"), "show", "rooms.yaml"], cwd=here, stdout=gone, stderr=subprocess.PIPE,
            text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (141, "")


def test_puzzle_drawing_of_the_tests_is_the_bundled_map():
    pixels = cv2.imread(str(ROOT / "maps/puzzle.png"), cv2.IMREAD_GRAYSCALE)
    drawn = np.array([list(row) for row in PUZZLE.strip().splitlines()])
    np.testing.assert_array_equal(pixels == 0, drawn == "#")
