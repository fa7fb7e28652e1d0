"""YAML that remembers where everything stood, so that errors can point at it.

Scalars follow the core schema of YAML 1.2 (``1e-2`` is a number, ``no`` and ``12:30`` are text), not the
1.1 rules of PyYAML, which serves here only as parser; nothing is ever constructed from a tag.
Lines and columns count from 1.  A path is the tuple of keys and list indices that leads to a value.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from qualrl.errors import QualrlError
from qualrl.io.files import read_bytes

MOST_BYTES = 1_000_000
MOST_VALUES = 100_000
"""After aliases are expanded; nine lines of aliases can stand for a billion values."""
MOST_DEPTH = 40
"""The parser recurses four frames a level, and Python allows 1000 in all."""
MOST_DIGITS = 400
"""Beyond this Python may refuse to print a whole number again."""
MOST_PROBLEMS = 50
"""Told at once."""

KeyPath = tuple[str | int, ...]
"""("learn", "alpha") or ("origin", 2)."""
Position = tuple[int, int]
"""(line, column), from 1."""

NULL = frozenset({"", "~", "null", "Null", "NULL"})
BOOLEAN = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
WHOLE = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
DECIMAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
NOT_A_NUMBER = frozenset({".nan", ".NaN", ".NAN"})

PLAIN_WORDS = {
    "cannot start any token": "this character cannot stand here; indent with spaces, quote text that starts with it",
    "mapping values are not allowed": "a ':' is not expected here; check the indentation, quote text that holds ': '",
    "could not find expected ':'": "expected ':' after a key; write 'key: value'",
    "expected <block end>": "the indentation does not fit the lines above; line the keys up",
    "parsing a flow sequence": "this list is not closed; separate its items by ',' and end it with ']'",
    "parsing a flow mapping": "this mapping is not closed; separate its items by ',' and end it with '}'",
    "a single document": "a second document starts here; keep one document, without '---' inside",
    "found undefined alias": "this alias stands for nothing; define it before, or quote text that starts with '*'",
    "found duplicate anchor": "this anchor was defined before; give it another name",
}
"""By a part of what PyYAML says."""


@dataclass(frozen=True)
class PositionedYaml:
    """Plain Python data (dict, list, str, int, float, bool, None) and where each piece of it stood."""

    data: object
    source: str
    """What error messages call the file."""
    key_at: Mapping[KeyPath, Position]
    """Where a key stood; for an item of a list, where the item stood."""
    value_at: Mapping[KeyPath, Position]
    """Where a value stood; () is the whole file."""

    def position(self, path: KeyPath, *, of_key: bool = False) -> Position:
        """Where a path stood, or where the nearest thing that holds it stood."""
        if of_key and path in self.key_at:
            return self.key_at[path]
        while path and path not in self.value_at:
            path = path[:-1]
        return self.value_at.get(path, (1, 1))

    def line(self, path: KeyPath, what: str, *, of_key: bool = False) -> str:
        """One line of an error message: source:line:column: what."""
        line, column = self.position(path, of_key=of_key)
        return f"{self.source}:{line}:{column}: {what}"


def read_yaml(path: str | Path, *, what: str, error: type[QualrlError]) -> PositionedYaml:
    """Read a YAML file; ``error`` is raised with one line for each problem found."""
    data = read_bytes(Path(path), what=what, most_bytes=MOST_BYTES, error=error)
    return parse_yaml(_decode(data, str(path), error), str(path), error=error)


def parse_yaml(text: str, source: str, *, error: type[QualrlError]) -> PositionedYaml:
    """Read YAML text; ``source`` is what messages call it."""
    builder = _Builder(source, error)
    try:
        loader = _Composer(text, builder)
    except yaml.reader.ReaderError as problem:
        raise error(f"{_at(source, text[: problem.position])}: {_character(problem)}") from None
    try:
        root = loader.get_single_node()
    except yaml.MarkedYAMLError as problem:
        raise error(f"{source}:{_in_plain_words(problem)}") from None
    except (ValueError, OverflowError):  # "\UFFFFFFFF" is no character; %YAML 1.<5000 digits>
        raise error(
            f"{source}:{_numbers(loader.get_mark())}: a number here is too large; write the text plainly"
        ) from None
    finally:
        loader.dispose()
    data = None if root is None else builder.build(root, ())
    if builder.problems:
        lines = [f"{source}:{line}:{column}: {what}" for line, column, what in sorted(set(builder.problems))]
        more = [f"{source}:1:1: and {len(lines) - MOST_PROBLEMS:,} problems more"] if len(lines) > MOST_PROBLEMS else []
        raise error("\n".join(lines[:MOST_PROBLEMS] + more))
    return PositionedYaml(data, source, builder.key_at, builder.value_at)


def read_scalar(text: str) -> object:
    """What an unquoted YAML 1.2 scalar stands for; ValueError for a whole number of absurd length."""
    if text in NULL:
        return None
    if text in BOOLEAN:
        return BOOLEAN[text]
    if WHOLE.fullmatch(text):
        if len(text) > MOST_DIGITS:
            raise ValueError(f"a whole number of {len(text)} digits is too long; the most is {MOST_DIGITS}")
        return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))
    if DECIMAL.fullmatch(text):
        return float(text)
    if INFINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    return float("nan") if text in NOT_A_NUMBER else text


class _Composer(yaml.SafeLoader):
    """PyYAML's pure-Python parser up to nodes, with limits, and without any resolving of types."""

    def __init__(self, text: str, builder: "_Builder") -> None:
        super().__init__(text)
        self.builder = builder
        self.depth = 0
        self.nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        self.depth += 1
        self.nodes += 1
        self.builder.check_limits(event.start_mark, self.depth, self.nodes)
        if getattr(event, "tag", None) is not None:
            self.builder.add(event.start_mark, f"the tag {event.tag!r} is not supported; write the value without '!'")
        node: yaml.Node | None = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def resolve(self, kind: type[yaml.Node], value: str, implicit: bool | tuple[bool, bool]) -> str:
        return ""  # the builder reads scalars itself

    def descend_resolver(self, current_node: yaml.Node | None, current_index: int) -> None:
        pass

    def ascend_resolver(self) -> None:
        pass


