"""One look at the table, shared by the agents that need it: segments are found once per observation."""

from __future__ import annotations

from ..types import Observation
from .rig import Rig
from .segmentation import TableView, segment


class Sight:
    """Segments observations; keeps the last result, because several roles look at the same observation."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._last: tuple[Observation, TableView] | None = None

    def look(self, observation: Observation) -> TableView:
        """What is on the table; raises CameraFailure where the main view is of no use."""
        if self._last is None or self._last[0] is not observation:
            self._last = (observation, segment(observation, self.rig))
        return self._last[1]
