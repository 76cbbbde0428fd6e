"""The twin's robot: a simulated arm behind the same motion stack as a real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..envs.tabletop import TabletopEnv
from ..geometry import FloatArray
from ..motion import ArmModel, ArmState, MotionLimits, MotionStack
from ..perception.rig import Rig
from ..types import ExecutionReport, KeyPoint, Observation
from .body_filter import BodyFilter as BodyFilter
from .robot import Boxes

FRAMES_PER_SECOND = 10.0


class SimulatedArm:
    """The twin's servos as motion's `Arm`."""

    def __init__(self, env: TabletopEnv) -> None:
        self._env = env
        self._last_opening = env.opening_range[1]

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
        self._last_opening = gripper_opening
        self._env.advance(joint_positions, gripper_opening)

    def stop(self) -> None:
        """Hold the joints where they are; the simulated gripper keeps its last command."""
        self._env.advance(self._env.robot_state().joint_positions, self._last_opening)


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
        self._motion = MotionStack(SimulatedArm(env), limits, model, on_tick=self._after_tick, on_move=self._announce)

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

    def _announce(self, description: str, seconds: float) -> None:
        for hook in self._move_hooks:
            hook(description, seconds)

    def _after_tick(self, state: ArmState) -> None:
        if self._on_frame is not None and state.time >= self._next_frame:
            self._next_frame = state.time + 1.0 / FRAMES_PER_SECOND
            self._on_frame(self._env.render(), state.time)
