"""The twin's robot: a simulated arm behind the same motion stack as a real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..envs.tabletop import TabletopEnv
from ..errors import CameraFailure, UsageError
from ..geometry import FloatArray
from ..motion import ArmModel, ArmState, MotionLimits, MotionStack
from ..perception.rig import Rig
from ..types import ExecutionReport, KeyPoint, Observation
from .body_filter import BodyFilter as BodyFilter
from .robot import Boxes
from .sampling import Metronome, Picture, Sample, SampleListener, Sampling

FRAMES_PER_SECOND = 10.0


class SimulatedArm:
    """The twin's servos as motion's `Arm`."""

    def __init__(self, env: TabletopEnv) -> None:
        self._env = env
        self.joint_targets: FloatArray = env.home
        """(6,) rad, last command."""
        self.opening_target = env.opening_range[1]
        """m, likewise."""

    @property
    def period(self) -> float:
        """The control period, s."""
        return self._env.period

    def read(self) -> ArmState:
        """The servos' reading."""
        state = self._env.robot_state()
        return ArmState(
            joint_positions=state.joint_positions,
            joint_velocities=self._env.joint_velocities,
            joint_efforts=self._env.joint_efforts,
            gripper_opening=state.gripper_opening,
            gripper_effort=-self._env.gripper_effort / 2,  # the servo drives both fingers
            time=state.time,
        )

    def command(self, joint_positions: FloatArray, gripper_opening: float) -> None:
        """Simulate one control period."""
        self.joint_targets, self.opening_target = joint_positions, gripper_opening
        self._env.advance(joint_positions, gripper_opening)

    def stop(self) -> None:
        """Hold the joints where they are; the simulated gripper keeps its last command."""
        self.command(self._env.robot_state().joint_positions, self.opening_target)


class _Sampler:
    """Takes the samples of one recording in the twin."""

    def __init__(self, env: TabletopEnv, arm: SimulatedArm, listener: SampleListener, sampling: Sampling) -> None:
        self._env, self._arm, self._listener, self._sampling = env, arm, listener, sampling
        self._cameras = [camera.resized(sampling.width, sampling.height) for camera in env.cameras]
        for given, wanted in zip(env.cameras, self._cameras, strict=True):
            if wanted.width > given.width or wanted.height > given.height:
                raise UsageError(
                    f"The {given.name} camera takes no {wanted.width}x{wanted.height} pictures; "
                    f"record at {given.width}x{given.height} or less."
                )
        self._rng = np.random.default_rng(sampling.seed) if sampling.noise else None
        self._metronome = Metronome(sampling.rate, arm.period)
        self._model = ArmModel()
        self._failed = False

    def after_tick(self, state: ArmState) -> None:
        """Take a sample where one is due."""
        moving_time = self._metronome.tick(state.time)
        if moving_time is None or self._failed:
            return
        try:
            sample = self._take(state, moving_time)
        except CameraFailure as failure:
            self._failed = True
            self._listener.on_camera_failure(failure)
        else:
            self._listener.on_sample(sample)

    def _take(self, state: ArmState, moving_time: float) -> Sample:
        pictures = {}
        for camera in self._cameras:
            rgb, depth = self._env.take(camera, depth=self._sampling.depth, rng=self._rng)
            pictures[camera.name] = Picture(rgb, state.time, depth if self._sampling.depth else None)
        return Sample(
            time=state.time,
            moving_time=moving_time,
            joints=state.joint_positions,
            opening=state.gripper_opening,
            T_base_tcp=self._model.forward(state.joint_positions),
            joint_targets=self._arm.joint_targets.copy(),
            opening_target=self._arm.opening_target,
            T_base_target=self._model.forward(self._arm.joint_targets),
            pictures=pictures,
        )


class SimulatedRobot:
    """A `Robot` in the tabletop twin. What it hands out is what a real robot could know, and nothing else."""

    def __init__(
        self,
        env: TabletopEnv,
        limits: MotionLimits | None = None,
        on_frame: Callable[[NDArray[np.uint8], float], None] | None = None,
    ) -> None:
        """`on_frame(rgb, robot_time)` gets the main view ten times per simulated second while the arm moves."""
        self._env = env
        self._on_frame = on_frame
        self._next_frame = 0.0
        self._move_hooks: list[Callable[[str, float], None]] = []
        model = ArmModel()
        self.rig = Rig(BodyFilter(model))
        self._arm = SimulatedArm(env)
        self._sampler: _Sampler | None = None
        self._motion = MotionStack(self._arm, limits, model, on_tick=self._after_tick, on_move=self._announce)

    def observe(self) -> Observation:
        """Noisy pictures from all cameras, and the encoders."""
        return self._env.observe()

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Raise MotionRejected where the key points can't be visited from here."""
        self._motion.check(keypoints, boxes)

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Visit the key points and come to rest."""
        return self._motion.execute(keypoints, boxes)

    def go_home(self) -> ExecutionReport:
        """Straight up, then to the home posture."""
        return self._motion.go_home()

    def stop(self) -> None:
        """Stand still."""
        self._motion.arm.stop()

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Call `hook(description, seconds)` when a move begins."""
        self._move_hooks.append(hook)

    def start_sampling(self, listener: SampleListener, sampling: Sampling) -> None:
        """Tell `listener` of every sample from now on.

        Raises UsageError where the cameras' own pictures are smaller than those asked for.
        """
        self._sampler = _Sampler(self._env, self._arm, listener, sampling)

    def stop_sampling(self) -> None:
        """Tell nobody any more."""
        self._sampler = None

    def _announce(self, description: str, seconds: float) -> None:
        for hook in self._move_hooks:
            hook(description, seconds)

    def _after_tick(self, state: ArmState) -> None:
        if self._sampler is not None:
            self._sampler.after_tick(state)
        if self._on_frame is not None and state.time >= self._next_frame:
            self._next_frame = state.time + 1.0 / FRAMES_PER_SECOND
            self._on_frame(self._env.render(), state.time)
