"""The gate before every motion: nothing is executed that has not passed it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..assets import JOINTS
from ..errors import MotionRejected, UsageError
from ..geometry import FloatArray
from ..types import KeyPoint
from .kinematics import ArmModel
from .limits import MotionLimits
from .plan import MotionPlan
from .trajectory import JointTrajectory

_TOLERANCE = 1.01
"""Speeds are measured on samples; a hundredth covers the differences' error."""
_JOINT = 1e-3
"""rad: two postures closer than this are the same."""

_SEAL = object()


@dataclass(frozen=True)
class ApprovedPlan:
    """A plan that has passed a gate, the only thing an executor takes. Only MotionGate.approve makes one."""

    plan: MotionPlan
    seal: object = field(repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.seal is not _SEAL:
            raise UsageError("An ApprovedPlan can't be made by hand: let MotionGate.approve check the plan.")


class MotionGate:
    """Checks key points before planning and trajectories before execution; every refusal is one sentence."""

    def __init__(self, model: ArmModel, limits: MotionLimits) -> None:
        self._model = model
        self._limits = limits

    def check_keypoints(self, keypoints: Sequence[KeyPoint]) -> None:
        """Raises MotionRejected for a pose that is no pose or not in the workspace, or an impossible opening."""
        for number, point in enumerate(keypoints, start=1):
            if reason := self._bad_keypoint(point):
                raise MotionRejected(f"Key point {number} ({point.description!r}): {reason}.")

    def approve(self, plan: MotionPlan) -> ApprovedPlan:
        """The plan, sealed for execution.

        Raises MotionRejected where a trajectory holds a number that is not finite, jumps, leaves the joint limits or
        the workspace, or is too fast for the joints or the TCP.
        """
        end: FloatArray | None = None
        for move in plan.moves:
            reason = self._bad_trajectory(move.trajectory) or self._bad_opening(move.opening)
            if not reason and end is not None and np.abs(move.trajectory.start - end).max() > _JOINT:
                reason = "it does not start where the move before ends"
            if reason:
                raise MotionRejected(f"The move {move.description!r} is refused: {reason}.")
            end = move.trajectory.goal
        return ApprovedPlan(plan, _SEAL)

    def _bad_keypoint(self, point: KeyPoint) -> str:
        T = point.T_base_tcp
        if not np.isfinite(T).all():
            return "its pose holds a number that is not finite"
        R = T[:3, :3]
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0:
            return "its orientation is not a rotation"
        return self._limits.outside(T[:3, 3]) or self._bad_opening(point.opening)

    def _bad_opening(self, opening: float | None) -> str:
        if opening is None or 0.0 <= opening <= self._model.max_opening + 1e-6:
            return ""
        return f"the fingers can't be {opening:.3f} m apart (0 to {self._model.max_opening:.3f} m)"

    def _bad_trajectory(self, trajectory: JointTrajectory) -> str:
        times, q, dq = trajectory.times, trajectory.positions, trajectory.velocities
        if not (np.isfinite(times).all() and np.isfinite(q).all() and np.isfinite(dq).all()):
            return "it holds a number that is not finite"
        dt = np.diff(times)
        if np.any(dt <= 0):
            return "its times do not increase"
        return self._bad_joints(q) or self._bad_speed(q, dq, dt) or self._bad_tcp(q, dt)

    def _bad_joints(self, q: FloatArray) -> str:
        """Joint limits with their margin; a start beyond it may only come back."""
        margin = self._limits.joint_margin - 1e-6
        low = np.minimum(self._model.lower + margin, q[0])
        high = np.maximum(self._model.upper - margin, q[0])
        beyond = np.maximum(low - q, q - high).max(axis=0)
        joint = int(beyond.argmax())
        if beyond[joint] > 0:
            return f"the {JOINTS[joint]} joint would go {np.degrees(beyond[joint]):.1f} degrees past its limit"
        return ""

    def _bad_speed(self, q: FloatArray, dq: FloatArray, dt: FloatArray) -> str:
        """Joint speeds, as stated and as the positions imply them."""
        implied = np.abs(np.diff(q, axis=0)) / dt[:, None]
        fastest = np.vstack([np.abs(dq), implied]).max(axis=0)
        allowed = self._limits.joint_speed_share * self._model.velocity_limit
        joint = int((fastest / allowed).argmax())
        if fastest[joint] > _TOLERANCE * allowed[joint]:
            return f"the {JOINTS[joint]} joint would turn at {fastest[joint]:.2f} rad/s ({allowed[joint]:.2f} allowed)"
        return ""

    def _bad_tcp(self, q: FloatArray, dt: FloatArray) -> str:
        """TCP speed, and the workspace: once inside, the TCP stays inside, and that is where it ends."""
        tcp = np.array([self._model.forward(qi)[:3, 3] for qi in q])
        speed = float((np.linalg.norm(np.diff(tcp, axis=0), axis=1) / dt).max(initial=0.0))
        if speed > _TOLERANCE * self._limits.tcp_speed:
            return f"the TCP would move at {speed:.2f} m/s ({self._limits.tcp_speed:.2f} allowed)"
        inside = self._limits.contains(tcp)
        entered = int(inside.argmax()) if inside.any() else len(tcp) - 1
        outside = np.flatnonzero(~inside[entered:])
        return self._limits.outside(tcp[entered + outside[0]]) if outside.size else ""
