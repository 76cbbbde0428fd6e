"""Things outlined and numbered on a picture, so that a vision-language model can point at them.

The idea is Set-of-Mark prompting (Yang et al. 2023, arXiv:2310.11441): models that can't say where a thing is in
pixels read a number next to it well. Numbers stand beside things too small to carry one, and outlines outside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...types import BoolArray

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

COLOURS: tuple[Colour, ...] = (
    (255, 64, 64),
    (64, 160, 255),
    (255, 200, 0),
    (220, 80, 255),
    (0, 210, 150),
    (255, 130, 30),
    (120, 110, 255),
    (255, 100, 170),
)
"""RGB, in turn: neighbouring numbers differ."""
DARK: Colour = (12, 12, 12)
MIN_SIDE = 480
"""Pixels of the shorter side; smaller pictures are enlarged by a whole factor, or a number would cover a thing."""
FONT_SIZE = 15
GAP = 3
"""Pixels between a thing's outline and a number beside it."""
ROOM = 6
"""A number stands on a thing only where it covers at most one part in so many."""

_ON_LABEL, _ON_THING, _OUTSIDE = 50.0, 4.0, 1e6
"""What a label pixel costs on another label, on a thing, outside the picture; on the table it costs nothing."""


def draw_marks(rgb: Picture, masks: Sequence[BoolArray]) -> Picture:
    """The picture (H, W, 3) with what the masks (H, W) show outlined and numbered from 1, in their order.

    Small pictures come back enlarged. An empty mask gets no mark; its number stays unused. Raises ValueError for a
    mask of another size.
    """
    if any(mask.shape != rgb.shape[:2] for mask in masks):
        raise ValueError(f"all masks must have the picture's size {rgb.shape[:2]}")
    scale = max(1, -(-MIN_SIDE // min(rgb.shape[:2])))
    size = (rgb.shape[1] * scale, rgb.shape[0] * scale)
    picture: Picture = np.array(cv2.resize(rgb, size, interpolation=cv2.INTER_CUBIC), np.uint8)
    large = [mask.repeat(scale, axis=0).repeat(scale, axis=1).astype(np.uint8) for mask in masks]
    numbers = sorted((i for i, mask in enumerate(large) if mask.any()), key=lambda i: int(large[i].sum()))
    for i in reversed(numbers):
        _outline(picture, large[i], _colour(i))
    return _label(picture, {i: large[i] for i in numbers})


def _colour(index: int) -> Colour:
    return COLOURS[index % len(COLOURS)]


def _outline(picture: Picture, mask: Picture, colour: Colour) -> None:
    """A coloured line just outside the thing, between dark ones: it shows on any ground and hides nothing of it."""
    smooth = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    contours, _ = cv2.findContours(smooth, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    whole = cv2.drawContours(np.zeros_like(mask), contours, -1, 1, cv2.FILLED)
    one, two, three = (cv2.dilate(whole, np.ones((3, 3), np.uint8), iterations=i) for i in (1, 2, 3))
    picture[three > whole] = DARK
    picture[two > one] = colour


# Labels -----------------------------------------------------------------------------------------------------------


def _label(picture: Picture, masks: dict[int, Picture]) -> Picture:
    """Number the masks, by index, in their order: those that come first have the free choice."""
    height, width = picture.shape[:2]
    cost = np.zeros((height, width), np.float32)
    for mask in masks.values():
        cost[mask > 0] = _ON_THING
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FONT_SIZE)
    for i, mask in masks.items():
        text = str(i + 1)
        w, h = int(draw.textlength(text, font=font)) + 8, FONT_SIZE + 4
        x, y = _best_place(mask, cost, w, h)
        cost[max(y, 0) : y + h, max(x, 0) : x + w] = _ON_LABEL
        _draw_label(draw, font, text, (x, y, w, h), mask, _colour(i))
    return np.asarray(image)


def _best_place(mask: Picture, cost: NDArray[np.float32], w: int, h: int) -> tuple[int, int]:
    """Left upper corner of a label of w x h pixels: on a large thing, else beside it where it hides least."""
    area = int(mask.sum())
    x, y = _middle(mask)
    on_it = (x - w // 2, y - h // 2)
    inside = mask[max(on_it[1], 0) : on_it[1] + h, max(on_it[0], 0) : on_it[0] + w]
    free = cost[max(on_it[1], 0) : on_it[1] + h, max(on_it[0], 0) : on_it[0] + w].max(initial=0.0) < _ON_LABEL
    if free and int(inside.sum()) == w * h and area > ROOM * w * h:
        return on_it
    left, top, across, down = cv2.boundingRect(mask)
    places = list(_places_beside((left, top, left + across, top + down), w, h))
    return min(places, key=lambda place: _cost_of(place, cost, w, h) + 0.5 * np.hypot(place[0] - x, place[1] - y))


def _middle(mask: Picture) -> tuple[int, int]:
    """The pixel (x, y) deepest inside."""
    depth = cv2.distanceTransform(np.pad(mask, 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    row, column = np.unravel_index(int(depth.argmax()), depth.shape)
    return int(column), int(row)


def _places_beside(box: tuple[int, int, int, int], w: int, h: int) -> Iterator[tuple[int, int]]:
    """Left upper corners of labels around a box, near it and one label further off."""
    left, top, right, bottom = box
    for off in (GAP, GAP + h):
        xs = (left - off - w, left, (left + right - w) // 2, right - w, right + off)
        ys = (top - off - h, top, (top + bottom - h) // 2, bottom - h, bottom + off)
        yield from ((x, y) for x in xs for y in (ys[0], ys[-1]))
        yield from ((x, y) for x in (xs[0], xs[-1]) for y in ys[1:-1])


def _cost_of(place: tuple[int, int], cost: NDArray[np.float32], w: int, h: int) -> float:
    x, y = place
    if x < 0 or y < 0 or x + w > cost.shape[1] or y + h > cost.shape[0]:
        return _OUTSIDE
    return float(cost[y : y + h, x : x + w].sum())


def _draw_label(
    draw: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    text: str,
    place: tuple[int, int, int, int],
    mask: Picture,
    colour: Colour,
) -> None:
    """The number on a dark plate framed in the outline's colour; a line ties it to a thing that it is off."""
    x, y, w, h = place
    rows, columns = np.nonzero(mask)
    nearest = int(np.argmin((columns - x - w / 2) ** 2 + (rows - y - h / 2) ** 2))
    end = (int(columns[nearest]), int(rows[nearest]))
    gap = max(x - end[0], end[0] - x - w, y - end[1], end[1] - y - h)
    if gap > 2 * GAP:
        for width, fill in ((3, DARK), (1, colour)):
            draw.line([(x + w // 2, y + h // 2), end], fill=fill, width=width)
    draw.rounded_rectangle((x, y, x + w - 1, y + h - 1), radius=4, fill=DARK, outline=colour)
    draw.text((x + w / 2, y + h / 2), text, font=font, fill=(255, 255, 255), anchor="mm")
