"""How much of an answer is put in words."""

from enum import StrEnum

from qualrl.errors import SettingError


class Depth(StrEnum):
    """Three depths of words; each tells what the one before tells, and more."""

    NAMES = "names"
    """Which places, doorways and actions, in which order; no amount, and no comparison of amounts."""
    SIGNS = "signs"
    """Also the order and the sign of amounts: worth more, longer, for small gamma, likely; no number."""
    NUMBERS = "numbers"
    """Everything."""

    @classmethod
    def named(cls, name: str) -> "Depth":
        """The depth of a name.  Raises SettingError."""
        if name not in [*cls]:
            raise SettingError(f"depth must be one of {', '.join(cls)}, got {name!r}")
        return cls(name)

    def from_signs(self, text: str, instead: str = "") -> str:
        """A text that is told at the depths of signs and numbers; what stands in its place at that of names."""
        return instead if self == Depth.NAMES else text

    def at_numbers(self, text: str, instead: str = "") -> str:
        """A text that is told at the depth of numbers alone; what stands in its place at the others."""
        return text if self == Depth.NUMBERS else instead

    def at_signs(self, text: str) -> str:
        """A text that is told at the depth of signs alone: where numbers say the same by themselves."""
        return text if self == Depth.SIGNS else ""
