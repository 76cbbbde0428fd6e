"""What is measured, in words: where things are, and what became of a thing that was moved.

A look with depth says it, never the simulator. Ends of long things look the same to it, and what lies flush on another
thing may be one with it; the words say so.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from ...geometry import FloatArray, rotation_z, wrap_angle
from ...perception.segments import Segment
from ...perception.viewpoint import Viewpoint
from ...types import ObjectInfo, SubtaskRecord
from ..locating import find_tried
from .telling import one_line

LONG = 1.8
"""Length over width from which it is said where a thing points."""
_NUMBER = r"([+-]?\d*\.?\d+)"
_POINT = re.compile(rf"\(\s*{_NUMBER}\s*,\s*{_NUMBER}\s*\)")


def tell_place(segment: Segment, viewpoint: Viewpoint) -> str:
    """Where a thing is, how large it is, and where it points if it is long."""
    x, y, _ = segment.centre
    said = f"({x:.3f}, {y:.3f}) m, {_size(segment.extent)}, top {segment.top_z * 100:.1f} cm above the table"
    return f"{said}, {_tell_axis(segment.yaw, viewpoint)}" if _is_long(segment.extent) else said


def tell_outcome(record: SubtaskRecord, segments: Sequence[Segment], viewpoint: Viewpoint) -> str:
    """What became of the object that an attempt was to move; empty where the attempt had none."""
    if not record.objects:
        return ""
    moved = record.objects[0]
    found = find_tried(record, 0, segments)
    now = None if found is None else segments[found]
    looks = f"Measured: what looks like the {one_line(moved.name)}"
    if now is None:
        said = [
            f"{looks} isn't seen as a thing of its own now; it is in the gripper, hidden, or one with what it lies on"
        ]
    else:
        said = [f"{looks} is now at {tell_place(now, viewpoint)}", *_tell_way(record.text, moved, now)]
    if len(record.objects) > 1:
        said.append(_tell_target(record.objects[1], now, segments))
    return "; ".join(said) + "."


def _tell_way(text: str, moved: ObjectInfo, now: Segment) -> list[str]:
    """How far a thing has come from where it was, and how far it is from where the sub-task's words send it."""
    said = [f"{_centimetres(moved.centre, now)} from where it was before"]
    if _is_long(moved.extent) and _is_long(now.extent):
        turned = round(math.degrees(wrap_angle(now.yaw - moved.yaw, math.pi)))
        said.append(f"turned by {turned} degrees (or {turned - 180 if turned > 0 else turned + 180})")
    return said + [f"{_centimetres(goal, now)} from {_tell_point(goal)}" for goal in _points_in(text)]


def _tell_target(target: ObjectInfo, moved: Segment | None, segments: Sequence[Segment]) -> str:
    """How what was moved lies to its target; where it can't be told apart, how high things stand there now."""
    name = one_line(target.name)
    where = f"where the {name} was ({_size(target.extent)}, top {target.top_z * 100:.1f} cm)"
    if moved is not None:
        over = "over" if _covers_point(target, moved.centre) else "not over"
        return f"its middle is {over} {where}, {_centimetres(target.centre, moved)} from the middle of that"
    tops = [segment.top_z for segment in segments if _covers_point(target, segment.centre)]
    if not tops:
        return f"nothing is seen {where}"
    return f"what stands now {where} is {max(tops) * 100:.1f} cm high"


def _covers_point(thing: ObjectInfo, point: FloatArray) -> bool:
    """Whether a point lies over an object's box, seen from above."""
    local = rotation_z(-thing.yaw)[:2, :2] @ (point[:2] - thing.centre[:2])
    return bool((np.abs(local) <= thing.extent[:2] / 2).all())


def _size(extent: FloatArray) -> str:
    return f"{extent[0] * 100:.0f} x {extent[1] * 100:.0f} cm"


def _is_long(extent: FloatArray) -> bool:
    return bool(extent[0] > LONG * extent[1])


def _tell_axis(yaw: float, viewpoint: Viewpoint) -> str:
    """Where a long thing points: how far off the viewing direction, either way."""
    axis = np.array([np.cos(yaw), np.sin(yaw)])
    off = math.degrees(wrap_angle(math.atan2(-axis @ viewpoint.right, axis @ viewpoint.away), math.pi))
    side = "counter-clockwise" if off > 0 else "clockwise"
    return f"long side {abs(off):.0f} degrees {side} of pointing away or towards the viewer"


def _points_in(text: str) -> list[FloatArray]:
    """The points (2,) that a sub-task names."""
    return [np.array([float(x), float(y)]) for x, y in _POINT.findall(text)]


def _tell_point(point: FloatArray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f})"


def _centimetres(place: FloatArray, now: Segment) -> str:
    return f"{float(np.linalg.norm(now.centre[:2] - place[:2])) * 100:.1f} cm"
