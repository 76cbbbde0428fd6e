"""Kinematics of the WidowX-250s, read from its MJCF: the one source of link lengths and limits."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from ..assets import JOINTS, WX250S_XML
from ..geometry import FloatArray, make_transform
from ..types import BoolArray
from .body import ArmBody

FINGERS = ("left_finger", "right_finger")


class ArmModel:
    """Forward kinematics, limits and body of the arm alone, without anything around it.

    It owns scratch memory, so one instance serves one thread.
    """

    def __init__(self, xml: Path = WX250S_XML) -> None:
        """Read an MJCF with the joint names above, a site `tcp`, pads `left_pad`/`right_pad` and a key `home`."""
        self.xml = xml
        self.mj_model = mujoco.MjModel.from_xml_path(str(xml))
        self._data = mujoco.MjData(self.mj_model)
        model = self.mj_model
        joint_ids = np.array([model.joint(name).id for name in JOINTS])
        self._qpos = model.jnt_qposadr[joint_ids]
        self._dofs = model.jnt_dofadr[joint_ids]
        self._finger_qpos = model.jnt_qposadr[[model.joint(name).id for name in FINGERS]]
        self._tcp = model.site("tcp").id
        self.lower: FloatArray = model.jnt_range[joint_ids, 0].copy()
        """(6,) rad, lower joint limits."""
        self.upper: FloatArray = model.jnt_range[joint_ids, 1].copy()
        """(6,) rad, upper joint limits."""
        self.velocity_limit: FloatArray = np.array(model.numeric("joint_velocity_limit").data[:6])
        """(6,) rad/s, published joint speed limits."""
        self.home: FloatArray = model.key("home").qpos[self._qpos].copy()
        """(6,) rad, compact posture that doesn't hide the table."""
        pad = model.geom("left_pad")
        self._finger_offset = float(pad.size[1] - pad.pos[1])
        low, high = model.jnt_range[model.joint("left_finger").id]
        self.min_opening = 2 * float(low - self._finger_offset)
        """m, gap between the pads of the closed gripper."""
        self.max_opening = 2 * float(high - self._finger_offset)
        """m, gap between the pads of the fully open gripper."""
        self._body = ArmBody(model)

    def forward(self, joint_positions: FloatArray) -> FloatArray:
        """T_base_tcp, (4, 4), at these joint positions ((6,) rad)."""
        self._data.qpos[self._qpos] = joint_positions
        mujoco.mj_kinematics(self.mj_model, self._data)
        return make_transform(self._data.site_xmat[self._tcp].reshape(3, 3), self._data.site_xpos[self._tcp])

    def jacobian(self, joint_positions: FloatArray) -> FloatArray:
        """(6, 6) geometric Jacobian of the TCP in the base frame: linear velocity (m/s) above angular (rad/s)."""
        self._data.qpos[self._qpos] = joint_positions
        mujoco.mj_kinematics(self.mj_model, self._data)
        mujoco.mj_comPos(self.mj_model, self._data)
        jacobian = np.zeros((6, self.mj_model.nv))
        mujoco.mj_jacSite(self.mj_model, self._data, jacobian[:3], jacobian[3:], self._tcp)
        return jacobian[:, self._dofs]

    def within_limits(self, joint_positions: FloatArray, margin: float = 0.0) -> bool:
        """Whether every joint is at least `margin` (rad) inside its range."""
        q = joint_positions
        return bool(np.all(q >= self.lower + margin) and np.all(q <= self.upper - margin))

    def finger_position(self, opening: float) -> float:
        """Finger joint position (m, URDF convention) that leaves `opening` (m) between the pads."""
        return opening / 2 + self._finger_offset

    def opening(self, finger_position: float) -> float:
        """Gap between the pads (m) at a finger joint position (m); inverse of `finger_position`."""
        return 2 * (finger_position - self._finger_offset)

    def covers(self, points: FloatArray, joint_positions: FloatArray, opening: float, margin: float = 0.0) -> BoolArray:
        """Which points lie inside the robot's own body, or within `margin` (m) of it.

        `points` are (N, 3) m in the base frame; NaN points are never covered. Returns (N,) bool. Used to take the
        robot out of depth images.
        """
        self._data.qpos[self._qpos] = joint_positions
        self._data.qpos[self._finger_qpos] = self.finger_position(opening)
        mujoco.mj_kinematics(self.mj_model, self._data)
        return self._body.covers(self._data, points, margin)
