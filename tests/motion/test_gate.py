from __future__ import annotations

import numpy as np
import pytest
from arms import top_down
from pydantic import ValidationError

from maniagent.errors import MotionRejected, UsageError
from maniagent.geometry import FloatArray
from maniagent.motion import ApprovedPlan, ArmModel, MotionGate, MotionLimits
from maniagent.motion.path import joint_line
from maniagent.motion.plan import MotionPlan, PlannedMove
from maniagent.motion.trajectory import JointTrajectory, time_path
from maniagent.types import Gripper, KeyPoint

MODEL = ArmModel()
LIMITS = MotionLimits()
GATE = MotionGate(MODEL, LIMITS)


def small_move(offset: float = 0.1) -> JointTrajectory:
    return time_path(joint_line(MODEL.home, MODEL.home + offset), MODEL, LIMITS)


def approve(trajectory: JointTrajectory, opening: float | None = None) -> ApprovedPlan:
    return GATE.approve(MotionPlan((PlannedMove("reach", trajectory, opening=opening),)))


def changed(trajectory: JointTrajectory, **arrays: FloatArray) -> JointTrajectory:
    fields = {"times": trajectory.times, "positions": trajectory.positions, "velocities": trajectory.velocities}
    return JointTrajectory(**{name: np.array(arrays.get(name, old)) for name, old in fields.items()})


def test_a_planned_trajectory_passes() -> None:
    assert approve(small_move()).plan.moves[0].description == "reach"


def test_an_approved_plan_can_not_be_made_by_hand() -> None:
    with pytest.raises(UsageError, match=r"MotionGate\.approve"):
        ApprovedPlan(MotionPlan(()), seal=object())


@pytest.mark.parametrize("name", ["times", "positions", "velocities"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_refuses_numbers_that_are_not_finite(name: str, value: float) -> None:
    array = np.array(getattr(small_move(), name))
    array[len(array) // 2] = value
    with pytest.raises(MotionRejected, match="not finite"):
        approve(changed(small_move(), **{name: array}))


def test_refuses_time_that_runs_backwards() -> None:
    with pytest.raises(MotionRejected, match="times do not increase"):
        approve(changed(small_move(), times=small_move().times[::-1]))


def test_refuses_joint_angles_beyond_the_limits_and_names_the_joint() -> None:
    beyond = np.linspace(MODEL.home, MODEL.home + np.array([0, 0, 0, 0, 1.0, 0]), 200)
    slow = JointTrajectory(np.linspace(0, 20, 200), beyond, np.zeros_like(beyond))
    with pytest.raises(MotionRejected, match=r"the wrist_angle joint would go .* degrees past its limit"):
        approve(slow)


def test_refuses_joints_that_turn_too_fast() -> None:
    trajectory = small_move()
    with pytest.raises(MotionRejected, match=r"joint would turn at .* rad/s \(1.57 allowed\)"):
        approve(changed(trajectory, times=trajectory.times / 10, velocities=trajectory.velocities * 10))


def test_refuses_a_jump_that_the_stated_velocities_hide() -> None:
    q = np.stack([MODEL.home, MODEL.home + 0.1])
    with pytest.raises(MotionRejected, match="joint would turn at"):
        approve(JointTrajectory(np.array([0.0, 0.01]), q, np.zeros((2, 6))))


def test_refuses_a_tcp_that_is_too_fast() -> None:
    fast = time_path(
        joint_line(MODEL.home, MODEL.home + np.array([1.0, 0, 0, 0, 0, 0])), MODEL, MotionLimits(tcp_speed=0.6)
    )
    with pytest.raises(MotionRejected, match=r"the TCP would move at 0.\d\d m/s \(0.25 allowed\)"):
        approve(fast)


def test_refuses_to_leave_the_workspace_but_not_to_come_back_into_it() -> None:
    out = time_path(joint_line(MODEL.home, MODEL.home + np.array([0, -0.8, -0.4, 0, 0, 0])), MODEL, LIMITS)
    assert not LIMITS.contains(MODEL.forward(out.goal)[:3, 3])
    with pytest.raises(MotionRejected, match="outside the workspace"):
        approve(out)
    approve(changed(out, positions=out.positions[::-1]))


def test_refuses_moves_that_do_not_join() -> None:
    first, second = PlannedMove("a", small_move()), PlannedMove("b", small_move())
    with pytest.raises(MotionRejected, match="'b' is refused: it does not start where"):
        GATE.approve(MotionPlan((first, second)))


@pytest.mark.parametrize("opening", [-0.01, 0.2, float("nan")])
def test_refuses_impossible_openings(opening: float) -> None:
    with pytest.raises(MotionRejected, match="fingers can't be"):
        approve(small_move(), opening)


@pytest.mark.parametrize(
    ("T", "reason"),
    [
        (np.full((4, 4), np.nan), "not finite"),
        (2 * np.eye(4), "not a rotation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "not a rotation"),
        (top_down(0.3, 0.5, 0.1), r"y = 0.500 m is outside the workspace \(-0.360 to 0.360 m\)"),
        (top_down(0.3, 0.0, -0.1), r"z = -0.100 m"),
    ],
)
def test_refuses_key_points_before_planning(T: FloatArray, reason: str) -> None:
    with pytest.raises(MotionRejected, match=r"Key point 1 \('go'\): .*" + reason):
        GATE.check_keypoints([KeyPoint(T, Gripper.KEEP, "go")])


@pytest.mark.parametrize(
    "fields",
    [
        {"tcp_speed": 0.0},
        {"tcp_speed": float("inf")},
        {"joint_speed_share": 1.5},
        {"workspace_low": (0.6, -0.3, 0.0)},
        {"workspace_low": (float("nan"), -0.3, 0.0)},
        {"speed": 1.0},
    ],
)
def test_limits_are_validated(fields: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        MotionLimits.model_validate(fields)
