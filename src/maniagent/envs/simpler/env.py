"""One of SimplerEnv's tasks as an environment: steps and pictures for the robot, the truth for the verdict.

What agents get is what the benchmark's camera and encoders give: RGB, depth, calibration, joint positions. The
segmentation that ManiSkill needs to paste the photographed background never leaves this module. What is true (the
benchmark's own `evaluate`, object poses) is behind `SimplerEnv.info` and `SimplerEnv.history`: for the verdict alone.

Conventions: the action is [dx, dy, dz, rx, ry, rz, gripper] in the robot's base frame, metres and radians, added to
the last commanded pose; R_new = Rx(rx) Ry(ry) Rz(rz) R_commanded; gripper +1 open, -1 closed. 5 Hz.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import SetupError, UsageError
from ...geometry import FloatArray, invert_transform, make_transform
from ...types import CameraFrame, Observation, RobotState
from .assets import EXTRA, SETUP, require
from .starts import Start
from .tasks import LAYOUTS, PERIOD, SimplerTask
from .truth import TrueStep, true_step

CAMERA = "3rd_view_camera"
FINGER_OFFSET = 0.010
"""m: the benchmark's finger pads are 2 (q - FINGER_OFFSET) apart at finger joint position q."""
_SEEING, _BLIND = "rgb+depth+segmentation", "none"
_STILL, _STILL_TURNING = 1e-3, 1e-2
"""m/s and rad/s: what moves less for a second has come to rest. The benchmark's own limits, which it asks but once."""
_SETTLE_LIMIT = 150
"""Control periods after which an object that rocks on is taken as it is."""
_STEPS_PER_FRAME = 2
"""Of a film: rendering costs more than stepping."""

Film = Callable[[NDArray[np.uint8], float], None]
"""Takes (H, W, 3) uint8 pictures and the robot's time, s."""


