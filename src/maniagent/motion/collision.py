"""What hits what: the arm, the table, boxes around the objects, and the object in the gripper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets import JOINTS
from ..errors import MotionRejected
from ..geometry import FloatArray, make_transform, rotation_z
from ..types import OrientedBox
from .kinematics import FINGERS, ArmModel

MAX_OBSTACLES = 32
TABLE_SLACK = 0.003
"""m that shapes may sink into the table: perception is no better."""
OBSTACLE_SLACK = 0.003
"""m taken off every face of an obstacle's box, likewise."""
HELD_BOTTOM_SLACK = 0.008
"""m taken off the underside of a carried box, which starts and ends its way on a support."""

_UNUSED_OBSTACLES = (0.0, 0.0, 100.0)
_EMPTY_HAND = (0.0, 0.0, 200.0)
"""m: where boxes wait that are not in use, clear of each other."""

HAND = frozenset({"gripper_link", "left_finger_link", "right_finger_link", "held"})
"""The bodies that may touch an object where a key point allows it."""

_WORDS = {
    "world": "the table",
    "base_link": "the base",
    "shoulder_link": "the shoulder",
    "upper_arm_link": "the upper arm",
    "upper_forearm_link": "the forearm",
    "lower_forearm_link": "the forearm",
    "wrist_link": "the wrist",
    "gripper_link": "the gripper",
    "left_finger_link": "the left finger",
    "right_finger_link": "the right finger",
    "held": "the carried object",
}


@dataclass(frozen=True)
class Contact:
    """Two bodies that would overlap."""

    part: str
    """Body of the arm, or "held"."""
    other: str
    """The other body of the arm, "world" for the table, or "object"."""
    obstacle: int | None = None
    """Index of the object, where one is involved."""

    def __str__(self) -> str:
        """In words: who would hit what."""
        other = f"object {self.obstacle}" if self.obstacle is not None else _WORDS[self.other]
        return f"{_WORDS[self.part]} would hit {other}"


@dataclass(frozen=True)
class PlacedBox:
    """A box anywhere in space."""

    T_base_box: FloatArray
    """(4, 4) pose of its centre."""
    half_extent: FloatArray
    """(3,) m, half the lengths along its own axes."""

    @classmethod
    def of(cls, box: OrientedBox) -> PlacedBox:
        """The same box as an upright one."""
        return cls(make_transform(rotation_z(box.yaw), box.centre), np.asarray(box.extent, float) / 2)


@dataclass(frozen=True)
class HeldBox:
    """A box that moves with the gripper."""

    T_tcp_box: FloatArray
    """(4, 4) pose of its centre in the TCP frame."""
    half_extent: FloatArray
    """(3,) m; its own z axis pointed up when it was grasped."""


