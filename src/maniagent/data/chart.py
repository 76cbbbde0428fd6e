"""Drawing on a table seen from above: metres to pixels, axes, a legend. Twice the size first, for smooth edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..geometry import FloatArray
from ..perception.viewpoint import Viewpoint

Colour = tuple[int, int, int]

SCALE = 1300
"""px of the finished picture per metre."""
_FINE = 2
"""Drawn so much larger than it is kept."""
_LEFT, _TOP, _RIGHT, _BOTTOM = 74, 66, 300, 66
"""px around the table: axis, title, legend, axis."""
_TICK = 0.1
"""m between the lines across the table."""
INK: Colour = (38, 43, 51)
_PAPER, _FAINT, _LINE = (255, 255, 255), (108, 116, 126), (205, 211, 218)

_BARS = 24
_BAR: Colour = (112, 150, 192)

Mark = Callable[["Chart", FloatArray], None]
"""Draws something at a place (2,) px."""


@dataclass(frozen=True)
class Entry:
    """One line of the legend."""

    text: str
    mark: Mark | None = None


class Chart:
    """A picture of a part of the table. Places are (..., 2): m in the base frame, or px of the finished picture."""

    def __init__(self, low: FloatArray, high: FloatArray, viewpoint: Viewpoint) -> None:
        """From `low` to `high`, (2,) m each, along the viewer's right and away from the viewer."""
        self._low, self._high, self._viewpoint = low, high, viewpoint
        width, height = ((high - low) * SCALE).round().astype(int)
        self.size = (int(width) + _LEFT + _RIGHT, int(height) + _TOP + _BOTTOM)
        """px of the finished picture."""
        self._image = Image.new("RGB", (self.size[0] * _FINE, self.size[1] * _FINE), _PAPER)
        self._draw = ImageDraw.Draw(self._image)

    @classmethod
    def around(cls, xy: FloatArray, viewpoint: Viewpoint) -> Self:
        """A chart that shows all the places (N, 2) m, base frame."""
        seen = np.asarray(xy) @ np.stack([viewpoint.right, viewpoint.away]).T
        return cls(seen.min(axis=0), seen.max(axis=0), viewpoint)

    def pixel(self, xy: FloatArray) -> FloatArray:
        """Where places (m) are in the picture (px)."""
        right, away = xy @ self._viewpoint.right, xy @ self._viewpoint.away
        return np.stack(
            [_LEFT + (right - self._low[0]) * SCALE, _TOP + (self._high[1] - away) * SCALE],
            axis=-1,
        )

    def squares(self, side: int) -> FloatArray:
        """(rows, columns, 2) m: the middles of squares of `side` px that cover the table, from its top left."""
        width, height = ((self._high - self._low) * SCALE).round()
        u, v = np.meshgrid(np.arange(side / 2, width, side), np.arange(side / 2, height, side))
        right, away = self._low[0] + u / SCALE, self._high[1] - v / SCALE
        return right[..., None] * self._viewpoint.right + away[..., None] * self._viewpoint.away

    def shade(self, opacity: FloatArray, colour: Colour, side: int) -> None:
        """Colour the `squares`, each as much (0 to 1) as (rows, columns) says."""
        mask = Image.fromarray((opacity * 255).astype(np.uint8))
        mask = mask.resize((mask.width * side * _FINE, mask.height * side * _FINE), Image.Resampling.BILINEAR)
        self._image.paste(colour, (_LEFT * _FINE, _TOP * _FINE), mask)

    def polygon(self, places: FloatArray, fill: Colour | None, outline: Colour | None = None, width: float = 1) -> None:
        """A closed shape through places (N, 2) px."""
        corners = [tuple(corner) for corner in (places * _FINE).tolist()]
        self._draw.polygon(corners, fill)
        if outline is not None:
            self._draw.line([*corners, *corners[:2]], outline, round(width * _FINE), joint="curve")

    def disc(
        self, place: FloatArray, radius: float, fill: Colour | None, outline: Colour | None = None, width: float = 1
    ) -> None:
        """A circle around a place (2,) px."""
        (u, v), r = place * _FINE, radius * _FINE
        self._draw.ellipse((u - r, v - r, u + r, v + r), fill, outline, round(width * _FINE))

    def line(self, start: FloatArray, end: FloatArray, colour: Colour, width: float = 1) -> None:
        """A straight line between places (2,) px."""
        self._draw.line([*(start * _FINE).tolist(), *(end * _FINE).tolist()], colour, round(width * _FINE))

    def text(self, place: FloatArray, words: str, size: float, colour: Colour = INK, anchor: str = "lm") -> None:
        """Words at a place (2,) px; `anchor` as Pillow has it."""
        font = ImageFont.load_default(size * _FINE)
        self._draw.text(tuple((place * _FINE).tolist()), words, fill=colour, font=font, anchor=anchor)

    def axes(self) -> None:
        """Lines across the table every 10 cm, with the base frame's coordinates (cm) where those run along."""
        width, height = self.size
        for axis, direction in enumerate((self._viewpoint.right, self._viewpoint.away)):
            name, sign = _name(direction, ("to the right", "away from the viewer")[axis])
            for tick in np.arange(np.ceil(self._low[axis] / _TICK), np.floor(self._high[axis] / _TICK) + 1) * _TICK:
                label = f"{round(100 * sign * tick) + 0:d}"
                if axis == 0:
                    u = _LEFT + (tick - self._low[0]) * SCALE
                    self.line(np.array([u, _TOP]), np.array([u, height - _BOTTOM]), _LINE)
                    self.text(np.array([u, height - _BOTTOM + 14]), label, 13, _FAINT, "mm")
                else:
                    v = _TOP + (self._high[1] - tick) * SCALE
                    self.line(np.array([_LEFT, v]), np.array([width - _RIGHT, v]), _LINE)
                    self.text(np.array([_LEFT - 10, v]), label, 13, _FAINT, "rm")
            if axis == 0:
                middle = (_LEFT + width - _RIGHT) / 2
                self.text(np.array([middle, height - 22]), name, 14, INK, "mm")
            else:
                self.text(np.array([12, _TOP - 16]), name, 14, INK)

    def title(self, words: str) -> None:
        """Words above the table."""
        self.text(np.array([_LEFT, 24]), words, 20)

    def view_direction(self) -> None:
        """An arrow below the table, the way that the person looks who sees the main view."""
        tip = np.array([self.size[0] - _RIGHT - 16.0, self.size[1] - _BOTTOM + 30.0])
        self.line(tip + np.array([0, 26]), tip, INK, 2)
        self.polygon(tip + np.array([(-6, 4), (6, 4), (0, -8)]), INK)
        self.text(tip + np.array([-14, 14]), "camera looks this way", 14, INK, "rm")

    def legend(self, entries: Sequence[Entry]) -> float:
        """What the marks mean, beside the table; where that ends, px from the top."""
        u, v = self.size[0] - _RIGHT + 30, _TOP + 14
        for number, entry in enumerate(entries):
            place = np.array([u, v + 34 * number])
            if entry.mark is not None:
                entry.mark(self, place)
            self.text(place + np.array([24 if entry.mark else -8, 0]), entry.text, 15)
        return float(v + 34 * len(entries))

    def histogram(self, top: float, values: FloatArray, threshold: float, title: str) -> None:
        """How often each value (N,) comes, beside the table from `top` px on, with a line at the threshold.

        Values beyond twice the threshold are counted in the last bar.
        """
        low, high = np.array([self.size[0] - _RIGHT + 22.0, self.size[1] - _BOTTOM]), self.size[0] - 24.0
        tall = min(150.0, low[1] - top - 70.0)
        counts, _ = np.histogram(np.minimum(values, 2 * threshold * (1 - 1e-9)), bins=_BARS, range=(0, 2 * threshold))
        wide = (high - low[0]) / _BARS
        self.text(low - np.array([0, tall + 40]), title, 14)
        for number, count in enumerate(counts):
            left, height = low[0] + number * wide, tall * count / max(counts.max(), 1)
            box = np.array([(left, low[1]), (left, low[1] - height), (left + wide - 1, low[1] - height)])
            if count:
                self.polygon(np.vstack([box, (left + wide - 1, low[1])]), _BAR)
        self.line(low, np.array([high, low[1]]), _FAINT)
        middle = (low[0] + high) / 2
        self.line(np.array([middle, low[1]]), np.array([middle, low[1] - tall - 6]), INK, 1.5)
        self.text(np.array([middle, low[1] - tall - 16]), "threshold", 13, _FAINT, "mm")
        for share, more in ((0.0, ""), (1.0, ""), (2.0, "+")):
            place = np.array([low[0] + share * (middle - low[0]), low[1] + 14])
            self.text(place, f"{share * threshold:g}{more}", 13, _FAINT, "mm")

    def finished(self) -> Image.Image:
        """The picture."""
        return self._image.resize(self.size, Image.Resampling.LANCZOS)


def _name(direction: FloatArray, otherwise: str) -> tuple[str, int]:
    """The name of an axis of the picture, and the sign with which its coordinate counts."""
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < np.cos(np.radians(1.0)):
        return f"{otherwise}, cm from the robot's base", 1
    return f"{'xy'[axis]}, cm", int(np.sign(direction[axis]))