class _Builder:
    """Turns nodes into plain data and notes positions; collects problems that need not stop it."""

    def __init__(self, source: str, error: type[QualrlError]) -> None:
        self.source = source
        self.error = error
        self.key_at: dict[KeyPath, Position] = {}
        self.value_at: dict[KeyPath, Position] = {}
        self.problems: list[tuple[int, int, str]] = []
        self.values = 0
        self.open_nodes: set[int] = set()

    def add(self, mark: yaml.Mark, what: str) -> None:
        self.problems.append((mark.line + 1, mark.column + 1, what))

    def check_limits(self, mark: yaml.Mark, depth: int, values: int) -> None:
        if depth > MOST_DEPTH:
            raise self.error(f"{self.source}:{_numbers(mark)}: nested more than {MOST_DEPTH} deep; write it flatter")
        if values > MOST_VALUES:
            what = f"more than {MOST_VALUES:,} values (aliases count each time); shorten it"
            raise self.error(f"{self.source}:{_numbers(mark)}: {what}")

    def build(self, node: yaml.Node, path: KeyPath) -> object:
        mark = node.start_mark
        self.values += 1
        self.check_limits(mark, len(path) + 1, self.values)
        self.value_at[path] = (mark.line + 1, mark.column + 1)
        if isinstance(node, yaml.ScalarNode):
            return self.scalar(node)
        if id(node) in self.open_nodes:
            raise self.error(f"{self.source}:{_numbers(mark)}: an alias inside stands for the whole of this; remove it")
        self.open_nodes.add(id(node))
        data = self.mapping(node, path) if isinstance(node, yaml.MappingNode) else self.sequence(node, path)
        self.open_nodes.remove(id(node))
        return data

    def scalar(self, node: yaml.ScalarNode) -> object:
        text: str = node.value
        if any("\ud800" <= character <= "\udfff" for character in text):
            self.add(node.start_mark, "half a character (\\ud800 to \\udfff); write the whole character instead")
        if node.style is not None:
            return text
        try:
            return read_scalar(text)
        except ValueError as problem:
            self.add(node.start_mark, str(problem))
            return None

    def sequence(self, node: yaml.Node, path: KeyPath) -> list[object]:
        items = []
        for index, item in enumerate(node.value):
            items.append(self.build(item, (*path, index)))
            self.key_at[(*path, index)] = self.value_at[(*path, index)]
        return items

    def mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[str, object]:
        data: dict[str, object] = {}
        for key_node, value_node in node.value:
            key = self.key(key_node)
            if key is None:
                continue
            if key in data:
                line, column = self.key_at[(*path, key)]
                self.add(key_node.start_mark, f"{key!r} was given before, at {line}:{column}; keep one of the two")
                continue
            self.key_at[(*path, key)] = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            data[key] = self.build(value_node, (*path, key))
        return data

    def key(self, node: yaml.Node) -> str | None:
        """The text of a key, or None when it is no text (noted as a problem)."""
        if not isinstance(node, yaml.ScalarNode):
            self.add(node.start_mark, "a key must be text, not a list or a mapping; quote it if it starts with [ or {")
            return None
        key = self.scalar(node)
        if node.style is None and key == "<<":
            self.add(node.start_mark, "merge keys (<<) are not supported; write the keys out")
        elif isinstance(key, str):
            return key
        else:
            self.add(node.start_mark, f'a key must be text; write it in quotes: "{node.value[:40]}"')
        return None


def _decode(data: bytes, source: str, error: type[QualrlError]) -> str:
    if b"\0" in data:
        raise error(f"{source}: is not a text file; a YAML file is expected here")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as problem:
        before = data[: problem.start].decode("utf-8")
        wrong = f"byte 0x{data[problem.start]:02x} is not UTF-8; save the file as UTF-8"
        raise error(f"{_at(source, before)}: {wrong}") from None


def _at(source: str, before: str) -> str:
    """source:line:column of the character after ``before``."""
    return f"{source}:{before.count(chr(10)) + 1}:{len(before) - (before.rfind(chr(10)) + 1) + 1}"


def _numbers(mark: yaml.Mark | None) -> str:
    return "1:1" if mark is None else f"{mark.line + 1}:{mark.column + 1}"


def _character(problem: yaml.reader.ReaderError) -> str:
    return f"the invisible character U+{int(problem.character):04X} cannot stand in YAML; delete it"


def _in_plain_words(problem: yaml.MarkedYAMLError) -> str:
    """line:column: what is wrong; what to do."""
    told = " ".join(f"{problem.context or ''}: {problem.problem or ''}".split()).strip(": ")
    if "quoted scalar" in told and "end of stream" in told:
        return f"{_numbers(problem.context_mark)}: this quote is never closed; close it, or double a quote inside"
    starts = problem.context_mark if "parsing a flow" in told else None
    where = _numbers(starts or problem.problem_mark or problem.context_mark)
    for theirs, ours in PLAIN_WORDS.items():
        if theirs in told:
            return f"{where}: {ours}"
    return f"{where}: {told}; correct the YAML here"
