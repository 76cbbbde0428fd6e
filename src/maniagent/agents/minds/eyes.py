"""What the roles of one robot see together: this turn's observation, segmented once, and a detector to ask about it.

The ReasoningAgent is handed text alone. Where it asks for a position, or what became of a thing that was moved, the
answer comes from here and goes into its prompt as text.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import DetectionFailure, SceneFailure
from ...perception.detectors.protocol import Detector, Match
from ...perception.segmentation import TableView
from ...perception.sight import Sight
from ...perception.viewpoint import Viewpoint
from ...types import Observation, SubtaskRecord
from .measuring import tell_outcome, tell_place
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
            found = [tell_place(match.segment, self.viewpoint) for match in matches[:MOST_MEASURED]]
            lines += [f"{one_line(name)}: {where}" for where in found or ["not found by the detector"]]
        return "\n".join(lines)

    def follow(self, record: SubtaskRecord) -> str:
        """What became of the object that an attempt was to move, by a look with depth; empty where it had none."""
        return tell_outcome(record, self._sight.look(self.observation).segments, self.viewpoint)