class SimplerEnv:
    """One task of the benchmark, physics on the CPU, one episode after another."""

    def __init__(self, task: SimplerTask) -> None:
        """Raises SetupError where ManiSkill, its assets or a Vulkan renderer is missing."""
        require()
        bridge, self._torch = _import_mani_skill()
        self.task = task
        self._env = _make(bridge.base_env.BaseBridgeEnv, task.env_id, self._torch.cuda.is_available())
        self._layouts = self._env.xyz_configs, self._env.quat_configs
        self.film: Film | None = None
        """Is shown a picture at the start of an episode and after every second step, as long as it is set."""
        self.seconds: defaultdict[str, float] = defaultdict(float)
        """Wall seconds of the episode so far, by what they went into: reset, step, render, film."""
        self.info: dict[str, bool] = {}
        """The benchmark's own verdict after the last step; true state."""
        self.history: list[TrueStep] = []
        """What was true after each step of the episode; true state."""

    @property
    def steps(self) -> int:
        """Steps of the episode so far."""
        return len(self.history)

    @property
    def instruction(self) -> str:
        """The benchmark's instruction."""
        return str(self._env.get_language_instruction()[0])

    @property
    def layouts(self) -> tuple[FloatArray, FloatArray]:
        """The positions (P, 2, 3), m, and quaternions (Q, 2, 4) of object and target that the benchmark starts from."""
        positions, quaternions = (np.asarray(values.cpu(), float) for values in self._layouts)
        return positions, quaternions

    def reset(self, start: int | Start) -> None:
        """Start an episode with one of the benchmark's layouts, or with the objects somewhere else.

        In the layouts everything lies still when the episode begins, after a short time to settle. An eggplant from
        elsewhere may rock for longer: the episode begins when it lies still.
        """
        if isinstance(start, int) and not 0 <= start < LAYOUTS:
            raise UsageError(f"SimplerEnv has layouts 0 to {LAYOUTS - 1}, not {start}.")
        self.seconds.clear()
        self.info, self.history = {}, []
        with self._timed("reset"):
            self._place(start)
            layout = start if isinstance(start, int) else 0
            # Without "reconfigure" the eggplant's start depends on the episode before.
            self._env.reset(options={"episode_id": self._torch.tensor([layout]), "reconfigure": True})
        self._shoot()

    def step(self, action: NDArray[np.floating]) -> None:
        """One control step of 0.2 s with a (7,) action, without taking a picture."""
        with self._timed("step"):
            _, _, _, _, info = self._env.step(np.asarray(action, np.float32)[None])
            self.info = {key: bool(value) for key, value in info.items() if key != "elapsed_steps"}
            self.history.append(true_step(self._env, self.info["success"]))
        self._shoot()

    def joints(self) -> NDArray[np.float64]:
        """(8,) what the encoders say: six joints (rad), two fingers (m)."""
        return np.asarray(self._env.agent.robot.get_qpos()[0].cpu(), float)

    def observe(self, state: RobotState) -> Observation:
        """A picture with depth and calibration, beside the robot's state."""
        with self._timed("render"):
            seen = self._render()
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

    def picture(self) -> NDArray[np.uint8]:
        """What the camera sees now, (480, 640, 3); for people who look at episodes."""
        return np.asarray(self._render()["sensor_data"][CAMERA]["rgb"][0].cpu())

    def close(self) -> None:
        """Free the renderer."""
        self._env.close()

    def _place(self, start: int | Start) -> None:
        """Have the next reset start there."""
        vars(self._env).pop("_settle", None)
        if isinstance(start, int):
            self._env.xyz_configs, self._env.quat_configs = self._layouts
        else:
            self._env.xyz_configs, self._env.quat_configs = (
                self._torch.as_tensor(np.asarray(values)[None], dtype=self._torch.float32)
                for values in (start.positions, start.quaternions)
            )
            self._env._settle = self._settle

    def _settle(self, _duration: float) -> None:
        """Takes the place of ManiSkill's method, which lets things settle for a fixed time."""
        thing = self._env.objs[self._env.source_obj_name]
        still = waited = 0
        while still * PERIOD < 1.0 and waited < _SETTLE_LIMIT:
            for _ in range(round(PERIOD * self._env.sim_freq)):
                self._env.scene.step()
            speeds = [
                float(np.linalg.norm(speed[0].cpu())) for speed in (thing.linear_velocity, thing.angular_velocity)
            ]
            still = still + 1 if speeds[0] < _STILL and speeds[1] < _STILL_TURNING else 0
            waited += 1

    def _shoot(self) -> None:
        if self.film is not None and self.steps % _STEPS_PER_FRAME == 0:
            with self._timed("film"):
                self.film(self.picture(), self.steps * PERIOD)

    def _render(self) -> Any:
        # Rendering costs five times what a step does: it is on only while a picture is taken. There is no setter.
        self._env._obs_mode = _SEEING
        try:
            return self._env.get_obs()
        finally:
            self._env._obs_mode = _BLIND

    def _T_world_base(self) -> FloatArray:
        pose = self._env.agent.robot.pose
        quaternion = np.asarray(pose.q[0].cpu())  # (w, x, y, z)
        return make_transform(Rotation.from_quat(quaternion, scalar_first=True).as_matrix(), pose.p[0].cpu())

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        start = time.monotonic()
        try:
            yield
        finally:
            self.seconds[name] += time.monotonic() - start


def _import_mani_skill() -> tuple[ModuleType, ModuleType]:
    # ManiSkill asks on the terminal before it downloads. That its assets are there was seen before.
    os.environ.setdefault("MS_SKIP_ASSET_DOWNLOAD_PROMPT", "1")
    try:
        import mani_skill.envs.tasks.digital_twins.bridge_dataset_eval as bridge
        import torch
    except ImportError as error:
        raise SetupError(f"SimplerEnv's ManiSkill3 can't be imported ({error}). Run: {EXTRA}") from error
    return bridge, torch


def _make(base: Any, env_id: str, on_gpu: bool) -> Any:
    """ManiSkill's environment without the wrappers that would end the episode."""
    import gymnasium as gym

    # The tasks declare RGB only; their cameras give depth just as well.
    base.SUPPORTED_OBS_MODES = [_SEEING, "rgb+segmentation"]
    # ManiSkill keeps these two on the class: they must not hold what another environment left there.
    for kind in base.__mro__:
        for name in ("_objects_to_remove_from_greenscreen", "_rgb_overlay_images"):
            if (held := vars(kind).get(name)) is not None:
                held.clear()
    backend = "gpu" if on_gpu else "cpu"
    try:
        env = gym.make(env_id, obs_mode=_SEEING, sim_backend="cpu", render_backend=backend).unwrapped
    except RuntimeError as error:  # SAPIEN's, where no Vulkan driver renders
        raise SetupError(f"SimplerEnv doesn't render here ({error}). See what is missing: {SETUP}") from error
    env._rgb_overlay_images = dict(env._rgb_overlay_images)  # type: ignore[attr-defined] # its own from here on
    env._obs_mode = _BLIND  # type: ignore[attr-defined] # see SimplerEnv._render
    return env
