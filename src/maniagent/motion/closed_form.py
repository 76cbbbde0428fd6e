"""Closed-form inverse kinematics of the arm's nominal geometry.

The last three axes meet in one point, so the pose splits in two (Pieper 1968): waist, shoulder and elbow put the
wrist centre in place, a planar two-link problem; forearm_roll, wrist_angle and wrist_rotate are the Euler angles
(x, y, x) of what is left to turn. Up to eight postures reach a pose: waist forwards or backwards, elbow up or down,
wrist either way round.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import FloatArray
from .kinematics import ArmModel


@dataclass(frozen=True)
class ArmDimensions:
    """The lengths that the closed form needs, m, and one angle, rad."""

    shoulder_height: float
    upper_arm: float
    """Shoulder axis to elbow axis."""
    upper_arm_elevation: float
    """Angle of that line above the horizontal when all joints are at zero."""
    forearm: float
    """Elbow axis to wrist centre."""
    hand: float
    """Wrist centre to TCP."""

    @classmethod
    def of(cls, model: ArmModel) -> ArmDimensions:
        """Measured on the model at zero joint angles, where the forearm and the hand point along base +x."""
        data = mujoco.MjData(model.mj_model)
        mujoco.mj_kinematics(model.mj_model, data)
        shoulder, elbow, wrist = (data.joint(name).xanchor for name in ("shoulder", "elbow", "wrist_angle"))
        upper_arm = elbow - shoulder
        return cls(
            shoulder_height=float(shoulder[2]),
            upper_arm=float(np.hypot(upper_arm[0], upper_arm[2])),
            upper_arm_elevation=float(np.arctan2(upper_arm[2], upper_arm[0])),
            forearm=float(wrist[0] - elbow[0]),
            hand=float(data.site("tcp").xpos[0] - wrist[0]),
        )

    def wrist_centre(self, T_base_tcp: FloatArray) -> FloatArray:
        """(3,) m: where the wrist centre has to be for this TCP pose."""
        return T_base_tcp[:3, 3] - self.hand * T_base_tcp[:3, 0]

    def missing_reach(self, T_base_tcp: FloatArray) -> float:
        """How much too far (positive) or too close (negative) the wrist centre would have to go, m; 0 within reach."""
        distance = float(np.linalg.norm(self.wrist_centre(T_base_tcp) - [0.0, 0.0, self.shoulder_height]))
        too_far = distance - (self.upper_arm + self.forearm)
        too_close = distance - abs(self.upper_arm - self.forearm)
        return max(too_far, 0.0) + min(too_close, 0.0)


def postures(dimensions: ArmDimensions, T_base_tcp: FloatArray, roll_if_free: float = 0.0) -> Iterator[FloatArray]:
    """All joint vectors (6,) that reach a pose, limits left aside; the nearest miss where it is out of reach.

    Where forearm and hand are in line, roll and rotation are interchangeable; `roll_if_free` (rad) then says
    which forearm roll to take. Angles are in (-pi, pi].
    """
    x, y, z = dimensions.wrist_centre(T_base_tcp)
    for waist, forward in ((np.arctan2(y, x), np.hypot(x, y)), (np.arctan2(-y, -x), -np.hypot(x, y))):
        for shoulder, elbow in _two_link(dimensions, forward, z - dimensions.shoulder_height):
            R_base_forearm = _forearm_rotation(waist, shoulder + elbow)
            for wrist in _euler_xyx(R_base_forearm.T @ T_base_tcp[:3, :3], roll_if_free):
                yield _wrapped(np.array([waist, shoulder, elbow, *wrist]))


def _two_link(dimensions: ArmDimensions, forward: float, up: float) -> Iterator[tuple[float, float]]:
    """Shoulder and elbow angles that put the wrist centre `forward` and `up` (m) from the shoulder axis."""
    a, b = dimensions.upper_arm, dimensions.forearm
    cos_bend = np.clip((forward**2 + up**2 - a**2 - b**2) / (2 * a * b), -1.0, 1.0)
    for bend in (np.arccos(cos_bend), -np.arccos(cos_bend)):
        elevation = np.arctan2(up, forward) + np.arctan2(b * np.sin(bend), a + b * np.cos(bend))
        shoulder = dimensions.upper_arm_elevation - elevation
        yield shoulder, bend - elevation - shoulder


def _forearm_rotation(waist: float, pitch: float) -> FloatArray:
    """R_base_forearm = Rz(waist) Ry(pitch), (3, 3)."""
    c, s, cp, sp = np.cos(waist), np.sin(waist), np.cos(pitch), np.sin(pitch)
    return np.array([[c * cp, -s, c * sp], [s * cp, c, s * sp], [-sp, 0.0, cp]])


def _euler_xyx(R: FloatArray, roll_if_free: float) -> Iterator[tuple[float, float, float]]:
    """Both (roll, angle, rotate) with Rx(roll) Ry(angle) Rx(rotate) = R; one when the angle is zero."""
    sin_angle = np.hypot(R[1, 0], R[2, 0])
    if sin_angle < 1e-6 and R[0, 0] > 0:  # a hand folded back on the forearm (angle pi) is beyond any wrist
        yield roll_if_free, 0.0, np.arctan2(R[2, 1], R[2, 2]) - roll_if_free
        return
    angle = np.arctan2(sin_angle, R[0, 0])
    roll = np.arctan2(R[1, 0], -R[2, 0])
    rotate = np.arctan2(R[0, 1], R[0, 2])
    yield roll, angle, rotate
    yield roll + np.pi, -angle, rotate + np.pi


def _wrapped(angles: FloatArray) -> FloatArray:
    """Angles shifted into (-pi, pi]."""
    return np.pi - np.mod(np.pi - angles, 2 * np.pi)
