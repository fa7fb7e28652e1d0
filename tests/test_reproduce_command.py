"""``qualrl reproduce`` as a user meets it: whole files, one table, exit codes."""

import json
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner

from qualrl import __version__
from qualrl.commands.main import app
from qualrl.studies.settings import STUDIES, StudySettings, load_study

VERDICTS = ("reproduced", "not reproduced", "depends on a reading (", "not measured")


@pytest.fixture(autouse=True)
def few_looks(monkeypatch):
    """Studies as they are, but for how often a policy is judged on the way, which costs more than learning it."""

    def seldom(name: str) -> StudySettings:
        chosen = load_study(name)
        budget = chosen.budget and chosen.budget.model_copy(update={"looks_per_tenfold": 2, "even_looks": 2})
        return chosen.model_copy(update={"budget": budget})

    monkeypatch.setattr("qualrl.studies.study.load_study", seldom)


def reproduce(*arguments, expect=0):
    """Run the command in this process; the numbers are of no interest here, so runs are short."""
    done = CliRunner().invoke(app, ["reproduce", *map(str, arguments)])
    assert done.exit_code == expect, done.output
    return done


@pytest.mark.parametrize("figure", STUDIES)
def test_each_figure_writes_whole_files(figure, tmp_path: Path):
    target = tmp_path / "deep" / "out"
    done = reproduce(figure, "--seeds", 2, "--episodes", 60, "-o", target, "--json")
    document = json.loads(done.stdout)
    assert done.stderr == ""
    assert document["figure"] == figure
    assert document["seeds"] == [0, 1]
    assert document["qualrl"] == __version__
    drawn = [f"{figure}.png"] if document["settings"]["picture"] else []
    assert sorted(path.name for path in target.iterdir()) == sorted([f"{figure}.json", *drawn, "table.md"])
    assert document.pop("files") == [str(target / name) for name in (f"{figure}.json", *drawn, "table.md")]
    assert json.loads((target / f"{figure}.json").read_text()) == document
    for claim in document["claims"]:
        assert claim["verdict"].startswith(VERDICTS)
        assert claim["says"] in (target / "table.md").read_text()
    for cell in document["measured"]:
        spread = cell["env_steps" if document["settings"]["budget"] else "converged"]
        assert spread["low"] <= spread["median"] <= spread["high"]
    for name in drawn:
        assert min(cv2.imread(str(target / name)).shape[:2]) > 400
    assert {path.name for path in target.parent.iterdir()} == {"out"}


@pytest.mark.no_cover  # each study alone goes through the same lines
def test_all_ends_with_one_table_over_all_figures(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    done = reproduce("all", "--seeds", 2, "--episodes", 30)
    folder = tmp_path / "results" / "reproduce" / "all"
    names = {path.name for path in folder.iterdir()}
    assert names == {f"{name}.{ending}" for name in STUDIES for ending in ("json", "png")} | {"table.md"}
    table = (folder / "table.md").read_text()
    for name in STUDIES:
        assert f"\n| {name.removeprefix('fig')} " in table
        for claim in json.loads((folder / f"{name}.json").read_text())["claims"]:
            assert claim["says"] in table
    assert "paper says" in done.stdout
    assert "not reproduced" in done.stdout
    assert "36 steps" in done.stdout
    assert done.stderr == ""


def test_quiet_says_nothing_and_the_same_command_gives_the_same_numbers(tmp_path: Path):
    documents = []
    for threads in (1, 3):
        out = tmp_path / str(threads)
        done = reproduce("fig11", "--seeds", 3, "--episodes", 80, "--threads", threads, "-o", out, "--quiet")
        assert done.output == ""
        documents.append(json.loads((out / "fig11.json").read_text()))
        documents[-1].pop("seconds")
    assert documents[0] == documents[1]


def test_bad_input_is_one_line_and_leaves_nothing(tmp_path: Path):
    done = reproduce("fig6", "-o", tmp_path / "out", expect=2)
    assert done.stderr.startswith("qualrl: no study is called 'fig6'; did you mean 'fig")
    assert done.stderr.count("\n") == 1
    reproduce("fig7", "--seeds", 1, "-o", tmp_path / "out", expect=2)
    reproduce("fig7", "--seeds", "many", "-o", tmp_path / "out", expect=2)
    (tmp_path / "file").write_text("")
    taken = reproduce("fig9", "-o", tmp_path / "file", expect=2)
    assert "is a file" in taken.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_fails_midway_leaves_nothing(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("qualrl.studies.pictures.draw_study", lambda study, file: 1 / 0)
    done = reproduce("fig9", "--seeds", 2, "--episodes", 9, "-o", tmp_path / "out", expect=3)
    assert "our fault" in done.stderr
    assert list(tmp_path.iterdir()) == []
