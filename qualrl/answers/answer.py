"""What all answers have: sentences at three depths, and a JSON twin whose numbers every sentence stands on."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any

from qualrl.answers.depth import Depth

ALIKE = 1e-9
"""Amounts that differ by less than this share of what they are part of are the same."""
WORTH = ("worth less", "worth as much", "worth more")
LIKELY = 0.5
"""A probability above this is likely."""
SELDOM = 0.001
"""A probability below this is almost none."""
ROW_AND_COLUMN = re.compile(r"\brow \d+, column \d+ in | \(row \d+, column \d+\)")
"""Of a start or goal without a name of its own: told by its region alone where numbers are not."""


class Answer(ABC):
    """An answer to a question about a plan."""

    @abstractmethod
    def lines(self, depth: Depth) -> Iterable[str]:
        """A line a fact."""

    @abstractmethod
    def facts(self) -> dict[str, Any]:
        """All that the sentences say, and more, as JSON."""

    def explain(self, depth: str = Depth.NUMBERS) -> str:
        """In words, a line a fact.  depth: "names", "signs" or "numbers", see ``Depth``.  Raises SettingError."""
        told = Depth.named(depth)
        text = "\n".join(self.lines(told))
        return told.at_numbers(text, ROW_AND_COLUMN.sub("", text))

    def to_dict(self, depth: str = Depth.NUMBERS) -> dict[str, Any]:
        """The JSON twin of ``explain``; depth: of its sentences alone."""
        return {**self.facts(), "sentences": self.explain(depth).splitlines()}


def in_sign(difference: float, of: float, words: tuple[str, str, str]) -> str:
    """The word for less, as much or more; of: the amount that the difference is a share of."""
    if abs(difference) <= ALIKE * abs(of):
        return words[1]
    return words[0 if difference < 0 else 2]


def likelihood(least: float, most: float) -> str:
    """What a probability between two bounds makes of something; impossible and certain are those of 0 and 1 alone."""
    if most <= 0 or least >= 1:
        return "impossible" if most <= 0 else "certain"
    if most < SELDOM:
        return "almost impossible"
    return "almost certain" if least > 1 - SELDOM else "likely" if least > LIKELY else "possible"


def first_of(names: Sequence[str], most: int) -> str:
    """So many names of a list, and that there are others."""
    return ", ".join(names[:most]) + (" and others" if len(names) > most else "")
