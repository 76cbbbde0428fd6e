"""What planning hands to the gate: timed moves and what the fingers do after each."""

from __future__ import annotations

from dataclasses import dataclass

from ..geometry import FloatArray
from ..types import Gripper
from .trajectory import JointTrajectory


@dataclass(frozen=True)
class PlannedMove:
    """One motion of the arm and the gripper action at its end."""

    description: str
    trajectory: JointTrajectory
    gripper: Gripper = Gripper.KEEP
    opening: float | None = None
    """m between the pads after `Gripper.OPEN`; None opens fully."""
    held: int | None = None
    """Index of the object in the gripper on the way."""
    grasps: int | None = None
    """Index of the object that has to be in the gripper after `Gripper.CLOSE`; None where nothing has to be."""
    reached: int = 0
    """How many key points have been reached once the move is done."""


@dataclass(frozen=True)
class MotionPlan:
    """Moves in order; each starts where the one before ends."""

    moves: tuple[PlannedMove, ...]
    planning_seconds: float = 0.0

    @property
    def start(self) -> FloatArray:
        """(6,) rad: where the arm has to be when the plan begins."""
        return self.moves[0].trajectory.start

    @property
    def duration(self) -> float:
        """Seconds of arm motion, the gripper's own time left aside."""
        return sum(move.trajectory.duration for move in self.moves)
