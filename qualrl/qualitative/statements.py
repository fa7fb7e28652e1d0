"""Statements about places, in words: "kitchen north of lab", "room A is not connected to room B", "dock inside room C".

The grammar: NAME [is] [not] RELATION NAME, and for doorways NAME [is] [not] connected to NAME [by DOORWAY].  A name is
any words, in quotes where a word of it could be read as a relation.  What the relations mean on a map stands in
``qualitative.checking``.
"""

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from qualrl.errors import SettingError, shown
from qualrl.spatial.place import MOST_CHARACTERS

DIRECTIONS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
CONNECTED = "connected to"
SPELLINGS: dict[str, tuple[str, ...]] = {
    **{f"{way} of": (f"{way} of", f"{way} of".replace("-", ""), f"{way} of".replace("-", " ")) for way in DIRECTIONS},
    CONNECTED: ("connected to", "joined to"),
    "apart from": ("apart from", "disconnected from"),
    "touches": ("touches", "touch", "touching"),
    "overlaps": ("overlaps", "overlap", "overlapping"),
    "inside": ("inside", "within"),
    "contains": ("contains", "contain", "containing"),
    "the same as": ("the same as", "equals", "equal to"),
    "near": ("near", "near to"),
    "at medium distance from": ("at medium distance from",),
    "far from": ("far from",),
}
"""Each relation, and how it can be written."""
RELATION_OF = {tuple(spelling.split()): relation for relation, spellings in SPELLINGS.items() for spelling in spellings}
LINKING = ("is", "are", "lies", "does", "do")
BY = ("by", "through")
WORD = re.compile(r"'(?P<one>[^']+)'(?!\S)|\"(?P<two>[^\"]+)\"(?!\S)|(?P<plain>\S+)")
MOST_LETTERS = 400

Words = Sequence[tuple[str, bool]]
"""(word, whether it stood in quotes)."""


@dataclass(frozen=True)
class Statement:
    """What is said of two places."""

    text: str
    """As it was written."""
    subject: str
    relation: str
    """One of SPELLINGS."""
    object: str
    negated: bool = False
    doorway: str | None = None
    """Of "connected to": by which one, if that is said."""

    @property
    def names(self) -> tuple[str, str]:
        """Of the two places."""
        return self.subject, self.object

    @property
    def direction(self) -> str | None:
        """One of DIRECTIONS, if it tells one."""
        way = self.relation.removesuffix(" of")
        return way if way in DIRECTIONS else None


def read_statement(text: str) -> Statement:
    """Read a statement.  Raises SettingError, one line that says what cannot be read.

    >>> read_statement("kitchen is not north of lab").negated
    True
    """
    if len(text) > MOST_LETTERS:
        raise SettingError(f"a claim has at most {MOST_LETTERS} characters, got {len(text)}")
    words = _words(text)
    read = [_split(text, words, *place) for place in _relations_in(words)]
    ways = [statement for statement in read if statement is not None]
    if len(ways) > 1:
        raise SettingError(
            f"{shown(text)} can be read as {_quoted(ways[0])} or as {_quoted(ways[1])}; put one of them so, in quotes"
        )
    if not ways:
        raise SettingError(_nothing_read(text, words, bool(read)))
    for name in (*ways[0].names, ways[0].doorway or ""):
        if len(name) > MOST_CHARACTERS:
            raise SettingError(f"a name has at most {MOST_CHARACTERS} characters, got {len(name)} in a claim")
    return ways[0]


def _words(text: str) -> Words:
    words = []
    for match in WORD.finditer(text):
        plain = match["plain"]
        if plain is not None and plain[0] in "'\"":
            raise SettingError(f"{shown(text)}: a quote is not closed at the end of a word; quotes stand around names")
        words.append((match["one"] or match["two"] or plain, plain is None))
    return words


def _relations_in(words: Words) -> list[tuple[int, int, str]]:
    """(first word, past the last word, relation) of all that can be read as a relation, the longest where it begins."""
    found: list[tuple[int, int, str]] = []
    plain = [None if in_quotes else word.lower() for word, in_quotes in words]
    longest = max(map(len, RELATION_OF))
    for start in range(len(words)):
        for end in range(min(start + longest, len(words)), start, -1):
            relation = RELATION_OF.get(tuple(word or "" for word in plain[start:end]))
            if relation is not None:
                if not found or start >= found[-1][1]:
                    found.append((start, end, relation))
                break
    return found


def _split(text: str, words: Words, start: int, end: int, relation: str) -> Statement | None:
    """The statement with the relation at some words; None without names on both sides."""
    before, after = list(words[:start]), list(words[end:])
    negated = _ends_with(before, ("not",))
    if len(before) > 1 and not before[0][1] and before[0][0].lower() == "not":  # "not room A north of room B"
        negated = not negated
        before.pop(0)
    _ends_with(before, LINKING)
    by = [at for at, (word, in_quotes) in enumerate(after) if not in_quotes and word.lower() in BY]
    doorway = None
    if relation == CONNECTED and by and 0 < by[-1] < len(after) - 1:
        doorway, after = _name(after[by[-1] + 1 :]), after[: by[-1]]
    if not before or not after:
        return None
    return Statement(text, _name(before), relation, _name(after), negated, doorway)


def _ends_with(words: list[tuple[str, bool]], endings: Sequence[str]) -> bool:
    """Whether the last word is one of these; then it is taken off."""
    if words and not words[-1][1] and words[-1][0].lower() in endings:
        words.pop()
        return True
    return False


def _name(words: Words) -> str:
    return " ".join(word for word, _ in words)


def _quoted(of: Statement) -> str:
    return f"'{of.subject}' {'not ' if of.negated else ''}{of.relation} '{of.object}'"


def _nothing_read(text: str, words: Words, has_relation: bool) -> str:
    """Why there is no statement in some words."""
    if has_relation:
        return f"{shown(text)}: a name is missing; write NAME RELATION NAME, as 'kitchen north of lab'"
    spelled = [" ".join(spelling) for spelling in RELATION_OF]
    plain = [word.lower() for word, _ in words]
    parts = [" ".join(plain[at : at + size]) for size in (1, 2, 3, 4) for at in range(1, max(len(plain) - size, 1))]
    near = [(part, difflib.get_close_matches(part, spelled, n=1, cutoff=0.7)) for part in parts]
    scored = [(difflib.SequenceMatcher(None, part, match[0]).ratio(), match[0]) for part, match in near if match]
    hint = f"did you mean {max(scored)[1]!r}?" if scored else f"known are {', '.join(map(repr, SPELLINGS))}"
    return f"{shown(text)}: no relation is known in it; {hint}"
