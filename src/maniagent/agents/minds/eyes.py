"""What the roles of one robot see together: this turn's observation, segmented once, and a detector to ask about it.

The ReasoningAgent is handed text alone. Where it asks for a position, or what became of a thing that was moved, the
answer comes from here and goes into its prompt as text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from ...errors import DetectionFailure, SceneFailure
from ...geometry import FloatArray, wrap_angle
from ...perception.detectors.protocol import Detector, Match
from ...perception.segmentation import TableView
from ...perception.segments import Segment
from ...perception.sight import Sight
from ...perception.viewpoint import Viewpoint
from ...types import Observation, SubtaskRecord
from ..locating import find_tried
from .telling import one_line

MOST_MEASURED = 3
"""Things of one name whose positions are told."""
LONG = 1.8
"""Length over width from which it is said where a thing points."""
_NUMBER = r"([+-]?\d*\.?\d+)"
_POINT = re.compile(rf"\(\s*{_NUMBER}\s*,\s*{_NUMBER}\s*\)")


class Eyes:
    """Shared by the four roles of one set of agents; holds the latest observation."""

    def __init__(self, sight: Sight, detector: Detector) -> None:
        self._sight = sight
        self._detector = detector
        self._observation: Observation | None = None

    def look(self, observation: Observation) -> TableView:
        """What is on the table now. Raises CameraFailure where the main view is of no use."""
        view = self._sight.look(observation)
        self._observation = observation
        return view

    @property
    def observation(self) -> Observation:
        """The latest; SceneFailure before the first look."""
        if self._observation is None:
            raise SceneFailure("Nobody has looked at the table yet.")
        return self._observation

    @property
    def viewpoint(self) -> Viewpoint:
        """Of the latest main view."""
        return Viewpoint.of(self.observation)

    def find(self, queries: Sequence[str]) -> tuple[tuple[Match, ...], ...]:
        """For each query what the detector makes out in the latest observation, best first."""
        return self._detector.detect(queries, self._sight.look(self.observation), self.observation)

    def measure(self, names: Sequence[str]) -> str:
        """Where the named objects are, one a line, in metres."""
        try:
            matches_by_name = self.find(names)
        except DetectionFailure as failure:
            return f"nothing could be measured: {one_line(str(failure))}"
        lines = []
        for name, matches in zip(names, matches_by_name, strict=True):
            found = [self._whereabouts(match.segment) for match in matches[:MOST_MEASURED]]
            lines += [f"{one_line(name)}: {where}" for where in found or ["not found by the detector"]]
        return "\n".join(lines)

    def follow(self, record: SubtaskRecord) -> str:
        """What became of the object that an attempt was to move, by a look with depth; empty where it had none."""
        if not record.objects:
            return ""
        moved, target = record.objects[0], record.objects[1] if len(record.objects) > 1 else None
        segments = self._sight.look(self.observation).segments
        found = find_tried(record, 0, segments)
        if found is None:
            return (
                f"Measured: what looks like the {one_line(moved.name)} isn't seen as a thing of its own now; it is in "
                "the gripper, hidden, or hard to tell from what it lies on."
            )
        now = segments[found]
        said = [
            f"Measured: what looks like the {one_line(moved.name)} is now at {self._whereabouts(now)}",
            f"{_centimetres(moved.centre, now)} from where it was before",
        ]
        if _is_long(moved.extent) and _is_long(now.extent):
            turned = math.degrees(wrap_angle(now.yaw - moved.yaw, math.pi))
            said.append(f"turned by {turned:.0f} degrees, or by half a turn more")
        said += [f"{_centimetres(goal, now)} from {_tell_point(goal)}" for goal in _points_in(record.text)]
        if target is not None:
            said.append(
                f"{_centimetres(target.centre, now)} beside the middle of where the {one_line(target.name)} was, which "
                f"is {target.extent[0] * 100:.0f} x {target.extent[1] * 100:.0f} cm wide and "
                f"{target.top_z * 100:.1f} cm high"
            )
        return "; ".join(said) + "."

    def _whereabouts(self, segment: Segment) -> str:
        x, y, _ = segment.centre
        length, width, _ = segment.extent * 100
        said = (
            f"({x:.3f}, {y:.3f}) m, {length:.0f} x {width:.0f} cm, from {segment.support_z * 100:.1f} to "
            f"{segment.top_z * 100:.1f} cm above the table"
        )
        return f"{said}, {_tell_axis(segment.yaw, self.viewpoint)}" if _is_long(segment.extent) else said


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
