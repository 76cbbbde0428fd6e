"""Objects for a command, without a model: segments, the lexicon's words on them, antipodal grasps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import DetectionFailure, FailureStage, GraspFailure
from ...geometry import FloatArray
from ...perception.grasps import propose_grasps
from ...perception.identity import find_again
from ...perception.lexicon import Lexicon
from ...perception.rig import Rig
from ...perception.segmentation import TableView
from ...perception.segments import Segment
from ...perception.sight import Sight
from ...perception.viewpoint import Viewpoint
from ...types import Detection, GraspPose, Observation, Subtask, SubtaskRecord
from ..memory import Memory
from ..protocols import Located
from .commands import Action, Command
from .controller import direction_of
from .language import parse_instruction

LEAD_WEIGHT = 20.0
"""1/m: what a metre ahead of the object's middle is worth to a grasp that drags it, beside its score."""
UNMOVED = 0.02
"""m; what looks the same within that of its last place is the same thing."""


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
        command = parse_instruction(subtask.text)[0]
        grasps = _grasps(view.segments[chosen[0]], view, command, viewpoint, attempts, self._sight.rig)
        names = subtask.objects
        objects = tuple(view.segments[k].to_object(i, names[i], grasps if i == 0 else ()) for i, k in enumerate(chosen))
        others = [k for k in range(len(view.segments)) if k not in chosen]
        surroundings = tuple(
            view.segments[k].to_object(i, self._lexicon.name(view.segments[k]))
            for i, k in enumerate(others, len(chosen))
        )
        detections = tuple(
            _detection(view.segments[k], query, self._lexicon.score(query, view.segments[k]), observation)
            for k, query in zip(chosen, names, strict=True)
        )
        return Located(objects, detections, surroundings)

    def _find(
        self, i: int, query: str, view: TableView, viewpoint: Viewpoint, attempts: Sequence[SubtaskRecord]
    ) -> int:
        """Index of the segment a query means; on a retry, the thing that was tried before, wherever it went."""
        tried = next((record for record in reversed(attempts) if len(record.objects) > i), None)
        if tried is None:
            return self._lexicon.ground(query, view.segments, viewpoint)
        now = [segment.to_object(k, query) for k, segment in enumerate(view.segments)]
        # A neighbour that looks the same and still lies where it lay is another thing, however near.
        unmoved = {again.index for other in tried.surroundings if (again := find_again(other, now, UNMOVED))}
        again = find_again(tried.objects[i], [thing for thing in now if thing.index not in unmoved])
        if again is None:
            raise DetectionFailure(f"The {query} that was tried before is out of view.")
        return again.index


def _grasps(
    segment: Segment,
    view: TableView,
    command: Command,
    viewpoint: Viewpoint,
    attempts: Sequence[SubtaskRecord],
    rig: Rig,
) -> tuple[GraspPose, ...]:
    """The object's grasps, best first; each attempt that failed to hold it moves on to the next."""
    drags = command.action in (Action.DRAG, Action.PUSH)
    # For dragging, grasps are wanted on every side of an object, not only the best few.
    tuning = replace(rig.grasping, centres=120, yaws=24, count=40) if drags else rig.grasping
    grasps = propose_grasps(segment, view.height_map, rig.gripper, tuning)
    if not grasps:
        width = segment.extent[1]
        why = f"it is {width * 100:.1f} cm wide, the gripper opens {rig.gripper.max_opening * 100:.1f} cm"
        if width + 0.006 < rig.gripper.max_opening:
            why = "it lies too flat, or other things are in the way"
        raise GraspFailure(f"No grasp was found for the {command.object}: {why}.")
    if drags:
        grasps = _leading_first(grasps, segment, direction_of(command, segment.centre[:2], viewpoint))
    spoiled = (FailureStage.GRASP, FailureStage.CONTROL)
    tried = sum(record.outcome.stage in spoiled for record in attempts) % len(grasps)
    return grasps[tried:] + grasps[:tried]


def _leading_first(grasps: tuple[GraspPose, ...], segment: Segment, direction: FloatArray) -> tuple[GraspPose, ...]:
    """Grasps straight ahead of the middle come first: what is pulled swings round until its middle trails the fingers.

    How far ahead counts in metres, so that it matters for a plate and hardly for a block.
    """

    def lead(grasp: GraspPose) -> float:
        return float((grasp.T_base_grasp[:2, 3] - segment.centre[:2]) @ direction)

    return tuple(sorted(grasps, key=lambda grasp: -(grasp.score + LEAD_WEIGHT * lead(grasp))))


def _detection(segment: Segment, query: str, score: float, observation: Observation) -> Detection:
    """Where a segment is in the main view."""
    mask = segment.masks.get(observation.main)
    if mask is None or not mask.any():
        return Detection(query, (0.0, 0.0, 0.0, 0.0), score, observation.main)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = (float(columns[0]), float(rows[0]), float(columns[-1]), float(rows[-1]))
    return Detection(query, box, score, observation.main, mask)
