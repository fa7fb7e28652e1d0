"""Values of a scenario as YAML that every reader takes for the same."""

import re

from qualrl.io.positioned_yaml import read_scalar

PLAIN = re.compile(r"[A-Za-z]([A-Za-z0-9_./ -]*[A-Za-z0-9_./-])?")
OTHER_READERS_TWIST = frozenset({"y", "n", "yes", "no", "on", "off"})
ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def written(value: object) -> str:
    """A value as YAML on one line."""
    if value is None:
        return "null"
    if isinstance(value, str):
        plain = PLAIN.fullmatch(value) and read_scalar(value) == value and value.lower() not in OTHER_READERS_TWIST
        return value if plain else '"' + "".join(map(_escaped, value)) + '"'
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, dict) and value:
        return f"{{{', '.join(f'{written(key)}: {written(of)}' for key, of in value.items() if of is not None)}}}"
    return repr(value)  # whole numbers, floats, and {}


def _escaped(character: str) -> str:
    if character in ESCAPES:
        return ESCAPES[character]
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
