"""From a detector's 2-D box to a thing in 3-D, by depth: the middle of a box isn't the middle of a thing.

The pixel at a box's centre may show the far rim, the side, or the table through a hollow, and a grasp planned there
misses (the paper's task-4 failure). So a box only says which thing is meant: the segment whose own box agrees with
it, or else what rises from its surroundings inside the box. Where nothing does, a photo or a print was boxed.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry import FloatArray, backproject, transform_points
from ...types import BoolArray, CameraFrame, Detection
from ..segmentation import TableView
from ..segments import Segment
from .protocol import Box, Match, box_of

AGREEING = 0.5
"""Intersection over union from which two outlines show the same thing."""
MAX_SHARE = 0.8
"""Of the picture: detectors box all of it where they don't find a thing."""
MIN_PIXELS = 20
"""Seen with depth; fewer are noise."""
RISE = 0.004
"""m: what stands that much above its surroundings is a thing; less than segmentation asks, for the box vouches too."""
TABLE_BAND = 0.015
"""m around z = 0 in which the surroundings are the table itself, seen with an error of calibration."""
MARGIN = 0.15
"""Of the box's longer side: how far around it its surroundings are looked at."""


def match_boxes(
    query: str, scored: Iterable[tuple[Box, float]], view: TableView, frame: CameraFrame
) -> tuple[Match, ...]:
    """The things that a detector's boxes in `frame`, with scores in [0, 1], show: best first, each once.

    Boxes may be anything a network puts out: those without a thing in them (empty, outside the picture, not finite,
    drawn around a photo) count for nothing, and reversed corners are put right.
    """
    matches: list[Match] = []
    for box, score in sorted(scored, key=lambda item: -_finite(item[1])):
        clipped = clip_box(box, frame.depth.shape)
        segment = None if clipped is None else find_segment(clipped, view, frame)
        if clipped is None or segment is None or any(_same(segment, match.segment, frame.name) for match in matches):
            continue
        detection = Detection(query, clipped, _finite(score), frame.name, segment.masks[frame.name])
        matches.append(Match(detection, segment))
    return tuple(matches)


def clip_box(box: Box, shape: tuple[int, int]) -> Box | None:
    """The part of a box within a picture of `shape` (H, W), corners in order; None where that is no box of a thing."""
    if len(box) != 4 or not np.isfinite(box).all():
        return None
    height, width = shape
    x = np.clip(sorted((box[0], box[2])), 0, width - 1)
    y = np.clip(sorted((box[1], box[3])), 0, height - 1)
    across, down = float(x[1] - x[0]), float(y[1] - y[0])
    if min(across, down) < 1 or across * down > MAX_SHARE * width * height:
        return None
    return float(x[0]), float(y[0]), float(x[1]), float(y[1])


def find_segment(box: Box, view: TableView, frame: CameraFrame) -> Segment | None:
    """The segment that a box (as of `clip_box`) shows, a new one where segmentation has none; None for no thing."""
    seen = [s for s in view.segments if frame.name in s.masks and s.masks[frame.name].any()]
    overlaps = [_box_overlap(box, box_of(segment.masks[frame.name])) for segment in seen]
    best = int(np.argmax(overlaps)) if seen else -1
    if seen and overlaps[best] >= AGREEING:
        return seen[best]
    new = cut_segment(box, frame)
    # A loose box holds a known thing after all: that one is better, it is fused from all views.
    return next((s for s in seen if new is not None and _same(s, new, frame.name)), new)


