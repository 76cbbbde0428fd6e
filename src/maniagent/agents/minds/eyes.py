"""What the roles of one robot see together: this turn's observation, segmented once, and a detector to ask about it.

The ReasoningAgent is handed text alone. Where it asks for a position, or what became of a thing that was moved, the
answer comes from here and goes into its prompt as text.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import DetectionFailure, SceneFailure
from ...perception.detectors.protocol import Detector, Match
from ...perception.segmentation import TableView
from ...perception.segments import Segment
from ...perception.sight import Sight
from ...perception.viewpoint import Viewpoint
from ...types import ObjectInfo, Observation, SubtaskRecord
from ..locating import find_tried
from .telling import one_line

MOST_MEASURED = 3
"""Things of one name whose positions are told."""


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
            found = [_whereabouts(match.segment) for match in matches[:MOST_MEASURED]]
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
            f"Measured: what looks like the {one_line(moved.name)} is now at {_whereabouts(now)},",
            f"{_centimetres(moved, now)} from where it was before",
        ]
        if target is not None:
            said.append(
                f"and {_centimetres(target, now)} beside the middle of where the {one_line(target.name)} was, which is "
                f"{target.extent[0] * 100:.0f} x {target.extent[1] * 100:.0f} cm wide and {target.top_z * 100:.1f} cm "
                "high"
            )
        return " ".join(said) + "."


def _whereabouts(segment: Segment) -> str:
    x, y, _ = segment.centre
    length, width, _ = segment.extent * 100
    return (
        f"({x:.3f}, {y:.3f}) m, {length:.0f} x {width:.0f} cm, from {segment.support_z * 100:.1f} to "
        f"{segment.top_z * 100:.1f} cm above the table"
    )


def _centimetres(before: ObjectInfo, now: Segment) -> str:
    return f"{float(np.linalg.norm(now.centre[:2] - before.centre[:2])) * 100:.1f} cm"
