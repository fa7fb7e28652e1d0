"""Every error a user may see: one line that says what, where, why, and what to do next.

``exit_code`` is what the command ends with: 1 = a check failed or no plan exists, 2 = bad input.
Anything that is not a QualrlError is our own fault (exit code 3).
"""

import difflib
from collections.abc import Iterable


class QualrlError(Exception):
    """Base of all errors that are the input's or the world's, not the program's."""

    exit_code = 2


class MapError(QualrlError):
    """A map cannot be read or holds nothing to plan on."""


class ScenarioError(QualrlError):
    """A scenario is not valid; the message holds one line for each problem found."""


class SettingError(QualrlError, ValueError):
    """A number or choice is out of its range."""


class FormulaError(QualrlError, ValueError):
    """A formula cannot be read, or has no value where one is needed."""


class UnknownNameError(QualrlError, LookupError):
    """A place, algorithm or setting was asked for that does not exist."""


class PlaceError(QualrlError):
    """A place exists but cannot be used: in a wall, outside the map."""


class OutputError(QualrlError):
    """Results cannot be written where they were asked for."""


class NoPlanError(QualrlError):
    """The goal cannot be reached from the start."""

    exit_code = 1


def did_you_mean(asked: str, known: Iterable[str], most: int = 12) -> str:
    """The tail of an error about an unknown name: the nearest known one, or the list of them."""
    names = list(known)
    lowered = {name.lower(): name for name in names}
    near = difflib.get_close_matches(asked.lower(), lowered, n=1, cutoff=0.6)
    if near:
        return f"did you mean {lowered[near[0]]!r}?"
    if not names:
        return "none are known here"
    shown = ", ".join(repr(name) for name in names[:most])
    return f"known are {shown}" + (f" and {len(names) - most} more" if len(names) > most else "")


def shown(value: object, most: int = 60) -> str:
    """A wrong value as an error message quotes it: short, on one line, nothing for null."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return f"a mapping of {len(value)} keys"
    if isinstance(value, list) and len(value) > 3:
        return f"a list of {len(value)}"
    text = "true" if value is True else "false" if value is False else repr(value)
    return text if len(text) <= most else text[: most - 3] + "..."
