"""The joint-level driver that motion needs from a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..geometry import FloatArray


@dataclass(frozen=True)
class ArmState:
    """What the servos report at one instant."""

    joint_positions: FloatArray
    """(6,) rad: waist, shoulder, elbow, forearm_roll, wrist_angle, wrist_rotate."""
    joint_velocities: FloatArray
    """(6,) rad/s."""
    joint_efforts: FloatArray
    """(6,) N m, as the servos measure or estimate them."""
    gripper_opening: float
    """Distance between the finger pads, m."""
    gripper_effort: float
    """Force with which the gripper closes (positive) or opens (negative), N."""
    time: float
    """Seconds since the robot was started."""

    def is_finite(self) -> bool:
        """Whether every reading that motion relies on is a number; a lost servo reads NaN."""
        scalars = (self.gripper_opening, self.time)
        return bool(
            np.isfinite(self.joint_positions).all()
            and np.isfinite(self.joint_velocities).all()
            and np.isfinite(scalars).all()
        )


class Arm(Protocol):
    """Six position servos and a parallel gripper.

    `command` is called once per control period with the set-point of that period; it returns when the period is
    over: a simulated arm advances its physics, a real one sleeps. Set-points given through the motion stack have
    passed its gate; a driver may clip to its own hardware limits but never invents a set-point.
    """

    @property
    def period(self) -> float:
        """The control period, s."""

    def read(self) -> ArmState:
        """The latest reading of the servos; NaN where a servo doesn't answer."""

    def command(self, joint_positions: FloatArray, gripper_opening: float) -> None:
        """Track `joint_positions` ((6,) rad) and `gripper_opening` (m between the pads) for one control period."""

    def stop(self) -> None:
        """Hold the joints where they are now; the gripper keeps its last command. Safe to call at any time."""
