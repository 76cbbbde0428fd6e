"""Paths in joint space: where the joints go, without saying when."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from ..errors import MotionRejected
from ..geometry import FloatArray, make_transform, rotation_angle
from .ik import IKSolver

_LINE_STEP = 0.015
"""m between the poses of a straight line that are solved exactly; the spline between them stays within 0.2 mm."""
_TURN_STEP = 0.15
"""rad, likewise."""
_JUMP = 0.6
"""rad: a joint that turns further between two poses of a line has changed to another posture."""


@dataclass(frozen=True)
class JointPath:
    """A twice differentiable curve q(s), s in [0, 1], through knots."""

    knots: FloatArray
    """(N,) increasing from 0 to 1."""
    positions: FloatArray
    """(N, 6) rad."""

    @cached_property
    def _curve(self) -> CubicSpline:
        return CubicSpline(self.knots, self.positions, bc_type="natural")

    def at(self, s: FloatArray, derivative: int = 0) -> FloatArray:
        """Joint positions (M, 6), or their first or second derivative by s, at s (M,)."""
        return self._curve(s, derivative)

    def dense(self, joint_step: float) -> FloatArray:
        """(M, 6) positions along the path, no joint moving more than about `joint_step` (rad) in between."""
        travel = np.abs(np.diff(self.positions, axis=0)).max(axis=1).sum()
        return self.at(np.linspace(0.0, 1.0, max(2, 1 + int(np.ceil(travel / joint_step)))))


def joint_line(start: FloatArray, goal: FloatArray) -> JointPath:
    """The straight line in joint space between two (6,) joint vectors."""
    return JointPath(np.array([0.0, 1.0]), np.stack([start, goal]))


def tcp_line(solver: IKSolver, start: FloatArray, T_base_goal: FloatArray) -> JointPath:
    """The path on which the TCP runs straight, turning evenly, from the posture `start` ((6,) rad) to a pose.

    Raises MotionRejected where a pose on the line can't be reached, or only by changing to another posture.
    """
    T_base_start = solver.model.forward(start)
    knots = np.linspace(0.0, 1.0, 1 + _line_steps(T_base_start, T_base_goal))
    turns = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([T_base_start[:3, :3], T_base_goal[:3, :3]])))
    rotations = turns(knots).as_matrix()
    positions = [start]
    for s, R in zip(knots[1:], rotations[1:], strict=True):
        T = make_transform(R, (1 - s) * T_base_start[:3, 3] + s * T_base_goal[:3, 3])
        q = solver.solve(T, near=positions[-1])
        if np.abs(q - positions[-1]).max() > _JUMP:
            raise MotionRejected("The arm would have to change posture half-way along the straight line.")
        positions.append(q)
    return JointPath(knots, np.stack(positions))


def _line_steps(T_base_start: FloatArray, T_base_goal: FloatArray) -> int:
    distance = float(np.linalg.norm(T_base_goal[:3, 3] - T_base_start[:3, 3]))
    angle = rotation_angle(T_base_start[:3, :3].T @ T_base_goal[:3, :3])
    return max(2, int(np.ceil(max(distance / _LINE_STEP, angle / _TURN_STEP))))
