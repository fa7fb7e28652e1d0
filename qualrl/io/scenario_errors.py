"""What is wrong with a scenario, in words for whoever wrote it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from qualrl.errors import did_you_mean, shown
from qualrl.io.positioned_yaml import KeyPath


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scenario."""

    path: KeyPath
    """The setting it is about."""
    what: str
    """What is wrong and what to do."""
    where: KeyPath
    """Where to point: the setting itself, or what it is missing from."""
    of_key: bool
    """Whether the key itself is wrong and not its value."""


WORDS: dict[str, Callable[[Any, dict[str, Any]], str]] = {
    "greater_than": lambda value, limits: f"must be greater than {limits['gt']:g}, got {shown(value)}",
    "greater_than_equal": lambda value, limits: f"must be at least {limits['ge']:g}, got {shown(value)}",
    "less_than": lambda value, limits: f"must be less than {_number(limits['lt'])}, got {shown(value)}",
    "less_than_equal": lambda value, limits: f"must be at most {limits['le']:g}, got {shown(value)}",
    "finite_number": lambda value, limits: f"must be finite, got {shown(value)}",
    "float_type": lambda value, limits: f"must be a number, got {shown(value)}",
    "int_type": lambda value, limits: f"must be a whole number, got {shown(value)}",
    "string_type": lambda value, limits: f"must be text, got {shown(value)}; put text in quotes",
    "string_too_short": lambda value, limits: "must not be empty",
    "string_too_long": lambda value, limits: f"must have at most {limits['max_length']} characters, got {len(value)}",
    "literal_error": lambda value, limits: f"must be {limits['expected']}, got {shown(value)}",
    "list_type": lambda value, limits: f"must be a list '[...]', got {shown(value)}; leave it out for none",
    "dict_type": lambda value, limits: f"must be a mapping 'name: ...', got {shown(value)}; leave it out for none",
    "value_error": lambda value, limits: str(limits["error"]),
}
"""By pydantic's name for the problem."""


def explained(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Every problem that pydantic found, in our words."""
    return [_problem(details["type"], details["loc"], details, model) for details in error.errors()]


def _problem(kind: str, path: KeyPath, details: Any, model: type[BaseModel]) -> Problem:
    value = details["input"]
    of_key = path[-1:] == ("[key]",) and kind != "extra_forbidden"
    if of_key:  # pydantic's way to say that not the value but the key is wrong
        path = path[:-1]
    if kind == "missing":
        return Problem(path, f"missing; add a line '{path[-1]}: ...'", path[:-1], False)
    if kind == "extra_forbidden":
        return Problem(path, f"unknown key; {_meant(path, model)}", path, True)
    if kind == "model_type":
        keys = ", ".join(_section(path, model).model_fields)
        return Problem(path, f"must hold keys ({keys}), got {shown(value)}; leave it out for the defaults", path, False)
    words = WORDS.get(kind)
    what = words(value, details.get("ctx", {})) if words else f"{details['msg']}, got {shown(value)}"
    return Problem(path, what, path, of_key)


def _meant(path: KeyPath, model: type[BaseModel]) -> str:
    """What an unknown key was probably meant to be; a key may also stand at the wrong level."""
    asked = str(path[-1])
    known = _section(path[:-1], model).model_fields
    for section in model.model_fields if asked not in known else ():
        if asked in _section((section,), model).model_fields and section not in path:
            return f"it belongs into '{section}', as {section}.{asked}"
    if len(path) > 1 and asked in model.model_fields:
        return "it belongs to the top level, without indentation"
    return did_you_mean(asked, known)


def _section(path: KeyPath, model: type[BaseModel]) -> type[BaseModel]:
    """The model that holds the keys under ``path``; an empty one under a plain setting."""
    for key in path:
        if isinstance(key, int):  # of a list; what it holds is what came before
            continue
        annotation: Any = model.model_fields[str(key)].annotation
        kinds = [kind for kind in (*get_args(annotation), annotation) if isinstance(kind, type)]
        model = next((kind for kind in kinds if issubclass(kind, BaseModel)), BaseModel)
    return model


def dotted(path: KeyPath) -> str:
    """A path as messages show it, on one short line whatever the keys hold."""
    parts = [str(part) for part in path]
    return ".".join(part if part.isprintable() and len(part) <= 100 else shown(part) for part in parts)


def _number(limit: float) -> str:
    return "2**63" if limit == 2**63 else f"{limit:g}"
