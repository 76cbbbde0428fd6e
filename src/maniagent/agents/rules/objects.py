"""Objects for a command, without a model: segments, the lexicon's words on them, antipodal grasps."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import DetectionFailure
from ...perception.lexicon import Lexicon
from ...perception.segmentation import TableView
from ...perception.sight import Sight
from ...perception.viewpoint import Viewpoint
from ...types import Observation, Subtask, SubtaskRecord
from ..locating import assemble, detection_of, find_tried, last_tried, offer_grasps
from ..memory import Memory
from ..protocols import Located
from .controller import drag_direction


class RulesObjectAgent:
    """Grounds the queries of a sub-task; the first one is the object that moves and gets grasps."""

    def __init__(self, sight: Sight, lexicon: Lexicon) -> None:
        self._sight = sight
        self._lexicon = lexicon

    def locate(self, subtask: Subtask, observation: Observation, memory: Memory) -> Located:
        """One object per query, in their order, and everything else as surroundings.

        Raises
        ------
        DetectionFailure
            Where a query can't be grounded, or several objects are equally good.
        GraspFailure
            Where the object that is to be moved offers no grasp.

        """
        view = self._sight.look(observation)
        viewpoint = Viewpoint.of(observation)
        attempts = memory.attempts(subtask.text)
        chosen = [self._find(i, query, view, viewpoint, attempts) for i, query in enumerate(subtask.objects)]
        if len(set(chosen)) < len(chosen):
            raise DetectionFailure(f"{' and '.join(map(repr, subtask.objects))} mean the same thing.")
        moved = view.segments[chosen[0]]
        way = drag_direction(subtask.text, moved.centre[:2], viewpoint)
        grasps = offer_grasps(subtask.objects[0], moved, view, self._sight.rig, attempts, way)
        found = [
            (query, segment, detection_of(segment, query, self._lexicon.score(query, segment), observation))
            for query, segment in zip(subtask.objects, (view.segments[k] for k in chosen), strict=True)
        ]
        others = [(self._lexicon.name(s), s) for k, s in enumerate(view.segments) if k not in chosen]
        return assemble(found, grasps, others)

    def _find(
        self, i: int, query: str, view: TableView, viewpoint: Viewpoint, attempts: Sequence[SubtaskRecord]
    ) -> int:
        """Index of the segment a query means; on a retry, the thing that was tried before, wherever it went."""
        tried = last_tried(attempts, i)
        if tried is None:
            return self._lexicon.ground(query, view.segments, viewpoint)
        again = find_tried(tried, i, view.segments)
        if again is None:
            raise DetectionFailure(f"The {query} that was tried before is out of view.")
        return again
