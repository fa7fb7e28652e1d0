"""Text in pictures: fonts that have the characters, sizes in pixels, widths before anything is drawn."""

from collections.abc import Iterable
from functools import cache

from matplotlib import font_manager, patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.ft2font import FT2Font
from matplotlib.text import Text

DPI = 100
SMALLEST_PX = 9.0
"""Text is never drawn smaller: it could not be read."""
MEASURED_PX, SLACK = 40.0, 1.04
"""Texts are measured at this size; rounded to pixels they may be so much wider at others."""
MISSING = "\N{WHITE SQUARE}"
PLAIN = "DejaVu Sans"
"""The font that comes with matplotlib."""


class Lettering:
    """The fonts of one picture: matplotlib's own, and of the system those that have what it lacks."""

    def __init__(self, texts: Iterable[str]) -> None:
        self._renderer = FigureCanvasAgg(Figure(dpi=DPI)).get_renderer()  # type: ignore[no-untyped-call]
        self._has = set(_characters(font_manager.findfont(PLAIN)))
        self._families = [PLAIN]
        self._widths: dict[str, float] = {}
        wanted = {ord(letter) for text in texts for letter in text} - self._has
        for family, file in _system_fonts() if wanted else ():
            found = wanted & _characters(file)
            if found:
                self._families.append(family)
                self._has |= found
                wanted -= found
            if not wanted:
                break

    def can_write(self, text: str) -> bool:
        """Whether every character has a glyph."""
        return all(ord(letter) in self._has for letter in text)

    def writable(self, text: str) -> str:
        """The text, with a square for each character that no font has."""
        return "".join(letter if ord(letter) in self._has else MISSING for letter in text)

    def box(self, text: str, size_px: float) -> tuple[float, float]:
        """Width and height of a text of one or more lines, in pixels."""
        lines = text.split("\n")
        return max(map(self._width_em, lines)) * size_px * SLACK, size_px * (0.95 + 1.15 * (len(lines) - 1))

    def fitted(self, text: str, size_px: float, width_px: float) -> tuple[str, float]:
        """The text and its size so that it is at most so wide: first smaller, then shortened in the middle."""
        while size_px > SMALLEST_PX and self.box(text, size_px)[0] > width_px:
            size_px = max(SMALLEST_PX, size_px * 0.93)
        kept = len(text)
        short = text
        while kept > 2 and self.box(short, size_px)[0] > width_px:
            kept -= 1
            short = f"{text[: -(-kept // 2)]} … {text[len(text) - kept // 2 :]}"
        return short, size_px

    def write(
        self, axes: Axes, x_px: float, y_px: float, text: str, size_px: float, centred: bool = True,
        upright: bool = False, halo_px: float = 0.0,
    ) -> Text:  # fmt: skip
        """Text with its middle, or the middle of its left side, at a place; ``upright`` turns it by 90 degrees."""
        drawn = axes.text(
            x_px, y_px, text, fontproperties=self._font(size_px), color="black", zorder=6, linespacing=1.0,
            ha="center" if centred else "left", va="center_baseline" if "\n" not in text and not upright else "center",
            rotation=90 if upright else 0, parse_math=False,
        )  # fmt: skip
        if halo_px:
            # Snapping, meant for lines, would break letters of straight strokes, as E, F and H, when they are small.
            halo = patheffects.Stroke(linewidth=px(halo_px), foreground="white", alpha=0.9, snap=False)
            drawn.set_path_effects([halo, patheffects.Stroke(linewidth=0.0, foreground="black", snap=False)])
        return drawn

    def _width_em(self, line: str) -> float:
        if line not in self._widths:  # measuring is slow, and names are tried at many sizes
            font = self._font(MEASURED_PX)
            width = float(self._renderer.get_text_width_height_descent(line, font, ismath=False)[0])
            self._widths[line] = width / MEASURED_PX
        return self._widths[line]

    def _font(self, size_px: float) -> FontProperties:
        return FontProperties(family=self._families, size=px(size_px))


def px(length_px: float) -> float:
    """Points, matplotlib's unit of sizes, of a length in pixels."""
    return length_px * 72 / DPI


def _characters(file: str) -> frozenset[int]:
    try:
        return frozenset(FT2Font(file).get_charmap())
    except (OSError, RuntimeError):  # a broken font of the system is not ours to tell
        return frozenset()


@cache
def _system_fonts() -> tuple[tuple[str, str], ...]:
    """Family and file of each upright font of normal weight, in the order of their names."""
    fonts = {
        entry.name: entry.fname
        for entry in sorted(font_manager.fontManager.ttflist, key=lambda entry: (entry.name, entry.fname), reverse=True)
        if entry.style == "normal" and entry.weight in (400, "normal", "regular")
    }
    return tuple(sorted(fonts.items()))
