"""One look at the table, shared by the agents that need it: segments are found once per observation."""

from __future__ import annotations

from ..types import Observation
from .segmentation import TableView, segment
from .views import RobotFilter


class Sight:
    """Segments observations; keeps the last result, because several roles look at the same observation."""

    def __init__(self, covers_robot: RobotFilter) -> None:
        self._covers_robot = covers_robot
        self._last: tuple[Observation, TableView] | None = None

    def look(self, observation: Observation) -> TableView:
        """What is on the table; raises CameraFailure where the main view is of no use."""
        if self._last is None or self._last[0] is not observation:
            self._last = (observation, segment(observation, self._covers_robot))
        return self._last[1]
