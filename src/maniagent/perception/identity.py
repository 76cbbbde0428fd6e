"""Recognising a thing that was seen before, by its looks and size: names change when things are moved.

"The pepper in the middle" is another one once the first is on the plate.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..geometry import FloatArray
from ..types import ObjectInfo

MAX_COLOUR_DISTANCE = 40.0
"""CIE Lab distance (8-bit scale, lightness halved) between two looks at one thing, in light and in shade."""
MAX_SIZE_RATIO = 1.6
"""Between two estimates of one thing's length, and of the side of a square as large: part of it may be hidden."""


def same_thing(before: ObjectInfo, now: ObjectInfo) -> bool:
    """Whether two objects look alike: by colour, by their longer horizontal side, and by their size from above."""
    colour = float(np.linalg.norm(_lab(before.colour) - _lab(now.colour)))
    alike = colour < MAX_COLOUR_DISTANCE and _near(before.extent[0], now.extent[0])
    return alike and _near(np.sqrt(before.extent[0] * before.extent[1]), np.sqrt(now.extent[0] * now.extent[1]))


def _near(a: float, b: float) -> bool:
    return bool(max(a, b) < MAX_SIZE_RATIO * max(min(a, b), 1e-3))


def find_again(before: ObjectInfo, now: Sequence[ObjectInfo], within: float = np.inf) -> ObjectInfo | None:
    """The object that looks like `before` and is nearest to where that was, `within` m of it; None without one."""
    alike = [thing for thing in now if same_thing(before, thing)]
    nearest = min(alike, key=lambda thing: _distance(before, thing), default=None)
    return nearest if nearest is not None and _distance(before, nearest) <= within else None


def _distance(a: ObjectInfo, b: ObjectInfo) -> float:
    return float(np.linalg.norm(a.centre[:2] - b.centre[:2]))


def _lab(rgb: tuple[int, int, int]) -> FloatArray:
    lab = cv2.cvtColor(np.array([[rgb]], np.uint8), cv2.COLOR_RGB2LAB)[0, 0].astype(float)
    return lab * [0.5, 1.0, 1.0]
