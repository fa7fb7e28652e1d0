"""What the README shows is what happens: its Python runs, its commands print what it says they print."""

import doctest
import re
import shlex
from pathlib import Path

import pytest
import yaml

from qualrl.io.scenario import Scenario
from tests import command_here

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def test_python_blocks_run(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    namespace: dict[str, object] = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), namespace)
    assert "room C" in capsys.readouterr().out


@pytest.mark.parametrize("block", blocks("console"))
def test_commands_print_what_is_shown(block, tmp_path, monkeypatch):
    command, expected = block.split("\n", 1)
    assert command.startswith("$ qualrl ")
    monkeypatch.setenv("COLUMNS", "100")
    told = "".join(command_here.qualrl(*shlex.split(command)[2:], cwd=tmp_path, expect=None))
    assert doctest.OutputChecker().check_output(expected, told, doctest.ELLIPSIS), told


def test_the_scenario_shown_is_valid():
    (block,) = blocks("yaml")
    Scenario.model_validate(yaml.safe_load(block))


def test_files_that_are_named_exist():
    for name in re.findall(r"\]\(([^)h][^)]*)\)", TEXT):
        assert (ROOT / name).is_file(), name
