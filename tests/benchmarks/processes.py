"""Processes of their own for what is measured: CPU seconds and the most memory they ever had (Linux only)."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Finished:
    """A process that has ended well."""

    cpu_s: float
    """Of all its threads and children, user and system."""
    output: str


class ProcessError(Exception):
    """A process that failed or was given up; says why in a few words."""


def run(command: Sequence[str], environment: Mapping[str, str] | None = None, most_s: float | None = None) -> Finished:
    """Run a command to its end, with byte code kept, as Python does unless told otherwise.

    Raises ProcessError with the last line it wrote, or when it takes too long.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=most_s,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "", **(environment or {})},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ProcessError(f"not done after {most_s} s") from None
    if done.returncode:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        raise ProcessError(lines[-1][:80] if lines else f"exit code {done.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Finished(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, done.stdout)


def run_python(code: str, environment: Mapping[str, str] | None = None) -> Finished:
    """Run some Python code in a process of its own."""
    return run([sys.executable, "-c", code], environment)


def apart(work: Callable[Arguments, Result], *arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
    """What a function returns in a fresh process."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(work, *arguments, **named).result()


def peak_mb() -> float:
    """Most memory that this process ever had, in MiB; ``getrusage`` would count what its parent had too."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024
