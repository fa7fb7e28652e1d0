"""The YAML reader: YAML 1.2 values, positions, and one clear line for whatever is wrong."""

import json
import math
import string
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.errors import MapError, QualrlError, ScenarioError
from qualrl.io.positioned_yaml import PositionedYaml, parse_yaml, read_yaml


def parse(text: str) -> PositionedYaml:
    return parse_yaml(text, "f.yaml", error=ScenarioError)


def complaint(text: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        parse(text)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[(text, None) for text in ("", "~", "null", "Null", "NULL")],
        *[(text, True) for text in ("true", "True", "TRUE")],
        *[(text, False) for text in ("false", "False", "FALSE")],
        *[("010", 10), ("-7", -7), ("+3", 3), ("0o17", 15), ("0x1F", 31), ("0", 0)],
        *[("1e-2", 0.01), ("1E3", 1000.0), (".5", 0.5), ("5.", 5.0), ("-1.5e+2", -150.0), ("1.10", 1.1)],
        *[(".inf", math.inf), ("-.Inf", -math.inf), ("+.INF", math.inf)],
        *[(text, text) for text in ("no", "No", "on", "off", "yes", "y", "12:30", "1_000", "2020-01-01", "1.2.3")],
        *[(text, text) for text in ("0b11", "0X1F", "-0x1F", "nULL", "tRUE", "inf", ".iNF", "e5", "+", ".", "1e")],
        *[('"1"', "1"), ("'no'", "no"), ('"null"', "null"), ('"\\x41\\n"', "A\n"), ("room A", "room A")],
        *[("|\n  12\n", "12\n"), (">\n  a\n  b\n", "a b\n")],
    ],
)
def test_scalars_follow_the_core_schema_of_yaml_1_2(text: str, value: object) -> None:
    read = parse(f"key: {text}").data
    assert read == {"key": value}
    assert type(read["key"]) is type(value)


def test_not_a_number() -> None:
    assert all(math.isnan(number) for number in parse("[.nan, .NaN, .NAN]").data)


JSON_TEXT = st.text(st.characters(max_codepoint=0xFFFF, exclude_categories=["Cs"]), max_size=20)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | JSON_TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(JSON_TEXT, inner, max_size=4),
    max_leaves=12,
)


@settings(deadline=None)
@given(JSON, st.sampled_from([None, 1, 3]))
def test_json_is_yaml(data: Any, indent: int | None) -> None:
    assert parse(json.dumps(data, indent=indent)).data == data


@settings(deadline=None)
@given(JSON)
def test_positions_point_at_the_values(data: Any) -> None:
    text = json.dumps(data, indent=2)
    content, lines = parse(text), text.split("\n")

    def check(value: Any, path: tuple[Any, ...]) -> None:
        line, column = content.value_at[path]
        assert lines[line - 1][column - 1 :].startswith(json.dumps(value, indent=2).split("\n")[0])
        if path:
            line, column = content.key_at[path]
            shown = json.dumps(path[-1]) if isinstance(path[-1], str) else ""
            assert lines[line - 1][column - 1 :].startswith(shown)
        for key, item in (
            value.items() if isinstance(value, dict) else enumerate(value if isinstance(value, list) else [])
        ):
            check(item, (*path, key))

    check(data, ())


def test_positions_of_keys_and_values_in_block_style() -> None:
    content = parse("# a comment\nlearn:\n  alpha:  0.1\n  list:\n    - x\n    - y: z\n")
    assert content.key_at["learn",] == (2, 1)
    assert content.key_at["learn", "alpha"] == (3, 3)
    assert content.value_at["learn", "alpha"] == (3, 11)
    assert content.value_at["learn", "list", 0] == (5, 7)
    assert content.key_at["learn", "list", 1, "y"] == (6, 7)
    assert content.position(("learn", "missing", "deeper")) == (3, 3)
    assert content.line(("learn",), "wrong", of_key=True) == "f.yaml:2:1: wrong"


def test_a_byte_order_mark_and_windows_lines_do_not_shift_positions() -> None:
    content = parse("\ufeffa: 1\r\nb: 2\r\n")
    assert content.data == {"a": 1, "b": 2}
    assert content.key_at["a",] == (1, 1)
    assert content.value_at["b",] == (2, 4)


def test_aliases_are_expanded() -> None:
    assert parse("a: &x [1, {b: 2}]\nc: *x\n").data == {"a": [1, {"b": 2}], "c": [1, {"b": 2}]}


