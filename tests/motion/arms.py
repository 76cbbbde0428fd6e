"""Arms for the motion tests: an ideal one that can be disturbed, and one with real physics."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from maniagent.assets import JOINTS, WX250S_XML
from maniagent.geometry import FloatArray, make_transform, top_down_rotation
from maniagent.motion import ArmModel, ArmState
from maniagent.types import OrientedBox

LAG = 0.06


def top_down(x: float, y: float, z: float, yaw: float = 0.0) -> FloatArray:
    """T_base_tcp of a gripper that points straight down."""
    return make_transform(top_down_rotation(yaw), [x, y, z])


class IdealArm:
    """Follows set-points with a first-order lag; `object_width` (m) is what closing fingers meet."""

    period = 0.02

    def __init__(self, model: ArmModel, object_width: float | None = None) -> None:
        self.model = model
        self.q = model.home.copy()
        self.dq = np.zeros(6)
        self.opening = model.max_opening
        self.object_width = object_width
        self.pressing = False
        self.time = 0.0
        self.stopped = 0
        self.set_points: list[FloatArray] = []
        self.disturb: Callable[[IdealArm], None] = lambda arm: None

    def read(self) -> ArmState:
        effort = 12.0 if self.pressing else 0.0
        return ArmState(self.q.copy(), self.dq.copy(), np.zeros(6), self.opening, effort, self.time)

    def command(self, joint_positions: FloatArray, gripper_opening: float) -> None:
        self.set_points.append(np.array(joint_positions))
        self.dq = (joint_positions - self.q) * (1 - np.exp(-self.period / LAG)) / self.period
        self.q = self.q + self.dq * self.period
        floor = max(self.model.min_opening, self.object_width or 0.0)
        self.opening = max(gripper_opening, floor)
        self.pressing = gripper_opening < floor
        self.time += self.period
        self.disturb(self)

    def stop(self) -> None:
        self.dq = np.zeros(6)
        self.stopped += 1


class PhysicsArm:
    """The MJCF's servos in MuJoCo, above a table with boxes on it."""

    period = 0.02

    def __init__(self, boxes: Sequence[OrientedBox] = (), density: float = 600.0) -> None:
        spec = mujoco.MjSpec.from_file(str(WX250S_XML))
        spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
        home = np.array(spec.keys[0].qpos)
        for number, box in enumerate(boxes):
            turn = [np.cos(box.yaw / 2), 0.0, 0.0, np.sin(box.yaw / 2)]
            body = spec.worldbody.add_body(name=f"box{number}", pos=box.centre, quat=turn)
            body.add_freejoint()
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=np.asarray(box.extent) / 2, density=density)
        spec.delete(spec.keys[0])
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.data.qpos[: len(home)] = home
        self.data.ctrl[:6], self.data.ctrl[6] = home[:6], home[6]
        mujoco.mj_forward(self.model, self.data)
        self._substeps = round(self.period / self.model.opt.timestep)
        self._arm = ArmModel()

    def read(self) -> ArmState:
        d = self.data
        return ArmState(
            d.qpos[:6].copy(),
            d.qvel[:6].copy(),
            np.array([d.actuator(name).force[0] for name in JOINTS]),
            self._arm.opening(float(d.qpos[6:8].mean())),
            -float(d.actuator("gripper").force[0]) / 2,
            d.time,
        )

    def command(self, joint_positions: FloatArray, gripper_opening: float) -> None:
        self.data.ctrl[:6] = joint_positions
        self.data.ctrl[6] = self._arm.finger_position(gripper_opening)
        mujoco.mj_step(self.model, self.data, self._substeps)

    def stop(self) -> None:
        self.data.ctrl[:6] = self.data.qpos[:6]
        mujoco.mj_step(self.model, self.data, 10 * self._substeps)

    def box_position(self, number: int) -> FloatArray:
        return self.data.body(f"box{number}").xpos.copy()
