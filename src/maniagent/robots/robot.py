"""What the loop asks of a robot. Simulated or real, arm or benchmark bridge: the loop doesn't know."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from ..perception.rig import Rig
from ..types import ExecutionReport, KeyPoint, Observation, OrientedBox

Boxes = Mapping[int, OrientedBox]
"""The objects on the table by index: what a motion keeps clear of, but for those a key point may touch."""


class Robot(Protocol):
    """An arm with cameras.

    Nothing moves that was not checked: `execute` checks by itself and refuses with a report.
    """

    def observe(self) -> Observation:
        """Look at the table. Raises CameraFailure where a camera is missing or dead."""
        ...

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Raise MotionRejected, with one sentence why, where the key points can't be visited from here."""
        ...

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Visit the key points; always comes to rest, whatever happens on the way."""
        ...

    def go_home(self) -> ExecutionReport:
        """Move to the safe pose from which the cameras see the table; straight up first."""
        ...

    def stop(self) -> None:
        """Stand still, now."""
        ...

    @property
    def rig(self) -> Rig:
        """What perception must be told of the robot, its table and its cameras."""
        ...

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Call `hook(description, seconds)` when a move begins."""
        ...
