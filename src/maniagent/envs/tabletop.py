"""The tabletop twin: a simulated WidowX-250s, a table with things on it, two RGB-D cameras (MuJoCo, gymnasium API).

Actions are joint targets and a finger opening; observations are calibrated images and what the robot's own
sensors say. The objects' true poses are behind `TabletopEnv.truth()`: for success predicates, resets and tests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets import JOINTS, WX250S_XML
from ..errors import UsageError
from ..geometry import FloatArray, make_transform
from ..types import CameraFrame, Observation, RobotState
from .cameras import MAIN_CAMERA, SIDE_CAMERA, CameraSpec, DepthNoise
from .objects import ObjectModel, attach
from .offscreen import OffscreenRenderer
from .scene import Placement, Scene, place_objects
from .studio import add_studio
from .viewer import LiveView, require_screen

TIMESTEP = 0.002
PAD_INSET = 0.013
"""m: the finger pads are 2 (q - PAD_INSET) apart at finger joint position q."""
SETTLE_SECONDS = 0.6


@dataclass(frozen=True)
class TrueObject:
    """The simulator's knowledge of one object. Never shown to agents."""

    model: ObjectModel
    T_base_object: FloatArray
    """(4, 4); origin in the middle of the footprint, x along the long axis."""
    speed: float
    """m/s."""
    angular_speed: float
    """rad/s."""
    touched: bool
    """Whether a finger, or any other part of the robot, is in contact with it."""


def _body(name: str) -> str:
    """MuJoCo's name for an object's body: no scene's names clash with the robot's."""
    return f"object/{name}"


