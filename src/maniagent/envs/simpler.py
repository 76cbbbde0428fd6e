"""SimplerEnv's four WidowX tasks, as ManiSkill3 ships them (extra `simpler`).

What agents get is what the benchmark's camera and encoders give: RGB, depth, calibration, joint positions. The
segmentation that ManiSkill needs to paste the photographed background never leaves this module. What is true (the
benchmark's own `evaluate`) is behind `SimplerEnv.info`: for the verdict alone.

Conventions: the action is [dx, dy, dz, rx, ry, rz, gripper] in the robot's base frame, metres and radians, added to
the last commanded pose; R_new = Rx(rx) Ry(ry) Rz(rz) R_commanded; gripper +1 open, -1 closed. 5 Hz.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import SetupError, UsageError
from ..geometry import FloatArray, invert_transform, make_transform
from ..types import CameraFrame, Observation, RobotState

CAMERA = "3rd_view_camera"
LAYOUTS = 24
PERIOD = 0.2
"""s, one step."""
FINGER_OFFSET = 0.010
"""m: the benchmark's finger pads are 2 (q - FINGER_OFFSET) apart at finger joint position q."""


@dataclass(frozen=True)
class SimplerTask:
    """One of the benchmark's tasks."""

    name: str
    env_id: str
    steps: int
    """Registered step budget."""


TASKS: Mapping[str, SimplerTask] = {
    task.name: task
    for task in (
        SimplerTask("simpler-stack", "StackGreenCubeOnYellowCubeBakedTexInScene-v1", 60),
        SimplerTask("simpler-carrot", "PutCarrotOnPlateInScene-v1", 60),
        SimplerTask("simpler-spoon", "PutSpoonOnTableClothInScene-v1", 60),
        SimplerTask("simpler-eggplant", "PutEggplantInBasketScene-v1", 120),
    )
}


def import_mani_skill() -> tuple[ModuleType, ModuleType]:
    """ManiSkill's environments and torch; SetupError names the extra where they are not installed."""
    os.environ.setdefault("MS_SKIP_ASSET_DOWNLOAD_PROMPT", "1")
    try:
        import mani_skill.envs.tasks.digital_twins.bridge_dataset_eval as bridge
        import torch
    except ImportError as error:
        raise SetupError(
            f"SimplerEnv needs ManiSkill3 ({error}). Install it with: pip install 'maniagent[simpler]'"
        ) from error
    return bridge, torch


class SimplerEnv:
    """One task of the benchmark on the CPU, one episode after another."""

    def __init__(self, task: SimplerTask) -> None:
        bridge, self._torch = import_mani_skill()
        import gymnasium as gym

        base = bridge.base_env.BaseBridgeEnv
        # The tasks declare RGB only; their cameras give depth just as well. Without a reset of these two lists, which
        # ManiSkill keeps on the class, a second environment in one process pastes the first one's background.
        base.SUPPORTED_OBS_MODES = ["rgb+depth+segmentation", "rgb+segmentation"]
        for kind in base.__mro__:
            for name in ("_objects_to_remove_from_greenscreen", "_rgb_overlay_images"):
                held = vars(kind).get(name)
                if held is not None:
                    held.clear()
        self.task = task
        made = gym.make(task.env_id, obs_mode="rgb+depth+segmentation", sim_backend="cpu", render_backend="cpu")
        self._env: Any = made.unwrapped
        self.steps = 0
        self.info: dict[str, bool] = {}
        """The benchmark's own verdict after the last step; true state."""

    @property
    def instruction(self) -> str:
        """The benchmark's instruction."""
        return str(self._env.get_language_instruction()[0])

    def reset(self, layout: int) -> None:
        """Start an episode with one of the benchmark's layouts."""
        if not 0 <= layout < LAYOUTS:
            raise UsageError(f"SimplerEnv has layouts 0 to {LAYOUTS - 1}, not {layout}.")
        self._see(False)
        # Without "reconfigure" the eggplant's start depends on the episode before.
        self._env.reset(options={"episode_id": self._torch.tensor([layout]), "reconfigure": True})
        self.steps = 0
        self.info = {}

    def step(self, action: NDArray[np.floating]) -> None:
        """One control step of 0.2 s with a (7,) action, without taking a picture."""
        _, _, _, _, info = self._env.step(np.asarray(action, np.float32)[None])
        self.steps += 1
        self.info = {key: bool(value) for key, value in info.items() if np.ndim(value) <= 1 and key != "elapsed_steps"}

    def joints(self) -> NDArray[np.float64]:
        """(8,) what the encoders say: six joints (rad), two fingers (m)."""
        return np.asarray(self._env.agent.robot.get_qpos()[0].cpu(), float)

    def observe(self, state: RobotState) -> Observation:
        """A picture with depth and calibration, beside the robot's state."""
        self._see(True)
        seen = self._env.get_obs()
        self._see(False)
        images, parameters = seen["sensor_data"][CAMERA], seen["sensor_param"][CAMERA]
        depth = np.asarray(images["depth"][0, ..., 0].cpu(), np.float32) / 1000.0
        extrinsic = np.eye(4)
        extrinsic[:3] = np.asarray(parameters["extrinsic_cv"][0].cpu())[:3]
        frame = CameraFrame(
            CAMERA,
            np.asarray(images["rgb"][0].cpu()),
            np.where(depth > 0, depth, np.float32(np.nan)),
            np.asarray(parameters["intrinsic_cv"][0].cpu()),
            invert_transform(extrinsic @ self._T_world_base()),
        )
        return Observation({CAMERA: frame}, CAMERA, state)

    def close(self) -> None:
        """Free the renderer."""
        self._env.close()

    def _see(self, pictures: bool) -> None:
        # Rendering costs five times what a step does: it is on only while a picture is taken.
        self._env._obs_mode = "rgb+depth+segmentation" if pictures else "none"  # there is no setter

    def _T_world_base(self) -> FloatArray:
        pose = self._env.agent.robot.pose
        quaternion = np.asarray(pose.q[0].cpu())  # (w, x, y, z)
        return make_transform(Rotation.from_quat(quaternion, scalar_first=True).as_matrix(), pose.p[0].cpu())
