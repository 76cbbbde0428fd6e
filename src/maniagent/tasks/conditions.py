"""What it means that a task is achieved, on the true state of the twin.

Every condition asks for a state that lasts: the object is released, at rest, and where it should be.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ..envs.scene import Name
from ..envs.tabletop import TrueObject
from ..geometry import FloatArray, wrap_angle

Truth = Mapping[str, TrueObject]
VIEWER_RIGHT = np.array([0.0, 1.0])
VIEWER_AWAY = np.array([-1.0, 0.0])
"""In base xy: the viewer (and the diner of the table-laying task) sits where the main camera stands."""
REST_SPEED = 0.01
"""m/s"""
REST_ANGULAR_SPEED = 0.3
"""rad/s"""


def rests(thing: TrueObject) -> bool:
    """Whether an object is released and lies still."""
    return not thing.touched and thing.speed < REST_SPEED and thing.angular_speed < REST_ANGULAR_SPEED


class Condition(BaseModel, ABC):
    """One thing that must be true of the table."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    object: Name

    def holds(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        """Whether it is true now, of an object that is released and at rest; `points` are the episode's own."""
        return rests(truth[self.object]) and self._placed(truth, points)

    @abstractmethod
    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool: ...

    def names(self) -> tuple[str, ...]:
        """The objects it speaks of."""
        return (self.object,)


class On(Condition):
    """The object rests on (or in) the target: its middle over the target's footprint, at the right height."""

    kind: Literal["on", "in"]
    target: Name
    inset: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.15
    """Share of the target's half-size, at its border, that doesn't count."""

    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        thing, target = truth[self.object], truth[self.target]
        relative = np.linalg.inv(target.T_base_object) @ thing.T_base_object[:, 3]
        half = np.asarray(target.model.extent[:2]) / 2 * (1.0 - self.inset)
        if (np.abs(relative[:2]) > half).any():
            return False
        above = thing.T_base_object[2, 3] - (target.T_base_object[2, 3] - target.model.rest_z + target.model.surface_z)
        # Its middle is above the surface, but no higher than if it stood on end: it isn't held up by anything else.
        return bool(0.0 < above < max(thing.model.extent) / 2 + 0.015)

    def names(self) -> tuple[str, ...]:
        return (self.object, self.target)


class At(Condition):
    """The object's middle is within `tolerance` of a point of the table."""

    kind: Literal["at"]
    point: Name | tuple[float, float]
    """(x, y) in metres, base frame, or the name of one of the task's drawn points."""
    tolerance: Annotated[float, Field(gt=0.0, le=0.2)] = 0.03

    def _placed(self, truth: Truth, points: Mapping[str, FloatArray]) -> bool:
        goal = points[self.point] if isinstance(self.point, str) else np.asarray(self.point)
        return float(np.linalg.norm(truth[self.object].T_base_object[:2, 3] - goal)) <= self.tolerance


class Beside(Condition):
    """The object lies on the table beside the target, on the viewer's left or right, pointing at or from the viewer."""

    kind: Literal["beside"]
    target: Name
    side: Literal["left", "right"]
    reach: float = 0.08
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
            border <= across <= border + self.reach
            and abs(float(offset @ VIEWER_AWAY)) <= border
            and abs(np.degrees(angle)) <= self.aligned
        )

    def names(self) -> tuple[str, ...]:
        return (self.object, self.target)


AnyCondition = Annotated[On | At | Beside, Field(discriminator="kind")]
