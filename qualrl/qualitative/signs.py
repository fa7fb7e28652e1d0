"""Sign algebra: what is known of a sum or a product by signs alone (-, 0, +, and ? where they leave it open)."""

from collections.abc import Iterable, Sequence
from enum import StrEnum


class Sign(StrEnum):
    """What is known of a number."""

    MINUS = "-"
    ZERO = "0"
    PLUS = "+"
    UNKNOWN = "?"

    @classmethod
    def of(cls, number: float) -> "Sign":
        """The sign of a number."""
        return cls.PLUS if number > 0 else cls.MINUS if number < 0 else cls.ZERO

    def times(self, other: "Sign") -> "Sign":
        """Of a product: 0 where either is, whatever the other."""
        if Sign.ZERO in (self, other):
            return Sign.ZERO
        if Sign.UNKNOWN in (self, other):
            return Sign.UNKNOWN
        return Sign.PLUS if self == other else Sign.MINUS


def sign_of_sum(signs: Iterable[Sign]) -> Sign:
    """Of a sum: ? where numbers of both signs are added, for then either may outweigh the other."""
    found = {sign for sign in signs if sign != Sign.ZERO}
    if not found:
        return Sign.ZERO
    return found.pop() if len(found) == 1 else Sign.UNKNOWN


def one_after_the_other(words: Sequence[str], of: str) -> str:
    """What is so on each of some intervals in order: "a for small gamma, then b, then c for large gamma"."""
    if len(words) == 1:
        return f"{words[0]} for every {of}"
    return ", then ".join([f"{words[0]} for small {of}", *words[1:-1], f"{words[-1]} for large {of}"])