def cut_segment(box: Box, frame: CameraFrame) -> Segment | None:
    """What rises from its surroundings inside a box (as of `clip_box`), hollows included; None where nothing does.

    Of several things, the one that fills the middle of the box best.
    """
    rows, columns, inside = _neighbourhood(box, frame.depth.shape)
    points = _base_points(frame)[rows, columns]
    height = points[..., 2]
    known = np.isfinite(height)
    if np.count_nonzero(known & inside) < MIN_PIXELS:
        return None
    around = height[known & ~inside]
    # A box at the picture's edge may have no surroundings; then its lowest parts stand for them.
    level = float(np.median(around)) if len(around) >= MIN_PIXELS else float(np.percentile(height[known], 5))
    rising = inside & known & (height > level + RISE)
    mask = _central_part(rising, inside) & known
    if np.count_nonzero(mask & rising) < MIN_PIXELS:
        return None
    on_table = abs(level) < TABLE_BAND
    found = points[mask] - np.array([0.0, 0.0, level if on_table else 0.0], np.float32)
    whole = np.zeros(frame.depth.shape, bool)
    whole[rows, columns] = mask
    return Segment(found, frame.rgb[whole], 0.0 if on_table else level, {frame.name: whole})


def _neighbourhood(box: Box, shape: tuple[int, int]) -> tuple[slice, slice, BoolArray]:
    """Rows and columns of a window around a box, and where in the window the box is."""
    left, top, right, bottom = (round(side) for side in box)
    margin = max(4, round(MARGIN * max(right - left, bottom - top)))
    first_row, first_column = max(top - margin, 0), max(left - margin, 0)
    rows = slice(first_row, min(bottom + margin + 1, shape[0]))
    columns = slice(first_column, min(right + margin + 1, shape[1]))
    inside = np.zeros((rows.stop - rows.start, columns.stop - columns.start), bool)
    inside[top - first_row : bottom - first_row + 1, left - first_column : right - first_column + 1] = True
    return rows, columns, inside


def _base_points(frame: CameraFrame) -> NDArray[np.float32]:
    """(H, W, 3) m, base frame; NaN where the depth is unknown."""
    # The median takes out most of the depth noise and keeps edges; it can't handle NaN, zero stands for it.
    known = np.isfinite(frame.depth) & (frame.depth > 0)
    smooth = np.asarray(cv2.medianBlur(np.where(known, frame.depth, np.float32(0)), 5), np.float32)
    depth = np.where(known & (smooth > 0), smooth, np.float32(np.nan))
    return transform_points(frame.T_base_camera, backproject(frame.K, depth)).astype(np.float32)


def _central_part(rising: BoolArray, inside: BoolArray) -> BoolArray:
    """The connected part that weighs most, pixels near the middle of the box weighing more; its hollows filled.

    Without its hollow a bowl would be its rim, whose colour and height at the middle are not the bowl's.
    """
    closed = cv2.morphologyEx(rising.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, parts = cv2.connectedComponents(closed, connectivity=8)
    weights = np.bincount(parts.ravel(), _central_weights(inside).ravel(), minlength=count)
    if count < 2:
        return np.zeros_like(inside)
    part = (parts == 1 + int(weights[1:].argmax())).astype(np.uint8)
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(part), contours, -1, 1, cv2.FILLED)
    return (filled > 0) & inside


def _central_weights(inside: BoolArray) -> FloatArray:
    """(H, W): a Gaussian about the middle of the box with half its sides as deviations."""
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    y = (np.arange(inside.shape[0]) - rows.mean()) / (len(rows) / 2)
    x = (np.arange(inside.shape[1]) - columns.mean()) / (len(columns) / 2)
    return np.exp(-0.5 * (y[:, None] ** 2 + x[None, :] ** 2))


def _box_overlap(a: Box, b: Box) -> float:
    """Intersection over union, in [0, 1]."""

    def area(left: float, top: float, right: float, bottom: float) -> float:
        return max(right - left + 1, 0.0) * max(bottom - top + 1, 0.0)

    both = area(max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3]))
    return both / (area(*a) + area(*b) - both)


def _same(a: Segment, b: Segment, frame: str) -> bool:
    if a is b:
        return True
    one, other = a.masks[frame], b.masks[frame]
    return bool(np.count_nonzero(one & other) >= AGREEING * np.count_nonzero(one | other))


def _finite(score: float) -> float:
    """A score in [0, 1], whatever a network puts out."""
    return float(np.clip(np.nan_to_num(score, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0))
