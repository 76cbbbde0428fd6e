"""The whole of motion behind three verbs, as a robot uses it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import MotionRejected
from ..types import ExecutionReport, KeyPoint, OrientedBox
from .arm import Arm, ArmState
from .executor import ExecutionSettings, Executor, OnMove, OnTick
from .gate import ApprovedPlan, MotionGate
from .kinematics import ArmModel
from .limits import MotionLimits
from .planner import MotionPlanner

_SAME_POSTURE = 0.01
"""rad: a plan is used again when the arm hasn't moved further than this since it was made."""
_SAME_OPENING = 0.002
"""m, likewise for the fingers."""


@dataclass(frozen=True)
class _Checked:
    keypoints: Sequence[KeyPoint]
    boxes: Mapping[int, OrientedBox]
    state: ArmState
    approved: ApprovedPlan


class MotionStack:
    """Plans, checks and executes key points on one arm. One instance serves one thread."""

    def __init__(
        self,
        arm: Arm,
        limits: MotionLimits | None = None,
        model: ArmModel | None = None,
        settings: ExecutionSettings | None = None,
        on_tick: OnTick | None = None,
        on_move: OnMove | None = None,
    ) -> None:
        """`on_tick` sees the arm's state after every control period; `on_move` every move's description and seconds."""
        self.arm = arm
        self.model = model or ArmModel()
        self.limits = limits or MotionLimits()
        self._planner = MotionPlanner(self.model, self.limits)
        self._gate = MotionGate(self.model, self.limits)
        self._executor = Executor(arm, self.model, settings, on_tick, on_move)
        self._checked: _Checked | None = None

    def check(
        self, keypoints: Sequence[KeyPoint], boxes: Mapping[int, OrientedBox], *, jaw_symmetry: bool = True
    ) -> ApprovedPlan:
        """Plan from where the arm is now, without moving; raises MotionRejected with the reason in one sentence.

        `boxes` holds every object that counts, by the index that key points use in `touches` and `held`.
        `execute` with the same key points and boxes uses the plan again while the arm stays where it is.
        """
        state = self._state()
        self._gate.check_keypoints(keypoints)
        opening = float(np.clip(state.gripper_opening, self.model.min_opening, self.model.max_opening))
        plan = self._planner.plan(keypoints, state.joint_positions, opening, boxes, jaw_symmetry=jaw_symmetry)
        self._checked = _Checked(keypoints, boxes, state, self._gate.approve(plan))
        return self._checked.approved

    def execute(
        self, keypoints: Sequence[KeyPoint], boxes: Mapping[int, OrientedBox], *, jaw_symmetry: bool = True
    ) -> ExecutionReport:
        """Visit the key points. What goes wrong, in planning or on the way, is in the report; the arm is at rest."""
        try:
            approved = self._still_valid(keypoints, boxes)
            approved = approved or self.check(keypoints, boxes, jaw_symmetry=jaw_symmetry)
        except MotionRejected as rejection:
            return _rejected(rejection)
        self._checked = None
        return self._executor.run(approved)

    def go_home(self, boxes: Mapping[int, OrientedBox] | None = None) -> ExecutionReport:
        """Rise straight up and go to the home posture, around the boxes; the fingers keep what they hold."""
        try:
            state = self._state()
            opening = float(np.clip(state.gripper_opening, self.model.min_opening, self.model.max_opening))
            approved = self._gate.approve(self._planner.plan_home(state.joint_positions, opening, boxes or {}))
        except MotionRejected as rejection:
            return _rejected(rejection)
        return self._executor.run(approved)

    def _state(self) -> ArmState:
        state = self.arm.read()
        if not state.is_finite():
            raise MotionRejected("A servo reads no valid position.")
        return state

    def _still_valid(self, keypoints: Sequence[KeyPoint], boxes: Mapping[int, OrientedBox]) -> ApprovedPlan | None:
        """The plan of the last `check`, where it was for these key points and boxes and the arm is still there."""
        last = self._checked
        if last is None or last.keypoints is not keypoints or last.boxes is not boxes:
            return None
        now = self._state()
        moved = float(np.abs(now.joint_positions - last.state.joint_positions).max())
        fingers_moved = abs(now.gripper_opening - last.state.gripper_opening)
        return last.approved if moved < _SAME_POSTURE and fingers_moved < _SAME_OPENING else None


def _rejected(rejection: MotionRejected) -> ExecutionReport:
    return ExecutionReport(completed=False, reached=0, reason=str(rejection), stage=rejection.stage)
