"""From found segments to objects with grasps: what object agents share, however they tell which segment is meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import FailureStage, GraspFailure
from ..geometry import FloatArray
from ..perception.grasps import propose_grasps
from ..perception.identity import find_again
from ..perception.rig import Rig
from ..perception.segmentation import TableView
from ..perception.segments import Segment
from ..types import Detection, GraspPose, Observation, SubtaskRecord
from .protocols import Located

LEAD_WEIGHT = 20.0
"""1/m: what a metre ahead of the object's middle is worth to a grasp that drags it, beside its score."""
UNMOVED = 0.02
"""m; what looks the same within that of its last place is the same thing."""


def last_tried(attempts: Sequence[SubtaskRecord], i: int) -> SubtaskRecord | None:
    """The latest attempt that had found the object of query `i`; None where none had."""
    return next((record for record in reversed(attempts) if len(record.objects) > i), None)


def find_tried(record: SubtaskRecord, i: int, segments: Sequence[Segment]) -> int | None:
    """Index of the segment that is object `i` of an earlier attempt, wherever it went; None where it isn't in view."""
    now = [segment.to_object(k, record.objects[i].name) for k, segment in enumerate(segments)]
    # A neighbour that looks the same and still lies where it lay is another thing, however near.
    unmoved = {again.index for other in record.surroundings if (again := find_again(other, now, UNMOVED))}
    again = find_again(record.objects[i], [thing for thing in now if thing.index not in unmoved])
    return None if again is None else again.index


def offer_grasps(
    name: str,
    segment: Segment,
    view: TableView,
    rig: Rig,
    attempts: Sequence[SubtaskRecord],
    way: FloatArray | None = None,
) -> tuple[GraspPose, ...]:
    """The object's grasps, best first; each attempt that failed to hold it moves on to the next.

    `way` is the direction (2,), base frame, in which the object is dragged; zeros where it isn't known, None where
    it is lifted. Raises GraspFailure where the gripper finds no hold.
    """
    # For dragging, grasps are wanted on every side of an object, not only the best few.
    tuning = rig.grasping if way is None else replace(rig.grasping, centres=120, yaws=24, count=40)
    grasps = propose_grasps(segment, view.height_map, rig.gripper, tuning)
    if not grasps:
        raise GraspFailure(f"No grasp was found for the {name}: {_why_none(segment, rig)}.")
    if way is not None:
        grasps = _leading_first(grasps, segment, way)
    spoiled = (FailureStage.GRASP, FailureStage.CONTROL)
    tried = sum(record.outcome.stage in spoiled for record in attempts) % len(grasps)
    return grasps[tried:] + grasps[:tried]


def _why_none(segment: Segment, rig: Rig) -> str:
    width = segment.extent[1]
    if width + 0.006 < rig.gripper.max_opening:
        return "it lies too flat, or other things are in the way"
    return f"it is {width * 100:.1f} cm wide, the gripper opens {rig.gripper.max_opening * 100:.1f} cm"


def _leading_first(grasps: tuple[GraspPose, ...], segment: Segment, way: FloatArray) -> tuple[GraspPose, ...]:
    """Grasps straight ahead of the middle come first: what is pulled swings round until its middle trails the fingers.

    How far ahead counts in metres, so that it matters for a plate and hardly for a block.
    """

    def lead(grasp: GraspPose) -> float:
        return float((grasp.T_base_grasp[:2, 3] - segment.centre[:2]) @ way)

    return tuple(sorted(grasps, key=lambda grasp: -(grasp.score + LEAD_WEIGHT * lead(grasp))))


def assemble(
    chosen: Sequence[tuple[str, Segment, Detection]],
    grasps: tuple[GraspPose, ...],
    others: Sequence[tuple[str, Segment]],
) -> Located:
    """What was chosen, numbered in the order of the queries, the first with its grasps; then everything else."""
    objects = tuple(s.to_object(i, name, () if i else grasps) for i, (name, s, _) in enumerate(chosen))
    surroundings = tuple(s.to_object(i, name) for i, (name, s) in enumerate(others, len(chosen)))
    return Located(objects, tuple(detection for *_, detection in chosen), surroundings)


def detection_of(segment: Segment, query: str, score: float, observation: Observation) -> Detection:
    """Where a segment is in the main view."""
    mask = segment.masks.get(observation.main)
    if mask is None or not mask.any():
        return Detection(query, (0.0, 0.0, 0.0, 0.0), score, observation.main)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = (float(columns[0]), float(rows[0]), float(columns[-1]), float(rows[-1]))
    return Detection(query, box, score, observation.main, mask)