class CollisionModel:
    """The planning scene on MuJoCo's collision detection. Holds scratch memory: one instance serves one thread."""

    def __init__(self, model: ArmModel) -> None:
        self._model = mj_model = _planning_spec(model).compile()
        # Boxes change their size at run time, which the tree of a body's shapes (midphase) would not notice.
        mj_model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        self._data = mujoco.MjData(mj_model)
        self._arm_model = model
        self._arm = [mj_model.joint(name).qposadr[0] for name in JOINTS]
        self._fingers = [mj_model.joint(name).qposadr[0] for name in FINGERS]
        self._held_qpos = slice(start := int(mj_model.joint("held").qposadr[0]), start + 7)
        self._held_geom = mj_model.geom("held").id
        self._slots = [mj_model.geom(f"obstacle{slot}").id for slot in range(MAX_OBSTACLES)]
        self._tcp = mj_model.site("tcp").id
        self._body_names = [mj_model.body(body).name for body in mj_model.geom_bodyid]
        self._index_of_geom: dict[int, int] = {}
        self._held: HeldBox | None = None

    def set_scene(self, obstacles: Mapping[int, PlacedBox], held: HeldBox | None = None) -> None:
        """Put the obstacles where they are and a box (or nothing) into the gripper.

        Raises MotionRejected for more than MAX_OBSTACLES obstacles.
        """
        if len(obstacles) > MAX_OBSTACLES:
            raise MotionRejected(f"{len(obstacles)} objects are more than the {MAX_OBSTACLES} that planning can avoid.")
        self._index_of_geom = dict(zip(self._slots, obstacles, strict=False))
        self._data.mocap_pos[:] = _UNUSED_OBSTACLES
        for slot, (geom, box) in enumerate(zip(self._slots, obstacles.values(), strict=False)):
            self._resize(geom, box.half_extent - OBSTACLE_SLACK)
            self._data.mocap_pos[slot] = box.T_base_box[:3, 3]
            mujoco.mju_mat2Quat(self._data.mocap_quat[slot], box.T_base_box[:3, :3].ravel())
        self._held = None
        self._data.qpos[self._held_qpos][:3] = _EMPTY_HAND
        if held is not None:
            raised = make_transform(np.eye(3), [0.0, 0.0, HELD_BOTTOM_SLACK / 2])
            slack = np.array([OBSTACLE_SLACK, OBSTACLE_SLACK, HELD_BOTTOM_SLACK / 2])
            self._held = HeldBox(held.T_tcp_box @ raised, held.half_extent - slack)
            self._resize(self._held_geom, self._held.half_extent)

    def contacts(self, joint_positions: FloatArray, opening: float) -> list[Contact]:
        """Everything that would overlap at these joint positions ((6,) rad) and finger opening (m)."""
        model, data = self._model, self._data
        data.qpos[self._arm] = joint_positions
        data.qpos[self._fingers] = self._arm_model.finger_position(opening)
        mujoco.mj_kinematics(model, data)
        if self._held is not None:
            R_base_tcp = data.site_xmat[self._tcp].reshape(3, 3)
            pose = data.qpos[self._held_qpos]
            pose[:3] = data.site_xpos[self._tcp] + R_base_tcp @ self._held.T_tcp_box[:3, 3]
            mujoco.mju_mat2Quat(pose[3:], (R_base_tcp @ self._held.T_tcp_box[:3, :3]).ravel())
            mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if not data.ncon:  # reading MuJoCo's list of contacts costs ten times what finding them does
            return []
        pairs = sorted({(int(a), int(b)) for a, b in data.contact.geom})
        return list(dict.fromkeys(self._contact(*pair) for pair in pairs))

    @property
    def tcp(self) -> FloatArray:
        """(3,) m: where the TCP is at the posture that `contacts` was last asked about."""
        return self._data.site_xpos[self._tcp]

    def _contact(self, geom1: int, geom2: int) -> Contact:
        for geom, other in ((geom1, geom2), (geom2, geom1)):
            if other in self._index_of_geom:
                return Contact(self._body_names[geom], "object", self._index_of_geom[other])
            if self._body_names[other] == "world":
                return Contact(self._body_names[geom], "world")
        first, second = self._body_names[geom1], self._body_names[geom2]
        return Contact(second, first) if second == "held" else Contact(first, second)

    def _resize(self, geom: int, half_extent: FloatArray) -> None:
        half_extent = np.maximum(half_extent, 1e-3)
        self._model.geom_size[geom] = half_extent
        self._model.geom_rbound[geom] = np.linalg.norm(half_extent)
        self._model.geom_aabb[geom, 3:] = half_extent


def _planning_spec(model: ArmModel) -> mujoco.MjSpec:
    """The arm, the table's plane, a pool of movable boxes, and a free box to be carried."""
    spec = mujoco.MjSpec.from_file(str(model.xml))
    box, size = mujoco.mjtGeom.mjGEOM_BOX, [0.01, 0.01, 0.01]
    spec.worldbody.add_geom(
        name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], pos=[0.0, 0.0, -TABLE_SLACK]
    )
    for slot in range(MAX_OBSTACLES):
        obstacle = spec.worldbody.add_body(name=f"obstacle{slot}", mocap=True)
        obstacle.add_geom(name=f"obstacle{slot}", type=box, size=size)
    held = spec.worldbody.add_body(name="held")
    held.add_freejoint(name="held")
    held.add_geom(name="held", type=box, size=size)
    for part in ("wrist_link", "gripper_link", "left_finger_link", "right_finger_link"):
        spec.add_exclude(bodyname1="held", bodyname2=part)
    for key in list(spec.keys):  # a keyframe of the arm alone doesn't fit a model with a free box
        spec.delete(key)
    return spec
