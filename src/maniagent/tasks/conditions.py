"""What it means that a task is achieved, on the true state of the twin.

Every condition asks for a state that lasts: what it speaks of is released, at rest, and where it should be.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ..envs.scene import Metres, Name
from ..envs.tabletop import TrueObject
from ..geometry import FloatArray, make_transform, wrap_angle

Truth = Mapping[str, TrueObject]
VIEWER_RIGHT = np.array([0.0, 1.0])
VIEWER_AWAY = np.array([-1.0, 0.0])
"""In base xy: the viewer (and the diner of the table-laying task) sits where the main camera stands."""
REST_SPEED = 0.01
"""m/s"""
REST_ANGULAR_SPEED = 0.3
"""rad/s"""
TILT = np.radians(20.0)
"""rad by which a thing that others are put on may lean."""
LEVEL = np.radians(5.0)
"""rad by which a thing that lies flat may lean; one end on a plate's rim makes 7 degrees of a knife."""
SLACK = 0.01
"""m by which a resting thing's middle may be higher than its bounding box says."""


def rests(thing: TrueObject) -> bool:
    """Whether an object is released and lies still."""
    return not thing.touched and thing.speed < REST_SPEED and thing.angular_speed < REST_ANGULAR_SPEED


def on_table(thing: TrueObject) -> bool:
    """Whether an object's underside is down at the table: it is neither held nor put upon something."""
    half_height = np.abs(thing.T_base_object[2, :3]) @ thing.model.extent / 2
    return bool(thing.T_base_object[2, 3] - half_height < SLACK)


def level(thing: TrueObject) -> bool:
    """Whether an object's long axis is horizontal: no end of it leans on anything."""
    return bool(abs(thing.T_base_object[2, 0]) < np.sin(LEVEL))


def upright(thing: TrueObject) -> FloatArray | None:
    """T_base_object of a thing that stands as it should, else None; a cube's faces are alike, any may be on top."""
    R, position = thing.T_base_object[:3, :3], thing.T_base_object[:3, 3]
    if np.ptp(thing.model.extent) < 1e-3:
        up = int(np.argmax(np.abs(R[2])))
        R = R[:, [(up + 1) % 3, (up + 2) % 3, up]]
        R = R if R[2, 2] > 0 else R @ np.diag([1.0, -1.0, -1.0])
    return make_transform(R, position) if R[2, 2] > np.cos(TILT) else None


class Condition(BaseModel, ABC):
    """One thing that must be true of the table."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    object: Name

    def holds(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        """Whether it is true now, of objects that are released and at rest; `points` are the episode's own."""
        return all(rests(truth[name]) for name in self.names()) and self._placed(truth, points)

    @abstractmethod
    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool: ...

    def names(self) -> tuple[str, ...]:
        """The objects it speaks of."""
        return (self.object,)


class On(Condition):
    """The object rests on (or in) the target: its middle over the upright target's footprint, at the right height."""

    kind: Literal["on", "in"]
    target: Name
    inset: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.15
    """Share of the target's half-size, at its border, that doesn't count."""

    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        thing, target = truth[self.object], truth[self.target]
        T_base_target = upright(target)
        if T_base_target is None:
            return False
        T_target_thing = np.linalg.inv(T_base_target) @ thing.T_base_object
        across = np.abs(T_target_thing[:2, 3])
        # A footprint is what is within both the bounding box and the circle around it: a round plate has no corners.
        inner = 1.0 - self.inset
        if (across > target.model.extent[:2] / 2 * inner).any() or np.hypot(*across) > target.model.radius * inner:
            return False
        above = T_target_thing[2, 3] + target.model.rest_z - target.model.surface_z
        half_height = float(np.abs(T_target_thing[2, :3]) @ thing.model.extent) / 2
        return bool(0.0 < above < self._highest(target, half_height))

    def _highest(self, target: TrueObject, half_height: float) -> float:
        """How high, m, the middle of a thing of this half-height may be above the surface, held up by nothing else."""
        rim = max(0.0, float(target.model.extent[2]) - target.model.surface_z)
        # A thing on a plate may lie across its rim. In a basket it lies lower than the rim; in a hand, upon it.
        return half_height + rim + SLACK if self.kind == "on" else max(rim, half_height + 1.5 * SLACK)

    def names(self) -> tuple[str, ...]:
        return (self.object, self.target)


class At(Condition):
    """The object stands or lies on the table, its middle within `tolerance` of a point."""

    kind: Literal["at"]
    point: Name | tuple[Metres, Metres]
    """(x, y) in metres, base frame, or the name of one of the task's drawn points."""
    tolerance: Annotated[float, Field(gt=0.0, le=0.2)] = 0.03

    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        goal = points[self.point] if isinstance(self.point, str) else np.asarray(self.point)
        thing = truth[self.object]
        return on_table(thing) and float(np.linalg.norm(thing.T_base_object[:2, 3] - goal)) <= self.tolerance


class Beside(Condition):
    """The object lies on the table beside the target, on the viewer's left or right, pointing at or from the viewer."""

    kind: Literal["beside"]
    target: Name
    side: Literal["left", "right"]
    reach: Annotated[float, Field(gt=0.0, le=0.4)] = 0.08
    """m, how far from the target's border its middle may be."""
    aligned: Annotated[float, Field(ge=0.0, le=180.0)] = 30.0
    """Degrees its long axis may be off the viewing direction."""

    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        thing, target = truth[self.object], truth[self.target]
        offset = thing.T_base_object[:2, 3] - target.T_base_object[:2, 3]
        across = float(offset @ VIEWER_RIGHT) * (1.0 if self.side == "right" else -1.0)
        border = max(target.model.extent[:2]) / 2
        axis = thing.T_base_object[:2, 0]
        angle = wrap_angle(np.arctan2(axis[1], axis[0]) - np.arctan2(VIEWER_AWAY[1], VIEWER_AWAY[0]), np.pi)
        return bool(
            on_table(thing)
            and level(thing)
            and border <= across <= border + self.reach
            and abs(float(offset @ VIEWER_AWAY)) <= border
            and abs(np.degrees(angle)) <= self.aligned
        )

    def names(self) -> tuple[str, ...]:
        return (self.object, self.target)


AnyCondition = Annotated[On | At | Beside, Field(discriminator="kind")]
