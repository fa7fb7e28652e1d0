"""The command in this process, for tests of what it says; test_commands runs it as a user does, a process a call.

A process takes seconds to start, most of a test that asks for one line.
"""

import contextlib
import io
import signal
import sys
from pathlib import Path
from unittest import mock

import pytest

from qualrl.commands.main import main


def qualrl(*arguments: object, cwd: Path, expect: int | None = 0) -> tuple[str, str]:
    """Run the command; return (stdout, stderr).  ``expect`` None stands for any exit code."""
    told, noted, at_sigterm = io.StringIO(), io.StringIO(), signal.getsignal(signal.SIGTERM)
    with (
        contextlib.chdir(cwd), mock.patch.object(sys, "argv", ["qualrl", *map(str, arguments)]),
        contextlib.redirect_stdout(told), contextlib.redirect_stderr(noted), pytest.raises(SystemExit) as ended,
    ):  # fmt: skip
        main()
    signal.signal(signal.SIGTERM, at_sigterm)
    assert expect in (ended.value.code or 0, None), noted.getvalue()
    if expect != 0:
        assert "Traceback" not in noted.getvalue()
    return told.getvalue(), noted.getvalue()
