"""Was a command carried out? Judged from a fresh look: is a thing like the one that was moved where it should be?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geometry import FloatArray, rotation_z, wrap_angle
from ...perception.identity import find_again, same_thing
from ...types import ObjectInfo, SubtaskRecord, Verdict
from .commands import Action, Command, Relation

AT_TOLERANCE = 0.025
"""m a thing may lie off the point it was to be brought to."""
SEARCH = 0.25
"""m around its old place within which a thing that shouldn't have moved (a plate) is looked for."""
ANGLE_TOLERANCE = np.radians(20)
SQUARE = 1.15
"""Length over width below which nobody can tell how a thing is turned."""
STILL = 0.02
"""m within which a thing counts as not moved."""
BESIDE_REACH = 0.12
"""m from the border of a thing that still counts as beside it."""

Judgement = tuple[Verdict, str]


def judge(command: Command, record: SubtaskRecord, now: Sequence[ObjectInfo]) -> Judgement:
    """Verdict on an attempt at `command`, with the evidence.

    `record` holds the objects as they were before it; `now` is everything seen afterwards.
    """
    if not record.objects:
        return Verdict.FAILURE, record.outcome.reason
    moved = record.objects[0]
    if command.action is Action.PICK_UP:
        return _judge_pick_up(record, moved, now)
    if command.action is Action.ROTATE:
        return _judge_rotation(command, record, moved, now)
    if command.point is not None:
        return _judge_place(record, moved, now, np.asarray(command.point))
    if command.distance is not None:
        return _judge_shift(record, moved, now, command.distance)
    return _judge_relation(command, record, moved, now)


def _failed(record: SubtaskRecord, seen: str) -> Judgement:
    reason = record.outcome.reason
    return Verdict.FAILURE, f"{seen} {reason}".strip()


def _judge_pick_up(record: SubtaskRecord, moved: ObjectInfo, now: Sequence[ObjectInfo]) -> Judgement:
    low = [thing for thing in now if thing.top_z < moved.top_z + 0.05]  # the gripper may hold it up above its old place
    if find_again(moved, low, 0.05) is not None:
        return _failed(record, f"The {moved.name} still lies where it was.")
    if not record.outcome.completed:
        return _failed(record, f"The {moved.name} was not lifted.")
    return Verdict.SUCCESS, f"The {moved.name} is in the gripper."


def _judge_rotation(command: Command, record: SubtaskRecord, moved: ObjectInfo, now: Sequence[ObjectInfo]) -> Judgement:
    seen = find_again(moved, now, 0.08)
    if seen is None:
        return _failed(record, f"The {moved.name} is not where it was turned.")
    angle = command.angle or 0.0
    if abs(wrap_angle(angle, np.pi)) <= ANGLE_TOLERANCE or moved.extent[0] < SQUARE * moved.extent[1]:
        if record.outcome.completed:
            return Verdict.SUCCESS, f"The arm turned the {moved.name}, which looks the same as before."
        return _failed(record, f"The {moved.name} was not turned.")
    off = abs(wrap_angle(seen.yaw - moved.yaw - angle, np.pi))
    if off <= ANGLE_TOLERANCE:
        return Verdict.SUCCESS, f"The {moved.name} is turned as told, to {np.degrees(off):.0f} degrees."
    return _failed(record, f"The {moved.name} is {np.degrees(off):.0f} degrees off.")


def _judge_place(
    record: SubtaskRecord, moved: ObjectInfo, now: Sequence[ObjectInfo], expected: FloatArray
) -> Judgement:
    alike = [thing for thing in now if same_thing(moved, thing)]
    if not alike:
        return _failed(record, f"The {moved.name} is out of view.")
    off = min(float(np.linalg.norm(thing.centre[:2] - expected)) for thing in alike)
    seen = f"The {moved.name} lies {off * 100:.1f} cm from ({expected[0]:.2f}, {expected[1]:.2f})."
    return (Verdict.SUCCESS, seen) if off <= AT_TOLERANCE else _failed(record, seen)


