"""``qualrl warmup`` leaves nothing to compile: what the commands then run has been compiled, for the same types."""

import subprocess
import sys
from pathlib import Path

from qualrl.learning.rules import RULES
from tests.tracing import environment_without

COUNTED = """
import pkgutil, sys
from importlib import import_module
from numba.core.dispatcher import Dispatcher
import qualrl.kernels
from typer.testing import CliRunner
from qualrl.commands.main import app

def compiled():
    names = [module.name for module in pkgutil.iter_modules(qualrl.kernels.__path__)]
    modules = [import_module(f"qualrl.kernels.{name}") for name in names]
    loops = {id(loop): loop for module in modules for loop in vars(module).values() if isinstance(loop, Dispatcher)}
    return {(loop.py_func.__qualname__, str(types)) for loop in loops.values() for types in loop.signatures}

def run(*arguments):
    done = CliRunner().invoke(app, list(arguments))
    assert done.exit_code == 0, (arguments, done.output, done.exception)

warmed = sys.argv[2] == "warmed"
if warmed:
    run("warmup", "--quiet")
before = compiled()
for arguments in sys.argv[3:]:
    run(*arguments.split(), "-q", *(("-o", sys.argv[1]) if arguments.startswith(("learn", "run", "convert")) else ()))
print(len(before), sorted(compiled() - before))
"""


def compiled_later(folder, *calls, warmed="warmed"):
    """How many loops were compiled before, and which the calls of the command compile then."""
    done = subprocess.run(
        [sys.executable, "-c", COUNTED, str(folder / "out"), warmed, *calls],
        cwd=Path(__file__).parent.parent, capture_output=True, text=True, timeout=600,
        env=environment_without(),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    count, later = done.stdout.split(" ", 1)
    return int(count), later.strip()


def test_after_a_warmup_no_command_compiles_anything(tmp_path):
    calls = [f"learn puzzle --algorithm {name} --episodes 2" for name in RULES]
    calls += ["run office --episodes 5", "convert clinic", "learn slam --online --episodes 1"]
    calls += ["why clinic", "what-if puzzle --slip 0.1", "summary slam", "which-matters office", "envision puzzle"]
    count, later = compiled_later(tmp_path, *calls)
    assert count > 60
    assert later == "[]"


def test_without_it_something_is_compiled(tmp_path):
    count, later = compiled_later(tmp_path, "learn puzzle --algorithm td --episodes 2", warmed="cold")
    assert count == 0
    assert "pieces" in later
