"""The benchmark's WidowX as a `Robot`: key points by end-effector deltas at 5 Hz, within the step budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ..envs.simpler import FINGER_OFFSET, PERIOD, SimplerEnv
from ..errors import FailureStage, MotionRejected
from ..geometry import FloatArray, make_transform
from ..motion import ArmModel, IKSolver, MotionLimits
from ..perception.grasps import GraspTuning, GripperShape
from ..perception.rig import Rig
from ..perception.views import Tuning, Workspace
from ..types import ExecutionReport, Gripper, KeyPoint, Observation, RobotState
from .robot import Boxes
from .simulated import BodyFilter

STEP_LENGTH = 0.035
"""m commanded per step; 0.18 m/s."""
DESCENT_LENGTH = 0.025
"""m per step straight down: the arm lags the command by more than a step."""
STEP_ANGLE = 0.35
"""rad per step."""
ARRIVED = 0.006
"""m between the TCP and a key point at which it counts as reached."""
LOST = 0.018
"""m off a key point from which something must be in the way."""
CLOSED_GAP = 0.0115
"""m between the fingers up to which nothing is between them."""
SETTLE_STEPS = 3
CLOSE_STEPS = 3
OPEN_STEPS = 2
RAISED = 0.09
"""m by which home is above the start pose, in which the gripper hides things from the camera."""
HOME_STEPS = 12
"""Steps that must be left for the arm to go home: what doesn't fit into the budget isn't begun."""


WORKSPACE = Workspace(x=(0.08, 0.50), y=(-0.30, 0.30))
# The depth is exact. The colours of what is no object come from a photograph, which says nothing about the table.
TUNING = Tuning(height=0.003, foot=0.0015, chroma=math.inf, brighter=math.inf, darker=0.0)
GRIPPER = GripperShape(  # measured on the collision meshes of the benchmark's arm
    max_opening=0.054,
    min_opening=0.054,
    closed_gap=0.010,
    tip=0.0156,
    finger_thickness=0.009,
    finger_half_width=0.013,
    knuckle_thickness=0.014,
    knuckle_height=0.020,
    palm_half_width=0.006,
    palm_height=0.0376,
)
GRASPING = GraspTuning(friction=0.3, firm=0.012)


class SimplerRobot:
    """Tracks key points in closed loop on the TCP pose that its own encoders give."""

    def __init__(self, env: SimplerEnv, budget: int, limits: MotionLimits | None = None) -> None:
        self._env = env
        self._budget = budget
        self._model = ArmModel()
        self._limits = limits or MotionLimits()
        self._solver = IKSolver(self._model, self._limits.joint_margin)
        self._hooks: list[Callable[[str, float], None]] = []
        state = self.state()
        self._home = state.T_base_tcp.copy()
        self._home[2, 3] += RAISED
        self._commanded = state.T_base_tcp
        self._open = True
        self.rig = Rig(BodyFilter(self._model), WORKSPACE, TUNING, GRIPPER, GRASPING)

    def state(self) -> RobotState:
        """What the encoders say."""
        joints = self._env.joints()
        opening = float(joints[6] + joints[7] - 2 * FINGER_OFFSET)
        return RobotState(joints[:6], self._model.forward(joints[:6]), opening, self._env.steps * PERIOD)

    def observe(self) -> Observation:
        """The benchmark camera's picture, and the encoders."""
        return self._env.observe(self.state())

    def check(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> None:
        """Raise MotionRejected where a key point is out of the workspace or of reach."""
        near = self.state().joint_positions
        for number, point in enumerate(keypoints, 1):
            try:
                if outside := self._limits.outside(point.T_base_tcp[:3, 3]):
                    raise MotionRejected(f"{outside}.")
                near = self._solver.solve(point.T_base_tcp, near)
            except MotionRejected as rejection:
                raise MotionRejected(f"Key point {number} ({point.description!r}): {rejection}") from rejection

    def execute(self, keypoints: Sequence[KeyPoint], boxes: Boxes) -> ExecutionReport:
        """Visit the key points as far as the step budget goes."""
        try:
            self.check(keypoints, boxes)
        except MotionRejected as rejection:
            return ExecutionReport(completed=False, reached=0, reason=str(rejection), stage=rejection.stage)
        holds = False
        for reached, point in enumerate(keypoints):
            self._announce(point.description)
            then = keypoints[reached + 1] if reached + 1 < len(keypoints) else None
            try:
                off = self._go(point.T_base_tcp, exactly=_must_be_reached(point, then))
                self._grip(point.gripper)
            except _BudgetUsedUp:
                why = f"The episode's {self._budget} steps are used up during {point.description!r}."
                return ExecutionReport(completed=False, reached=reached, reason=why, stage=FailureStage.CONTROL)
            if off > LOST:
                why = f"{point.description!r} ended {off * 1000:.0f} mm off: something is in the way."
                return ExecutionReport(completed=False, reached=reached, reason=why, stage=FailureStage.CONTROL)
            holds = point.gripper is Gripper.CLOSE or (holds and point.gripper is not Gripper.OPEN)
            if holds and self.state().gripper_opening <= CLOSED_GAP:
                why = f"Nothing is held after {point.description!r}: the fingers closed all the way."
                return ExecutionReport(completed=False, reached=reached, reason=why, stage=FailureStage.GRASP)
        return ExecutionReport(completed=True, reached=len(keypoints))

    def go_home(self) -> ExecutionReport:
        """Straight up and over the start pose, where the budget allows; otherwise the arm stays where it is."""
        if self._budget - self._env.steps >= HOME_STEPS:
            up = self._commanded.copy()
            up[2, 3] = max(up[2, 3], self._home[2, 3])
            try:
                for pose in (up, self._home):
                    self._go(pose, exactly=False)
            except _BudgetUsedUp:
                why = "The episode's steps were used up on the way home."
                return ExecutionReport(completed=False, reached=0, reason=why, stage=FailureStage.CONTROL)
        return ExecutionReport(completed=True, reached=0)

    def stop(self) -> None:
        """Hold the last command; the benchmark's arm has no other way to stand still."""

    def rest(self) -> None:
        """Hold still until the budget is used up: the benchmark judges the last step."""
        while self._env.steps < self._budget:
            self._command(self._commanded)

    def on_move(self, hook: Callable[[str, float], None]) -> None:
        """Call `hook(description, seconds)` when a move begins; seconds are not known beforehand here and 0."""
        self._hooks.append(hook)

    def _announce(self, description: str) -> None:
        for hook in self._hooks:
            hook(description, 0.0)

    def _go(self, T_base_goal: FloatArray, *, exactly: bool = True) -> float:
        """Move on a straight line and, where asked, wait until the arm has caught up; returns how far off it ended, m.

        Where the arm needn't be exact, it isn't off.
        """
        for T_base_next in waypoints(self._commanded, T_base_goal):
            self._command(T_base_next)
        if not exactly:
            return 0.0
        for _ in range(SETTLE_STEPS):
            off = float(np.linalg.norm(self.state().T_base_tcp[:3, 3] - T_base_goal[:3, 3]))
            if off < ARRIVED:
                return off
            self._command(T_base_goal)
        return float(np.linalg.norm(self.state().T_base_tcp[:3, 3] - T_base_goal[:3, 3]))

    def _grip(self, gripper: Gripper) -> None:
        if gripper is Gripper.KEEP or (gripper is Gripper.OPEN and self._open):
            return
        self._open = gripper is Gripper.OPEN
        for _ in range(OPEN_STEPS if self._open else CLOSE_STEPS):
            self._command(self._commanded)

    def _command(self, T_base_next: FloatArray) -> None:
        """One step towards a pose; the delta is counted from the last command, as the benchmark does."""
        if self._env.steps >= self._budget:
            raise _BudgetUsedUp
        translation = T_base_next[:3, 3] - self._commanded[:3, 3]
        turn = Rotation.from_matrix(T_base_next[:3, :3] @ self._commanded[:3, :3].T).as_euler("XYZ")
        self._env.step(np.array([*translation, *turn, 1.0 if self._open else -1.0]))
        self._commanded = T_base_next


def _must_be_reached(point: KeyPoint, then: KeyPoint | None) -> bool:
    """Whether the arm has to catch up at a key point: before the gripper acts, and before it goes down."""
    goes_down = then is not None and then.T_base_tcp[2, 3] < point.T_base_tcp[2, 3] - 0.01
    return goes_down or point.gripper is not Gripper.KEEP


class _BudgetUsedUp(Exception):
    """No step is left in the episode."""


def waypoints(T_base_start: FloatArray, T_base_goal: FloatArray) -> Iterator[FloatArray]:
    """Poses on the straight line between two, a step apart, the goal last."""
    way = T_base_goal[:3, 3] - T_base_start[:3, 3]
    length = DESCENT_LENGTH if way[2] < -0.01 else STEP_LENGTH
    turn = Rotation.from_matrix(T_base_goal[:3, :3] @ T_base_start[:3, :3].T).as_rotvec()
    count = int(np.ceil(max(np.linalg.norm(way) / length, np.linalg.norm(turn) / STEP_ANGLE)))
    for share in np.arange(1, count + 1) / max(count, 1):
        rotation = Rotation.from_rotvec(share * turn).as_matrix() @ T_base_start[:3, :3]
        yield make_transform(rotation, T_base_start[:3, 3] + share * way)