def _judge_shift(record: SubtaskRecord, moved: ObjectInfo, now: Sequence[ObjectInfo], distance: float) -> Judgement:
    seen = find_again(moved, now, distance + 0.10)
    if seen is None:
        return _failed(record, f"The {moved.name} is out of view.")
    went = float(np.linalg.norm(seen.centre[:2] - moved.centre[:2]))
    evidence = f"The {moved.name} moved by {went * 100:.1f} cm."
    return (Verdict.SUCCESS, evidence) if abs(went - distance) <= AT_TOLERANCE else _failed(record, evidence)


def _judge_relation(command: Command, record: SubtaskRecord, moved: ObjectInfo, now: Sequence[ObjectInfo]) -> Judgement:
    # The target is looked for near its old place; where it is hidden now (a block under a block), its old place counts.
    target = find_again(record.objects[1], now, SEARCH) or record.objects[1]
    # What lies in a basket hides its bottom, so that its rim seems to be all of it.
    target = replace(target, surface_z=min(target.surface_z, record.objects[1].surface_z))
    holds = _rests_on if command.relation in (Relation.ON, Relation.IN) else _lies_beside
    where = f"{command.relation} the {record.objects[1].name}"
    alike = [thing for thing in now if same_thing(moved, thing) and not _is(thing, target)]
    there = [holds(thing, moved, target) for thing in alike]
    if any(_is_unmoved(thing, moved) for thing, arrived in zip(alike, there, strict=True) if not arrived):
        return _failed(record, f"The {moved.name} still lies where it was.")  # another like it may be there already
    if holds is _lies_beside and not record.outcome.completed:
        return _failed(record, f"The {moved.name} was not put {where}.")  # on which side of it, the look doesn't say
    if any(there):
        return Verdict.SUCCESS, f"A look at the table shows the {moved.name} {where}."
    if holds is _rests_on and _is_hidden_below(moved, record.objects[1], now):
        return Verdict.SUCCESS, f"A look at the table shows the {moved.name} {where}, hiding it."
    return _failed(record, f"No {moved.name} is seen {where}.")


def _is(a: ObjectInfo, b: ObjectInfo) -> bool:
    return a is b or (float(np.linalg.norm(a.centre - b.centre)) < 1e-6)


def _is_unmoved(thing: ObjectInfo, moved: ObjectInfo) -> bool:
    """Whether a thing that looks like the one that was to be moved lies where that was."""
    return float(np.linalg.norm(thing.centre - moved.centre)) < STILL


def _rests_on(thing: ObjectInfo, moved: ObjectInfo, target: ObjectInfo) -> bool:
    """Its middle over the target's footprint, its top higher than the target's surface by half its own height."""
    local = (thing.centre[:2] - target.centre[:2]) @ rotation_z(target.yaw)[:2, :2]
    inside = (np.abs(local) <= target.extent[:2] / 2).all()
    return bool(inside and thing.top_z > target.surface_z + 0.5 * moved.extent[2])


def _is_hidden_below(moved: ObjectInfo, target: ObjectInfo, now: Sequence[ObjectInfo]) -> bool:
    """Whether a pile as high as both stands where the target stood: seen as one thing, both of a colour or not."""
    height = moved.extent[2]
    lowest, highest = target.top_z + 0.6 * height, target.top_z + 1.4 * height + 0.005
    return any(
        float(np.linalg.norm(thing.centre[:2] - target.centre[:2])) < max(target.extent[1] / 2, 0.01)
        and lowest < thing.top_z < highest
        for thing in now
    )


def _lies_beside(thing: ObjectInfo, moved: ObjectInfo, target: ObjectInfo) -> bool:
    """Within arm's length of the target's border; on which side, the motion saw to."""
    gap = float(np.linalg.norm(thing.centre[:2] - target.centre[:2])) - float(target.extent[:2].max()) / 2
    came_from = float(np.linalg.norm(thing.centre[:2] - moved.centre[:2]))
    return gap < BESIDE_REACH and came_from > 0.02
