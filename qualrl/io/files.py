"""Reading a file whole, with one clear line for each way in which that fails."""

import stat
from pathlib import Path

from qualrl.errors import QualrlError


def read_bytes(path: Path, *, what: str, most_bytes: int, error: type[QualrlError]) -> bytes:
    """The bytes of a regular file of at most ``most_bytes``.

    what: the kind of file in words ("scenario", "map"), for the message of ``error``.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise error(f"{path}: is a folder, not a {what} file; name a file inside it")
        if not stat.S_ISREG(mode):  # reading a pipe or a device might never end
            raise error(f"{path}: is not a regular file; copy the {what} to a file and name that")
        with path.open("rb") as stream:
            data = stream.read(most_bytes + 1)
    except FileNotFoundError:
        raise error(f"{path}: no such {what} file; check the spelling; looked in {path.resolve().parent}") from None
    except PermissionError:
        raise error(f"{path}: may not be read; change its permissions") from None
    except (OSError, ValueError) as problem:  # ValueError: a NUL character in the name
        reason = getattr(problem, "strerror", None) or str(problem)
        raise error(f"{str(path)!r}: cannot be read ({reason}); name another {what} file") from None
    if len(data) > most_bytes:
        raise error(f"{path}: is larger than {most_bytes:,} bytes, the most for a {what} file; is it the right file?")
    return data
