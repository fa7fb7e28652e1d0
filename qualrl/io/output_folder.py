"""Results are written whole or not at all.

They grow in a hidden folder beside the target, on the same disk, so that the last step is a rename.
"""

import errno
import os
import secrets
import shutil
from collections.abc import Collection
from pathlib import Path
from types import TracebackType
from typing import Self

from qualrl.errors import OutputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class OutputFolder:
    """A folder of results that appears, or changes, only when the ``with`` block ends well.

    A new target appears in one step.  In one that exists already, files of the same name are replaced one
    by one and all others stay.  After any exception, also Ctrl-C, the target is as it was.

    >>> with OutputFolder("results") as folder:           # doctest: +SKIP
    ...     folder.path("plan.json").write_text("{}")
    """

    def __init__(self, path: str | Path, *, ours: Collection[str] = ()) -> None:
        """Prepare a folder.  ours: files that belong together; those of them not written anew are removed."""
        self.target = Path(os.path.abspath(path))
        self._ours = ours
        self.shown = str(path)
        self._part = _part_beside(self.target)
        self._made: list[Path] = []

    def path(self, name: str) -> Path:
        """Where to write the file ``name`` for now; a plain name, without folders."""
        if not name or name in (".", "..") or any(character in name for character in "/\\\0"):
            raise OutputError(f"{name!r}: not a plain file name; results go into {self.shown} itself")
        return self._part / name

    def __enter__(self) -> Self:
        """Make the hidden folder, or raise OutputError before any work is done."""
        try:
            if self.target.exists() and not self.target.is_dir():
                raise OutputError(f"{self.shown}: is a file, and results need a folder; name another one")
            if self.target.is_dir() and not os.access(self.target, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            for name in self._ours:
                if (self.target / name).is_dir():
                    raise OutputError(f"{self.shown}: holds a folder {name!r} where a result would go; move it away")
            self._made = _make_folders(self.target.parent)
            self._part.mkdir()
        except (OSError, ValueError) as problem:  # ValueError: a NUL character in the name
            _remove_folders(self._made)
            raise _unwritable(self.shown, problem) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Deliver the results after success; remove the hidden folder in any case."""
        delivered = False
        try:
            if kind is None:
                self._deliver()
                delivered = True
        except OSError as failure:
            raise _unwritable(self.shown, failure) from None
        finally:
            shutil.rmtree(self._part, ignore_errors=True)
            if not delivered:
                _remove_folders(self._made)
        if isinstance(problem, OSError) and problem.errno in FULL:
            raise _unwritable(self.shown, problem) from problem

    def _deliver(self) -> None:
        if not os.path.lexists(self.target):
            self._part.rename(self.target)
            return
        names = sorted(os.listdir(self._part))
        for name in names:  # all checks come before the first replacement
            new, old = self._part / name, self.target / name
            if old.is_dir() or (new.is_dir() and old.exists()):
                raise OutputError(f"{self.shown}: holds a folder {name!r} where a result would go; move it away")
        for name in set(self._ours) - set(names):
            (self.target / name).unlink(missing_ok=True)
        for name in names:
            os.replace(self._part / name, self.target / name)


def _part_beside(target: Path) -> Path:
    return target.with_name(f".{target.name[:100]}.{secrets.token_hex(4)}.part")


def _make_folders(folder: Path) -> list[Path]:
    """Make a folder and those above it; return the new ones, the innermost first."""
    for place in (folder, *folder.parents):
        if place.exists() and not place.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"{place.name} is a file")
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _remove_folders(made: list[Path]) -> None:
    for place in made:
        try:
            place.rmdir()
        except OSError:  # someone else has put something in, or it is gone
            return


def _unwritable(shown: str, problem: OSError | ValueError) -> OutputError:
    reason = (getattr(problem, "strerror", None) or str(problem)).lower()
    full = getattr(problem, "errno", None) in FULL
    advice = "make room on the disk" if full else "name another place to write to"
    return OutputError(f"{shown}: cannot be written ({reason}); {advice}")
