"""What perception must be told of a set-up: the robot's body, its table, its cameras, its hand."""

from __future__ import annotations

from dataclasses import dataclass, field

from .grasps import GraspTuning, GripperShape
from .views import RobotFilter, Tuning, Workspace


@dataclass(frozen=True)
class Rig:
    """One set-up. The defaults are the twin's, and a WidowX-250s's with a D435-class camera over a plain table."""

    covers_robot: RobotFilter
    """Made from kinematics; no way leads from here to a robot or a simulation."""
    workspace: Workspace = field(default_factory=Workspace)
    tuning: Tuning = field(default_factory=Tuning)
    gripper: GripperShape = field(default_factory=GripperShape)
    grasping: GraspTuning = field(default_factory=GraspTuning)
