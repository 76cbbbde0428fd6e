"""Where an attempt was to leave the object, and how far from there a fresh look finds it.

Success by distance (ManiAgent, section on automatic data collection), for any skill: a bound sequence says where the
thing it took would be when the fingers open. Measured by what the robot sees, never by the simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry import FloatArray
from ..perception.identity import same_thing
from ..types import Event, Gripper, KeyPoint, ObjectInfo, SubtaskRecord, Verdict

THRESHOLD = 0.03
"""m from its place within which an object counts as arrived; the paper takes 0.15."""


@dataclass(frozen=True)
class Landing:
    """Where an object was to come to rest, and where it is."""

    expected: FloatArray
    """(2,) m, base frame, of the middle of its bounding box."""
    found: ObjectInfo | None
    """What looks like it, nearest to there; None where nothing does."""

    @property
    def distance(self) -> float | None:
        """m, horizontal."""
        return None if self.found is None else float(np.linalg.norm(self.found.centre[:2] - self.expected))


class Outcomes:
    """An Observer that keeps what was last planned, for measuring what came of it."""

    def __init__(self, threshold: float = THRESHOLD) -> None:
        self.threshold = threshold
        self._keypoints: tuple[KeyPoint, ...] = ()
        self.distances: list[float | None] = []
        """m, of the attempts judged since `begin`, oldest first; None where the object wasn't seen."""

    def begin(self) -> None:
        """Forget what was judged."""
        self._keypoints, self.distances = (), []

    def on_event(self, event: Event) -> None:
        """Take note of bound sequences."""
        if event.kind == "reasoned":
            self._keypoints = ()
        elif event.kind == "planned":
            self._keypoints = tuple(event.data["keypoints"])

    def landing(self, record: SubtaskRecord, now: Sequence[ObjectInfo]) -> Landing | None:
        """What came of the latest attempt, `now` being all that is seen; None where nothing was to be let go."""
        expected = release_point(self._keypoints, record.objects)
        if expected is None:
            return None
        alike = [thing for thing in now if same_thing(record.objects[0], thing)]
        found = min(alike, key=lambda thing: float(np.linalg.norm(thing.centre[:2] - expected)), default=None)
        return Landing(expected, found)

    def judge(self, record: SubtaskRecord, now: Sequence[ObjectInfo]) -> tuple[Verdict, str]:
        """Verdict on the latest attempt, with the evidence."""
        landing = self.landing(record, now)
        if landing is None:
            return Verdict.FAILURE, record.outcome.reason or "Nothing was carried anywhere."
        self.distances.append(landing.distance)
        name, reason = record.objects[0].name, record.outcome.reason
        if landing.distance is None:
            return Verdict.FAILURE, f"The {name} is out of view. {reason}".strip()
        seen = f"The {name} lies {landing.distance * 100:.1f} cm from where it should."
        if landing.distance <= self.threshold:
            return Verdict.SUCCESS, seen
        return Verdict.FAILURE, f"{seen} {reason}".strip()


def release_point(keypoints: Sequence[KeyPoint], objects: Sequence[ObjectInfo]) -> FloatArray | None:
    """(2,) where the middle of the object that is taken will be when the fingers open; None where they never do."""
    taken: KeyPoint | None = None
    for point in keypoints:
        if point.gripper is Gripper.CLOSE and taken is None:
            taken = point
        elif point.gripper is Gripper.OPEN and taken is not None and point.held is not None:
            moved = next(thing for thing in objects if thing.index == point.held)
            T_moved = point.T_base_tcp @ np.linalg.inv(taken.T_base_tcp)
            place: FloatArray = (T_moved @ np.append(moved.centre, 1.0))[:2]
            return place
    return None