class TabletopEnv(gym.Env[dict[str, Any], NDArray[np.float64]]):
    """One scene of the twin; each `reset(seed=...)` draws a new layout of it.

    The action is (7,): six joint targets (rad) and the finger opening (m). One step is `period` seconds. No reward
    is given: success is a task's predicate on `truth()`, not the environment's business.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - gymnasium's own declaration
        "render_modes": ["rgb_array", "human"],
        "render_fps": 10,
    }

    def __init__(
        self,
        scene: Scene,
        *,
        noise: DepthNoise | None = DepthNoise(),  # noqa: B008 - frozen
        cameras: Sequence[CameraSpec] = (MAIN_CAMERA, SIDE_CAMERA),
        render_mode: str = "rgb_array",
        period: float = 0.02,
    ) -> None:
        if render_mode == "human":
            require_screen()
        self.scene = scene
        self.cameras = tuple(cameras)
        self.noise = noise
        self.render_mode = render_mode
        self.period = period
        self._objects = {thing.name: thing.model() for thing in scene.objects}
        self.model = self._compile()
        self.data = mujoco.MjData(self.model)
        self.layout: tuple[Placement, ...] = ()
        self._substeps = round(period / self.model.opt.timestep)
        self._joint_qpos = np.array([self.model.joint(name).qposadr[0] for name in JOINTS])
        self._joint_dof = np.array([self.model.joint(name).dofadr[0] for name in JOINTS])
        self._finger_qpos = int(self.model.joint("left_finger").qposadr[0])
        self._actuators = np.array([self.model.actuator(name).id for name in JOINTS])
        self._gripper_actuator = int(self.model.actuator("gripper").id)
        self._of_robot = self.model.body_rootid == self.model.body("base_link").id
        self._renderer: OffscreenRenderer | None = None
        self._view: LiveView | None = None
        self._declare_spaces()

    def _compile(self) -> mujoco.MjModel:
        spec = mujoco.MjSpec.from_file(str(WX250S_XML))
        spec.option.timestep = TIMESTEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # Elliptic cones with a high impratio keep a squeezed object from creeping out of the fingers.
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        add_studio(spec, self.cameras)
        for name, model in self._objects.items():
            attach(spec, model, _body(name))
        # The arm's keyframe knows nothing of the objects' joints; home is read before it is dropped.
        self.home = np.array(list(spec.key("home").qpos))[:6]
        for key in list(spec.keys):
            spec.delete(key)
        return spec.compile()

    def _declare_spaces(self) -> None:
        low, high = self.model.jnt_range[[self.model.joint(name).id for name in JOINTS]].T
        finger_low, finger_high = self.model.joint("left_finger").range
        self.opening_range = (2 * (float(finger_low) - PAD_INSET), 2 * (float(finger_high) - PAD_INSET))
        self._action_bounds = gym.spaces.Box(
            np.append(low, self.opening_range[0]), np.append(high, self.opening_range[1]), dtype=np.float64
        )
        self.action_space = self._action_bounds
        images: dict[str, gym.spaces.Space[Any]] = {}
        for camera in self.cameras:
            shape = (camera.height, camera.width)
            images[f"{camera.name}_rgb"] = gym.spaces.Box(0, 255, (*shape, 3), np.uint8)
            images[f"{camera.name}_depth"] = gym.spaces.Box(0.0, np.inf, shape, np.float32)
        self.observation_space = gym.spaces.Dict(
            {
                "joint_positions": gym.spaces.Box(-np.inf, np.inf, (6,), np.float64),
                "gripper_opening": gym.spaces.Box(-np.inf, np.inf, (1,), np.float64),
                **images,
            }
        )

    # gymnasium ----------------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Draw a layout, put the arm at home, let everything settle.

        `options={"layout": placements}` sets that layout, of all the scene's objects, instead of drawing one.
        """
        super().reset(seed=seed)
        self.layout = tuple((options or {}).get("layout") or place_objects(self.scene, self.np_random))
        if {placement.name for placement in self.layout} != set(self._objects):
            raise UsageError(f"The layout should place {', '.join(self._objects)}, each once.")
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._joint_qpos] = self.home
        for side in ("left_finger", "right_finger"):
            self.data.joint(side).qpos[0] = self.model.joint(side).range[1]
        for placement in self.layout:
            half = placement.yaw / 2
            pose = [*placement.xy, placement.z + 0.001, np.cos(half), 0.0, 0.0, np.sin(half)]
            self.data.joint(_body(placement.name)).qpos[:] = pose
        mujoco.mj_forward(self.model, self.data)
        for _ in range(round(SETTLE_SECONDS / self.period)):
            self.advance(self.home, self.opening_range[1])
        return self._gym_observation(), {"layout": self.layout}

    def step(self, action: NDArray[np.float64]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One control period. Actions outside the action space are clipped; UsageError where one is not finite."""
        if not np.isfinite(action).all():
            raise UsageError(f"The action {action} is not finite; nothing moves.")
        bounds = self._action_bounds
        action = np.clip(action, bounds.low, bounds.high)
        self.advance(action[:6], float(action[6]))
        return self._gym_observation(), 0.0, False, False, {}

    def render(self) -> NDArray[np.uint8]:
        """The main view without noise, (H, W, 3) uint8."""
        return self._render(self.cameras[0])[0]

    def close(self) -> None:
        """Free the renderer and the viewer; closing twice does no harm."""
        if self._view is not None:
            self._view.close()
            self._view = None
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _gym_observation(self) -> dict[str, Any]:
        observation = self.observe()
        state = observation.robot
        images: dict[str, Any] = {}
        for name, frame in observation.frames.items():
            # Gymnasium's spaces can't hold NaN: as depth cameras do, 0 says that nothing is known.
            images |= {f"{name}_rgb": frame.rgb, f"{name}_depth": np.nan_to_num(frame.depth, nan=0.0)}
        opening = np.array([state.gripper_opening])
        return {"joint_positions": state.joint_positions, "gripper_opening": opening, **images}

    # What a robot needs -------------------------------------------------------------------------------------------

    def advance(self, joint_positions: FloatArray, opening: float) -> None:
        """Simulate one control period with these targets (rad, m), without taking pictures."""
        self.data.ctrl[self._actuators] = joint_positions
        self.data.ctrl[self._gripper_actuator] = opening / 2 + PAD_INSET
        mujoco.mj_step(self.model, self.data, self._substeps)
        if self.render_mode == "human":
            self._view = self._view or LiveView(self.model, self.data)
            self._view.show()

    def settle(self, seconds: float) -> None:
        """Simulate with the targets as they are: time for things to come to rest."""
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))

    def put(self, name: str, xy: Sequence[float], yaw: float) -> None:
        """Set an object down at a place of the table (m, rad, base frame), upright, as a person does between episodes.

        Raises UsageError for an object that isn't in the scene.
        """
        if name not in self._objects:
            raise UsageError(f"The scene has no {name}; it has {', '.join(self._objects)}.")
        joint = self.data.joint(_body(name))
        height = self._objects[name].rest_z + 0.001
        joint.qpos[:] = [xy[0], xy[1], height, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        joint.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.settle(SETTLE_SECONDS)

    def robot_state(self) -> RobotState:
        """What the encoders say."""
        tcp = self.data.site("tcp")
        return RobotState(
            joint_positions=self.data.qpos[self._joint_qpos],
            T_base_tcp=make_transform(tcp.xmat.reshape(3, 3), tcp.xpos),
            gripper_opening=float(2 * (self.data.qpos[self._finger_qpos] - PAD_INSET)),
            time=float(self.data.time),
        )

    @property
    def joint_velocities(self) -> FloatArray:
        """(6,) rad/s."""
        return self.data.qvel[self._joint_dof].copy()

    @property
    def joint_efforts(self) -> FloatArray:
        """(6,) N m, what the servos apply."""
        return self.data.actuator_force[self._actuators].copy()

    @property
    def gripper_effort(self) -> float:
        """N, what the gripper's servo applies to the fingers."""
        return float(self.data.actuator_force[self._gripper_actuator])

    def observe(self) -> Observation:
        """Pictures from all cameras, noisy as real ones, and the robot's state."""
        frames: dict[str, CameraFrame] = {}
        for camera in self.cameras:
            rgb, depth = self.take(camera, depth=True, rng=self.np_random)
            frames[camera.name] = CameraFrame(camera.name, rgb, depth, camera.K, camera.T_base_camera)
        return Observation(frames, self.cameras[0].name, self.robot_state())

    def take(
        self, camera: CameraSpec, *, depth: bool, rng: np.random.Generator | None
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """A picture by one of `cameras`, or by its `resized` self: RGB (H, W, 3) and z-depth (H, W) in metres.

        `rng` draws the noise; None leaves it out. Without `depth`, that is empty. The simulation is left as it is.
        """
        rgb, z = self._render(camera, depth)
        if self.noise is None or rng is None:
            return rgb, z
        if depth:
            z = self.noise.depth(z, camera.focal_length, rng)
        return self.noise.colour(rgb, rng), z

    # True state ---------------------------------------------------------------------------------------------------

    def truth(self) -> Mapping[str, TrueObject]:
        """The true state of every object, by name: for predicates, resets and tests alone."""
        touched = self._touched_bodies()
        state: dict[str, TrueObject] = {}
        for name, model in self._objects.items():
            body = self.data.body(_body(name))
            velocity = self.data.joint(_body(name)).qvel
            state[name] = TrueObject(
                model=model,
                T_base_object=make_transform(body.xmat.reshape(3, 3).copy(), body.xpos.copy()),
                speed=float(np.linalg.norm(velocity[:3])),
                angular_speed=float(np.linalg.norm(velocity[3:])),
                touched=body.id in touched,
            )
        return state

    def _touched_bodies(self) -> set[int]:
        """Ids of the bodies that the robot is in contact with."""
        bodies = self.model.geom_bodyid[self.data.contact.geom].reshape(-1, 2)
        of_robot = self._of_robot[bodies]
        return set(bodies[of_robot[:, ::-1] & ~of_robot].tolist())

    # Pictures -----------------------------------------------------------------------------------------------------

    def _render(self, camera: CameraSpec, depth: bool = False) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        if self._renderer is None:
            self._renderer = OffscreenRenderer(self.model)
        return self._renderer.render(self.data, camera.name, camera.width, camera.height, depth=depth)