def test_an_empty_file_is_none() -> None:
    assert parse("").data is None
    assert parse("# only a comment\n").data is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: 2\na: 3\n", "f.yaml:3:1: 'a' was given before, at 1:1; keep one of the two"),
        ("x:\n  a: 1\n  a: 1\n", "f.yaml:3:3: 'a' was given before, at 2:3; keep one of the two"),
        ("1: a", 'f.yaml:1:1: a key must be text; write it in quotes: "1"'),
        ("true: a", 'f.yaml:1:1: a key must be text; write it in quotes: "true"'),
        ("~: a", 'f.yaml:1:1: a key must be text; write it in quotes: "~"'),
        ("? [a]\n: b", "f.yaml:1:3: a key must be text, not a list or a mapping; quote it if it starts with [ or {"),
        ("a: &x {b: 1}\nc:\n  <<: *x\n", "f.yaml:3:3: merge keys (<<) are not supported; write the keys out"),
        ("a: &x [*x]", "f.yaml:1:4: an alias inside stands for the whole of this; remove it"),
        ("a: *b", "f.yaml:1:4: this alias stands for nothing; define it before, or quote text that starts with '*'"),
        ("a\n---\nb\n", "f.yaml:2:1: a second document starts here; keep one document, without '---' inside"),
        (
            "a:\n\t- b\n",
            "f.yaml:2:1: this character cannot stand here; indent with spaces, quote text that starts with it",
        ),
        ("a: b: c", "f.yaml:1:5: a ':' is not expected here; check the indentation, quote text that holds ': '"),
        ("a: 'open\n", "f.yaml:1:4: this quote is never closed; close it, or double a quote inside"),
        ("a: [1,\n2", "f.yaml:1:4: this list is not closed; separate its items by ',' and end it with ']'"),
        ("a: 1\n  b: 2\n", "f.yaml:2:4: a ':' is not expected here; check the indentation, quote text that holds ': '"),
        ("a: \x07", "f.yaml:1:4: the invisible character U+0007 cannot stand in YAML; delete it"),
        ('a: "\\UFFFFFFFF"', "f.yaml:1:7: a number here is too large; write the text plainly"),
        ('a: "\\ud800"', "f.yaml:1:4: half a character (\\ud800 to \\udfff); write the whole character instead"),
        (f"a: {'1' * 500}", "f.yaml:1:4: a whole number of 500 digits is too long; the most is 400"),
        ("a: !mine 1", "f.yaml:1:4: the tag '!mine' is not supported; write the value without '!'"),
        ("a: !!str 1", "f.yaml:1:4: the tag 'tag:yaml.org,2002:str' is not supported; write the value without '!'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_with_its_position(text: str, said: str) -> None:
    assert complaint(text) == said


def test_python_tags_run_nothing() -> None:
    assert "not supported" in complaint("a: !!python/object/apply:os.system ['exit 1']")


def test_all_problems_that_do_not_stop_the_parser_are_reported_in_order() -> None:
    said = complaint("a: !x 1\na: 2\n3: b\n").split("\n")
    assert [line.split(": ")[0] for line in said] == ["f.yaml:1:4", "f.yaml:2:1", "f.yaml:3:1"]


def test_a_flood_of_problems_is_cut_short() -> None:
    said = complaint("a: 1\n" * 1000).split("\n")
    assert len(said) == 51
    assert said[-1] == "f.yaml:1:1: and 949 problems more"


def test_aliases_cannot_blow_up() -> None:
    lines = ["a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    for before, name in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]")
    started = time.process_time()
    assert "more than 100,000 values" in complaint("\n".join(lines))
    assert time.process_time() - started < 10


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? ", "[{a: "])
def test_nesting_is_limited(opening: str) -> None:
    assert "nested more than 40 deep" in complaint(opening * 5000)


def test_nesting_through_aliases_is_limited() -> None:
    lines = ["a: &a [1]"] + [f"{b}: &{b} [[[[[[[[*{a}]]]]]]]]" for a, b in zip("abcdef", "bcdefg", strict=True)]
    assert "nested more than 40 deep" in complaint("\n".join(lines))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"a: \xff", "f.yaml:1:4: byte 0xff is not UTF-8; save the file as UTF-8"),
        ("a: é\nb: é".encode("latin-1"), "f.yaml:1:4: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        ("a: é\n".encode() + b"bc\xe9", "f.yaml:2:3: byte 0xe9 is not UTF-8; save the file as UTF-8"),
        (b"\x89PNG\r\n\x1a\n\0\0\0", "f.yaml: is not a text file; a YAML file is expected here"),
        ("a: 1".encode("utf-16"), "f.yaml: is not a text file; a YAML file is expected here"),
        (
            b"# " + b"x" * 1_000_000,
            "f.yaml: is larger than 1,000,000 bytes, the most for a test file; is it the right file?",
        ),
    ],
)
def test_files_that_are_no_yaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, data: bytes, said: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("f.yaml").write_bytes(data)
    with pytest.raises(MapError) as caught:
        read_yaml("f.yaml", what="test", error=MapError)
    assert str(caught.value) == said


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path, said in [
        (tmp_path, "is a folder, not a test file"),
        (tmp_path / "none.yaml", "no such test file"),
        ("/dev/null", "is not a regular file"),
        ("nul\0", "cannot be read"),
        ("x" * 5000, "cannot be read"),
    ]:
        with pytest.raises(MapError) as caught:
            read_yaml(path, what="test", error=MapError)
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)


PIECES = ["\r\n", ": ", "- ", "? ", "&a ", "*a", "<<: ", "!!str ", "---\n", "...\n", "%YAML 1.1\n", "%TAG ! x\n"]
PIECES += ['"\\x4', '"\\U00110000"', "!<%FF>", "\ufeff", "\u2028", "\x85", "\0", "😀", "\ud800"]
PIECES += list("abc019:-?[]{}&*!|>%@`'\"#,.\\~\t \n")
YAML_LIKE = st.lists(st.sampled_from(PIECES), max_size=40).map("".join)


@settings(deadline=None)
@given(YAML_LIKE | st.text(st.sampled_from(string.printable), max_size=60) | st.text(max_size=60))
def test_any_text_is_read_or_refused_in_lines_that_start_with_the_position(text: str) -> None:
    try:
        parse(text)
    except QualrlError as problem:
        for line in str(problem).split("\n"):
            source, row, column, what = line.split(":", 3)
            assert source == "f.yaml"
            assert int(row) >= 1
            assert int(column) >= 1
            assert what.startswith(" ")


@settings(deadline=None)
@given(st.binary(max_size=80))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    path.write_bytes(data)
    told = str(path)
    try:
        read_yaml(path, what="test", error=MapError)
    except MapError as problem:
        told = str(problem)
    assert told.startswith(str(path))
