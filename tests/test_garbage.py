"""What a process that loaded numba leaves alone when it ends, and what it does not."""

import subprocess
import sys

import pytest

from tests import tracing

PROCESS = """
import atexit, gc
atexit.register(lambda: print(gc.get_freeze_count() > 0))  # after what is registered later
import qualrl.kernels
{rest}
"""
OPEN_FILE = """
class Log:
    def __init__(self, path):
        self.file = open(path, "w")
        self.told = self.file.write, self
        self.file.write("the last words")
kept = Log({path!r})
"""
WAITS = """
class Waits:
    def __init__(self):
        self.me = self
    def __del__(self):
        print("ended")
kept = Waits()
"""
GENERATOR = """
def counting():
    me = yield
    try:
        yield me
    finally:
        print("ended")
kept = counting()
next(kept)
kept.send(kept)
"""
NEVER_BEGAN = """
import contextlib
@contextlib.contextmanager
def block():
    yield
@block()
def inside():
    pass
"""
ODD_CLASS = """
class Odd(type):
    def __getattr__(cls, name):
        raise RuntimeError("not to be asked")
kept = Odd("OddThing", (), {"x": 1})()
kept.me = kept
"""


def output_of(rest: str) -> list[str]:
    code = PROCESS.format(rest=rest)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=tracing.environment_without()
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


@pytest.mark.parametrize("rest", ["", NEVER_BEGAN])
def test_what_is_left_goes_with_the_process(rest):
    assert output_of(rest) == ["True"]


@pytest.mark.parametrize("rest", [WAITS, GENERATOR])
def test_who_waits_for_its_end_is_told(rest):
    assert output_of(rest) == ["False", "ended"]


def test_an_open_file_is_written_to_its_end(tmp_path):
    path = tmp_path / "log.txt"
    assert output_of(OPEN_FILE.format(path=str(path))) == ["False"]
    assert path.read_text() == "the last words"


def test_nothing_is_said_where_a_class_cannot_be_asked():
    assert output_of(ODD_CLASS) == ["False"]


def test_threads_of_linear_algebra_do_not_wait_busily_unless_they_are_told_to():
    asked = "import os, qualrl; print(os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    for given, used in (({}, "20"), ({"OPENBLAS_THREAD_TIMEOUT": "26"}, "26")):
        environment = {k: v for k, v in tracing.environment_without().items() if k != "OPENBLAS_THREAD_TIMEOUT"}
        done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, env=environment | given)
        assert done.stdout.split() == [used]
