"""Text, lines and scales for the pictures of a dataset, drawn with Pillow at twice the size and made smooth."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

Colour = tuple[int, int, int]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom, px."""

PAPER: Colour = (255, 255, 255)
INK: Colour = (24, 28, 36)
QUIET: Colour = (110, 118, 132)
GRID: Colour = (203, 208, 217)

LINES: tuple[Colour, ...] = (
    (37, 99, 235),
    (234, 88, 12),
    (5, 150, 105),
    (190, 24, 93),
    (109, 40, 217),
    (8, 145, 178),
    (161, 98, 7),
    (82, 82, 91),
)
TINTS: tuple[Colour, ...] = (
    (219, 234, 254),
    (254, 243, 199),
    (209, 250, 229),
    (252, 231, 243),
    (237, 233, 254),
    (204, 251, 241),
)
"""Backgrounds that tell sub-tasks apart and leave lines readable."""

_SCALE = 2


class Canvas:
    """A white picture to draw on, in pixels of the finished one."""

    def __init__(self, width: int, height: int) -> None:
        self._image = Image.new("RGB", (width * _SCALE, height * _SCALE), PAPER)
        self._draw = ImageDraw.Draw(self._image)

    def text(self, x: float, y: float, text: str, size: int = 13, colour: Colour = INK, anchor: str = "la") -> None:
        """One line of text; `anchor` as Pillow has it: where in the text (x, y) is."""
        self._draw.text((x * _SCALE, y * _SCALE), text, font=_font(size), fill=colour, anchor=anchor)

    def box(self, box: Box, fill: Colour | None = None, outline: Colour | None = None) -> None:
        """A rectangle."""
        if box[2] > box[0] and box[3] > box[1]:
            self._draw.rectangle([side * _SCALE for side in box], fill=fill, outline=outline, width=_SCALE)

    def line(self, points: Sequence[tuple[float, float]], colour: Colour, width: float = 1.0) -> None:
        """A line through the points."""
        scaled = [(x * _SCALE, y * _SCALE) for x, y in points]
        self._draw.line(scaled, fill=colour, width=max(1, round(width * _SCALE)), joint="curve")

    def picture(self, x: float, y: float, picture: Image.Image, width: int, height: int) -> None:
        """A picture, scaled to `width` by `height`."""
        size = (width * _SCALE, height * _SCALE)
        self._image.paste(picture.resize(size, Image.Resampling.LANCZOS), (round(x * _SCALE), round(y * _SCALE)))

    def finished(self) -> Image.Image:
        """The picture, made smooth."""
        width, height = self._image.size
        return self._image.resize((width // _SCALE, height // _SCALE), Image.Resampling.BOX)


def width_of(text: str, size: int) -> float:
    """How many px a line of text takes."""
    return _font(size).getlength(text) / _SCALE


def fitted(text: str, size: int, width: float) -> str:
    """The text, cut with an ellipsis where it is wider than `width` px."""
    if width_of(text, size) <= width:
        return text
    while text and width_of(text + "...", size) > width:
        text = text[:-1]
    return text.rstrip() + "..."


def wrapped(text: str, size: int, width: float, lines: int) -> list[str]:
    """The text in at most `lines` lines of `width` px, the last one cut where need be."""
    out: list[str] = []
    words = text.split()
    while words:
        if len(out) == lines - 1:
            return [*out, fitted(" ".join(words), size, width)]
        count = 1
        while count < len(words) and width_of(" ".join(words[: count + 1]), size) <= width:
            count += 1
        out.append(fitted(" ".join(words[:count]), size, width))
        words = words[count:]
    return out


def ticks(low: float, high: float, wanted: int = 4) -> list[float]:
    """Round numbers between `low` and `high`, about `wanted` of them: steps of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return [low]
    raw = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next((m for m in (1.0, 2.0, 5.0) if m * power >= raw), 10.0)
    return [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def plain(text: str) -> str:
    """A text of somebody else's in one line that the font can draw."""
    return "".join(c if c.isprintable() else " " for c in text[:2000])


@functools.lru_cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _SCALE)
