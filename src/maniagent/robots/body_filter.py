"""Which points of a cloud lie on the arm, by its kinematics: what a rig tells perception about the robot's body."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..motion.kinematics import ArmModel
from ..types import BoolArray, RobotState

SELF_MARGIN = 0.02
"""m around the robot's own body that perception leaves out: its model isn't exact, nor is the depth at its edges."""


@dataclass(frozen=True)
class BodyFilter:
    """A `RobotFilter`. Made for agents: from here no way leads to a robot or a simulation."""

    model: ArmModel = field(repr=False, compare=False)
    margin: float = SELF_MARGIN
    """m."""
    arm: str = field(init=False)
    """Name of the arm, that of its MJCF."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.model.xml.stem)

    def __call__(self, points: NDArray[np.float32], state: RobotState) -> BoolArray:
        """Which of the points (N, 3), base frame, lie on the robot itself: (N,) bool."""
        return self.model.covers(points, state.joint_positions, state.gripper_opening, self.margin)
