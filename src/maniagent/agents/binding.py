"""From an action sequence over object indices to key points among today's objects.

This is what makes a cached sequence fit a new scene (ManiAgent, section III-D): every number that depends on where
things are comes from the ObjectInfo at hand, none from the sequence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import FormatFailure, GraspFailure
from ..geometry import FloatArray, make_transform, rotation_z, top_down_rotation, wrap_angle
from ..perception.viewpoint import Viewpoint
from ..types import (
    ActionSequence,
    ActionStep,
    GraspPose,
    Gripper,
    HereAnchor,
    KeyPoint,
    ObjectAnchor,
    ObjectInfo,
    Orientation,
    OrientedBox,
    Part,
    PointAnchor,
)

SIDE_GAP = 0.03
"""m between two objects laid side by side: room for the fingers."""


def bind(sequence: ActionSequence, objects: Sequence[ObjectInfo], viewpoint: Viewpoint) -> tuple[KeyPoint, ...]:
    """The sequence's key points for these objects (their best grasps), in order.

    Raises
    ------
    FormatFailure
        Where a step names an object that isn't there, carries what isn't held, keeps an orientation that none was
        given before, or ends up with a number that isn't finite.
    GraspFailure
        Where a step needs a grasp of an object that has none.

    """
    binder = _Binder({info.index: info for info in objects}, viewpoint)
    return tuple(binder.bind_step(number, step) for number, step in enumerate(sequence.steps, 1))


class _Binder:
    """Walks through the steps and keeps what one step leaves to the next."""

    def __init__(self, objects: dict[int, ObjectInfo], viewpoint: Viewpoint) -> None:
        self._objects = objects
        self._viewpoint = viewpoint
        self._previous: FloatArray | None = None
        """T_base_tcp of the step before."""
        self._taken: tuple[int, FloatArray] | None = None
        """The object in the gripper and T_base_tcp at which it was taken."""
        self._touched: frozenset[int] = frozenset()
        self._step = ""

    def bind_step(self, number: int, step: ActionStep) -> KeyPoint:
        self._step = f"Step {number} ({step.description})"
        rotation = self._orient(step)
        position = self._target(step, rotation)
        if step.carrying is not None:
            position = self._tcp_that_brings(step.carrying, position, rotation)
        pose = make_transform(rotation, position)
        if not np.isfinite(pose).all():
            raise FormatFailure(f"{self._step}: the target is not a finite pose.")
        held = None if self._taken is None else self._taken[0]
        mentioned = self._mentioned(step)
        opening = None
        if step.gripper is Gripper.OPEN and held is None and step.orientation.index is not None:
            opening = self._grasp_of(step.orientation.index).opening
        point = KeyPoint(pose, step.gripper, step.description, opening, mentioned | self._touched, held)
        self._touched = mentioned
        self._previous = pose
        self._take_or_release(step, pose)
        return point

    def _take_or_release(self, step: ActionStep, pose: FloatArray) -> None:
        if step.gripper is Gripper.OPEN:
            self._taken = None
        elif step.gripper is Gripper.CLOSE and self._taken is None and isinstance(step.anchor, ObjectAnchor):
            self._taken = (step.anchor.index, pose)

    def _orient(self, step: ActionStep) -> FloatArray:
        wanted = step.orientation
        if wanted.index is not None:
            return self._grasp_of(wanted.index).T_base_grasp[:3, :3]
        if wanted.kind == "top-down":
            return top_down_rotation(wanted.yaw)
        if wanted.kind == "align":
            return self._align(wanted)
        if self._previous is None:
            raise FormatFailure(f"{self._step}: the first step must say how the gripper is turned.")
        rotation = self._previous[:3, :3]
        return rotation_z(wanted.yaw) @ rotation if wanted.kind == "turn" else rotation

    def _align(self, wanted: Orientation) -> FloatArray:
        """The gripper turned so that what it holds points as wanted."""
        if self._taken is None:
            raise FormatFailure(f"{self._step}: nothing is in the gripper there that could be aligned.")
        index, T_base_taken = self._taken
        right = self._viewpoint.right if wanted.frame == "viewer" else np.array([1.0, 0.0])
        zero = float(np.arctan2(right[1], right[0]))
        axis = self._object(index).yaw
        turn = wrap_angle(zero + wanted.yaw - axis, np.pi)
        if wanted.end is not None:
            pointing = axis if np.cos(axis - zero - wanted.end) >= 0.0 else axis + np.pi
            turn = wrap_angle(zero + wanted.yaw - pointing)
        return rotation_z(turn) @ T_base_taken[:3, :3]

    def _target(self, step: ActionStep, rotation: FloatArray) -> FloatArray:
        offset = np.asarray(step.offset)
        if step.offset_frame == "viewer":
            right, away, up = step.offset
            offset = np.array([*(right * self._viewpoint.right + away * self._viewpoint.away), up])
        if isinstance(step.anchor, HereAnchor):
            if self._previous is None or step.carrying is not None:
                raise FormatFailure(f"{self._step}: 'here' is where the step before leaves the gripper, nothing else.")
            return self._previous[:3, 3] + offset
        if isinstance(step.anchor, PointAnchor):
            return np.array([step.anchor.x, step.anchor.y, step.anchor.z]) + offset
        return self._anchor_point(step.anchor, step.carrying, rotation) + offset

    def _anchor_point(self, anchor: ObjectAnchor, carrying: int | None, rotation: FloatArray) -> FloatArray:
        thing = self._object(anchor.index)
        x, y, z = thing.centre
        match anchor.part:
            case Part.CENTRE:
                return np.array([x, y, z])
            case Part.GRASP:
                return self._grasp_of(anchor.index).T_base_grasp[:3, 3]
            case Part.SURFACE:
                return np.array([x, y, thing.surface_z])
            case Part.FREE:
                spot = thing.centre[:2] if thing.free_spot is None else thing.free_spot
                return np.array([*spot, thing.surface_z])
            case Part.TOP:
                return np.array([x, y, thing.top_z])
            case Part.BASE:
                return np.array([x, y, thing.bottom_z])
            case Part.LEFT | Part.RIGHT | Part.NEAR | Part.FAR:
                return self._beside(thing, anchor.part, carrying, rotation)

    def _beside(self, thing: ObjectInfo, side: Part, carrying: int | None, rotation: FloatArray) -> FloatArray:
        """A point on the table beside an object, with room for what is carried there."""
        right, away = self._viewpoint.right, self._viewpoint.away
        direction = {Part.LEFT: -right, Part.RIGHT: right, Part.NEAR: -away, Part.FAR: away}[side]
        distance = _half_size_along(thing.box, direction) + SIDE_GAP
        if carrying is not None:
            carried = self._object(carrying)
            turned = carried.yaw + self._turned_since_taken(carrying, rotation)
            distance += _half_size_along(OrientedBox(carried.centre, carried.extent, turned), direction)
        return np.array([*(thing.centre[:2] + distance * direction), thing.bottom_z])

    def _turned_since_taken(self, index: int, rotation: FloatArray) -> float:
        R = rotation @ self._pose_taken(index)[:3, :3].T
        return float(np.arctan2(R[1, 0], R[0, 0]))

    def _tcp_that_brings(self, index: int, target: FloatArray, rotation: FloatArray) -> FloatArray:
        """Where the TCP goes so that the middle of the carried object's underside arrives at `target`."""
        thing = self._object(index)
        taken = self._pose_taken(index)
        underside = np.array([thing.centre[0], thing.centre[1], thing.bottom_z])
        turn = rotation @ taken[:3, :3].T
        return target + turn @ (taken[:3, 3] - underside)

    def _pose_taken(self, index: int) -> FloatArray:
        if self._taken is None or self._taken[0] != index:
            raise FormatFailure(f"{self._step}: object {index} is not in the gripper there.")
        return self._taken[1]

    def _object(self, index: int) -> ObjectInfo:
        try:
            return self._objects[index]
        except KeyError:
            raise FormatFailure(
                f"{self._step}: there is no object {index}; the objects are {sorted(self._objects)}."
            ) from None

    def _grasp_of(self, index: int) -> GraspPose:
        thing = self._object(index)
        if thing.grasp is None:
            raise GraspFailure(f"{self._step}: no grasp is known for the {thing.name}.")
        return thing.grasp

    def _mentioned(self, step: ActionStep) -> frozenset[int]:
        anchor = step.anchor.index if isinstance(step.anchor, ObjectAnchor) else None
        return frozenset(i for i in (anchor, step.carrying, step.orientation.index) if i is not None)


def _half_size_along(box: OrientedBox, direction: FloatArray) -> float:
    """Half the box's length seen along a unit direction (2,)."""
    axes = rotation_z(box.yaw)[:2, :2]
    return float(np.abs(direction @ axes) @ box.extent[:2] / 2)
