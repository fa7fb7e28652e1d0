"""``qualrl prove schedule``, as a user meets it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from qualrl.commands.main import app
from qualrl.commands.prove import COUNTERS, _show
from tests import tracing

ROOT = Path(__file__).parent.parent
SCENARIO = "map: nowhere.png\ngoal: [1, 1]\nlearn: {{algorithm: {algorithm}, alpha: {alpha}, eta_counter: {counter}}}\n"


def proved(*arguments, expect):
    """Run the command in this process; return (stdout, stderr)."""
    done = CliRunner().invoke(app, ["prove", "schedule", *map(str, arguments)])
    assert done.exit_code == expect, done.output
    return done.stdout, done.stderr


def scenario(folder, algorithm="hql", alpha="0.05", counter="run"):
    """A scenario file; proving never opens its map."""
    file = folder / "my.scenario.yaml"
    file.write_text(SCENARIO.format(algorithm=algorithm, alpha=alpha, counter=counter))
    return file


def test_a_formula_in_a_process_of_its_own():
    done = subprocess.run(
        [sys.executable, ROOT / "cli.py", "prove", "schedule", "1/(1+k)**0.6"], capture_output=True, text=True,
        check=False, env=tracing.environment_without(),
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert "sum of alpha_k = infinity: holds" in done.stdout
    assert "sum of alpha_k**2 < infinity: holds" in done.stdout
    assert "the exponent of k is 6/5 > 1: a_k * k**(11/10) tends to 0" in done.stdout
    assert "Theorem 2's conditions on the learning rate hold" in done.stdout


def test_a_range_as_json_and_for_people(capsys):
    out, err = proved("1/(1+k)**w", "--json", expect=1)
    document = json.loads(out)
    assert err == ""
    assert document["range"] == "1/2 < w <= 1"
    assert document["holds"] == document["sum_diverges"] == document["squares_converge"] == "undecided"
    line = "the exponent is w: the sum converges for 1 < w, and diverges for every other w > 0"
    assert document["sum_lines"] == [line]
    assert document["landmark_weights"] is None
    _show(document)
    shown = capsys.readouterr().out
    assert f"sum of alpha_k = infinity: for some values\n  {line}\n" in shown
    assert "Theorem 2 applies for 1/2 < w <= 1, and for no other positive value" in shown


def test_a_constant_is_told_what_it_means():
    out, _ = proved("0.01", expect=1)
    assert "sum of alpha_k = infinity: holds" in out
    assert "sum of alpha_k**2 < infinity: FAILS" in out
    assert "alpha 0.01 is constant" in out
    assert "The paper's own experiments" in out
    assert proved("0.01", "--quiet", expect=1) == ("", "")


def test_a_proof_says_when_a_learner_would_refuse_the_formula():
    out, _ = proved("1/k", expect=0)
    assert "a learner would refuse this: alpha: 1/k: has no finite value at k = 0" in out


@pytest.mark.parametrize("counter", COUNTERS)
def test_a_scenario_brings_its_landmark_weights(tmp_path, counter):
    out, _ = proved(scenario(tmp_path, counter=counter), "--json", expect=1)
    document = json.loads(out)
    assert (document["alpha"], document["squares_converge"]) == ("0.05", "refuted")
    weights = document["landmark_weights"]
    assert weights["total"] == [pytest.approx(0.231151608)] * 2
    assert weights["kept"] == [pytest.approx(0.787033107)] * 2
    assert weights["verdict"] == ("refuted" if counter == "episode" else "proved")
    out, _ = proved(tmp_path / "my.scenario.yaml", expect=1)
    assert COUNTERS[counter] in out


def test_q_learning_has_no_landmark_weights(tmp_path):
    document = json.loads(proved(scenario(tmp_path, algorithm="q-learning"), "--json", expect=1)[0])
    assert document["landmark_weights"] is None


def test_a_bundled_scenario_is_found_by_name():
    out, _ = proved("puzzle", expect=1)
    assert "alpha_k = 0.01" in out
    assert "0.1**(1.2**n)" in out


WRONG = {
    "column 1: '_' has no place in a formula": "__import__('os')",
    "column 4: unknown name 'K'": "1/(K+1)",
    "did you mean 'office'?": "ofice",
    "neither a formula in k nor a scenario": "w*3",
    "no such scenario file": "nothing.yaml",
    "longer than 200 characters": "k" * 300,
}


@pytest.mark.parametrize("expected", WRONG)
def test_bad_input_is_one_clear_line_and_exit_code_2(expected):
    out, err = proved(WRONG[expected], expect=2)
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1


def test_help_stays_light():
    code = "import sys; import qualrl.commands.main; sys.exit(bool({'numpy', 'sympy', 'mpmath'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
