"""Inverse kinematics: every posture that reaches a TCP pose within the limits, nearest first.

The closed form is exact for the nominal arm. The joint-space Newton steps of mink then close whatever a calibrated
MJCF (axes a little off, links a little longer) leaves over, from the same seeds and from random restarts; on the
nominal arm they have nothing to do.
"""

from __future__ import annotations

import mink
import numpy as np

from ..assets import JOINTS
from ..errors import MotionRejected
from ..geometry import FloatArray, rotation_angle
from .closed_form import ArmDimensions, postures
from .kinematics import ArmModel

POSITION_TOLERANCE = 2e-4
"""m; a fifth of what is promised."""
ROTATION_TOLERANCE = 1.7e-3
"""rad; a fifth of the half degree that is promised."""

_AT_LIMIT = 1e-5
"""rad."""
_NEARLY = 0.1
"""rad: a closed-form posture no further beyond a limit may turn into one within it."""
_MAX_STEPS = 15
_RESTARTS = 8


class IKSolver:
    """Solves TCP poses for one arm model. Holds scratch memory: one instance serves one thread."""

    def __init__(self, model: ArmModel, joint_margin: float = 0.0) -> None:
        """Solutions keep `joint_margin` (rad) away from the joint limits."""
        self.model = model
        self.joint_margin = joint_margin
        self._dimensions = ArmDimensions.of(model)
        self._configuration = mink.Configuration(model.mj_model)
        self._task = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=0.3)
        self._limits = [mink.ConfigurationLimit(model.mj_model, min_distance_from_limits=joint_margin)]
        self._qpos = self._configuration.data.qpos.copy()
        self._arm = [model.mj_model.jnt_qposadr[model.mj_model.joint(name).id] for name in JOINTS]
        for finger in ("left_finger", "right_finger"):
            joint = model.mj_model.joint(finger)
            self._qpos[joint.qposadr[0]] = joint.range.mean()

    def solve(self, T_base_tcp: FloatArray, near: FloatArray, *, jaw_symmetry: bool = False) -> FloatArray:
        """The (6,) joint positions closest to `near` that put the TCP at a pose, within the joint limits.

        With `jaw_symmetry` the pose turned by half a turn about the approach axis is as good, because the jaws are
        alike. Raises MotionRejected, with the reason in one sentence, where no posture reaches the pose.
        """
        found = self.solutions(T_base_tcp, near)
        if jaw_symmetry:
            found += self.solutions(half_turned(T_base_tcp), near)
        if not found:
            raise MotionRejected(self._why_not(T_base_tcp))
        return min(found, key=lambda q: _distance(q, near))

    def solutions(self, T_base_tcp: FloatArray, near: FloatArray) -> list[FloatArray]:
        """All postures found within the limits, the closest to `near` ((6,) rad) first; may be empty."""
        if self._dimensions.missing_reach(T_base_tcp) > 0.02 or not np.isfinite(T_base_tcp).all():
            return []
        seeds = list(postures(self._dimensions, T_base_tcp, roll_if_free=near[3]))
        exact = [q for q in map(self._snapped, seeds) if self._allowed(q) and self._reaches(q, T_base_tcp)]
        found = exact or self._refined(T_base_tcp, seeds, near)
        return sorted(found, key=lambda q: _distance(q, near))

    def _snapped(self, q: FloatArray) -> FloatArray:
        """The same posture, moved to the limit where it lies beyond by no more than rounding errors."""
        inside = np.clip(q, self.model.lower + self.joint_margin, self.model.upper - self.joint_margin)
        return np.where(np.abs(inside - q) < _AT_LIMIT, inside, q)

    def _allowed(self, q: FloatArray) -> bool:
        return self.model.within_limits(q, self.joint_margin)

    def _reaches(self, q: FloatArray, T_base_tcp: FloatArray) -> bool:
        T = self.model.forward(q)
        return bool(
            np.linalg.norm(T[:3, 3] - T_base_tcp[:3, 3]) < POSITION_TOLERANCE
            and rotation_angle(T[:3, :3].T @ T_base_tcp[:3, :3]) < ROTATION_TOLERANCE
        )

    def _refined(self, T_base_tcp: FloatArray, seeds: list[FloatArray], near: FloatArray) -> list[FloatArray]:
        """What mink makes of the closed form's seeds; of random restarts only when none of them converges."""
        if any(self._reaches(q, T_base_tcp) for q in seeds):
            return []  # the closed form is exact for this model: its postures are all there are
        low, high = self.model.lower + self.joint_margin, self.model.upper - self.joint_margin
        plausible = [np.clip(q, low, high) for q in seeds if np.abs(np.clip(q, low, high) - q).max() < _NEARLY]
        found = [q for seed in plausible if (q := self._converge(T_base_tcp, seed)) is not None]
        rng = np.random.default_rng(0)
        for _ in range(0 if found else _RESTARTS):
            q = self._converge(T_base_tcp, np.clip(near + rng.normal(0.0, 0.7, 6), low, high))
            if q is not None:
                return [q]
        return found

    def _converge(self, T_base_tcp: FloatArray, seed: FloatArray) -> FloatArray | None:
        """Newton steps from a seed; None where they don't arrive within the limits."""
        self._task.set_target(mink.SE3.from_matrix(T_base_tcp))
        self._qpos[self._arm] = seed
        self._configuration.update(self._qpos)
        for _ in range(_MAX_STEPS):
            q = self._configuration.q[self._arm]
            if self._reaches(q, T_base_tcp):
                return q if self._allowed(q) else None
            try:
                velocity = mink.solve_ik(self._configuration, [self._task], 1.0, "daqp", 1e-6, limits=self._limits)
            except mink.NoSolutionFound:
                return None
            self._configuration.integrate_inplace(velocity, 1.0)
        return None

    def _why_not(self, T_base_tcp: FloatArray) -> str:
        """One sentence on why no posture reaches a pose."""
        if not np.isfinite(T_base_tcp).all():
            return "The target pose holds a number that is not finite."
        x, y, z = T_base_tcp[:3, 3]
        where = f"({x:.3f}, {y:.3f}, {z:.3f}) m"
        missing = self._dimensions.missing_reach(T_base_tcp)
        if missing > 0:
            return f"{where} is {100 * missing:.1f} cm beyond the arm's reach in that orientation."
        if missing < 0:
            return f"{where} is {-100 * missing:.1f} cm too close to the arm's shoulder in that orientation."
        excess = [
            np.maximum(self.model.lower + self.joint_margin - q, q - self.model.upper + self.joint_margin)
            for q in postures(self._dimensions, T_base_tcp)
        ]
        worst = min(excess, key=lambda e: float(e.max()))
        joint = int(worst.argmax())
        return f"At {where} the {JOINTS[joint]} joint would be {np.degrees(worst[joint]):.0f} degrees past its limit."


def half_turned(T_base_tcp: FloatArray) -> FloatArray:
    """The same grasp with the two fingers swapped: the pose turned by pi about the approach axis."""
    T = T_base_tcp.copy()
    T[:3, 1:3] *= -1
    return T


def _distance(q: FloatArray, near: FloatArray) -> float:
    """Travel between postures: the slowest joint decides, the others break ties (rad)."""
    step = np.abs(q - near)
    return float(step.max() + 0.1 * step.sum())
