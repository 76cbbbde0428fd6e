from __future__ import annotations

import numpy as np
import pytest
from arms import IdealArm, top_down

from maniagent.errors import FailureStage
from maniagent.motion import ArmModel, ArmState, ExecutionSettings, MotionStack
from maniagent.types import ExecutionReport, Gripper, KeyPoint, OrientedBox

BLOCK = OrientedBox(np.array([0.30, 0.10, 0.015]), np.array([0.03, 0.03, 0.03]), 0.0)
BOXES = {0: BLOCK}
PICK = [
    KeyPoint(top_down(0.30, 0.10, 0.12), Gripper.OPEN, "above"),
    KeyPoint(top_down(0.30, 0.10, 0.016), Gripper.CLOSE, "down", touches=frozenset({0})),
    KeyPoint(top_down(0.30, 0.10, 0.14), Gripper.KEEP, "lift", held=0),
    KeyPoint(top_down(0.25, -0.10, 0.14), Gripper.KEEP, "aside", held=0),
]


def run(arm: IdealArm, keypoints: list[KeyPoint] = PICK, **options: object) -> ExecutionReport:
    return MotionStack(arm, model=arm.model, **options).execute(keypoints, BOXES)  # type: ignore[arg-type]  # hooks


@pytest.fixture
def arm(model: ArmModel) -> IdealArm:
    return IdealArm(model, object_width=0.03)


def test_completes_and_rests_at_the_last_key_point(arm: IdealArm, model: ArmModel) -> None:
    assert run(arm) == ExecutionReport(completed=True, reached=4)
    np.testing.assert_allclose(model.forward(arm.q)[:3, 3], PICK[-1].T_base_tcp[:3, 3], atol=2e-3)
    assert np.abs(arm.dq).max() < 0.05


def test_closing_on_nothing_is_a_grasp_failure(model: ArmModel) -> None:
    arm = IdealArm(model)
    report = run(arm)
    assert (report.completed, report.reached, report.stage) == (False, 1, FailureStage.GRASP)
    assert report.reason == "The fingers closed on nothing after 'down'."
    assert arm.stopped == 1


def test_closing_without_an_object_is_fine_where_nothing_has_to_be_held(model: ArmModel) -> None:
    keypoints = [KeyPoint(top_down(0.3, 0.0, 0.1), Gripper.CLOSE, "make a fist")]
    arm = IdealArm(model)
    assert run(arm, keypoints).completed
    assert arm.opening == pytest.approx(model.min_opening)


def test_an_object_that_slips_is_noticed_on_the_way(arm: IdealArm) -> None:
    def slip(arm: IdealArm) -> None:
        if arm.pressing and arm.time > 5.5:
            arm.object_width = None

    arm.disturb = slip
    report = run(arm)
    assert (report.reached, report.stage) == (3, FailureStage.GRASP)
    assert report.reason == "The object slipped out of the gripper during 'aside'."
    assert arm.stopped == 1


def test_an_arm_that_is_blocked_stops_and_says_where(arm: IdealArm) -> None:
    stuck = arm.model.home[0] + 0.1

    def block(arm: IdealArm) -> None:
        arm.q[0] = min(arm.q[0], stuck)

    arm.disturb = block
    report = run(arm)
    assert (report.reached, report.stage) == (0, FailureStage.CONTROL)
    assert "during 'above'" in report.reason
    assert "mostly at the waist joint" in report.reason
    assert np.abs(arm.set_points[-1][0] - stuck) < 0.25


def test_a_servo_that_stops_answering_stops_the_arm(arm: IdealArm) -> None:
    def lose(arm: IdealArm) -> None:
        if arm.time > 1.0:
            arm.q[3] = np.nan

    arm.disturb = lose
    report = run(arm)
    assert report.reason == "The arm stopped during 'above': a servo reads no valid position."
    assert arm.stopped == 1


def test_a_servo_that_never_answered_keeps_the_arm_from_moving(arm: IdealArm) -> None:
    arm.q[3] = np.nan
    report = run(arm)
    assert not report.completed
    assert arm.set_points == []


def test_a_rejected_plan_moves_nothing(arm: IdealArm) -> None:
    report = run(arm, [KeyPoint(top_down(0.48, 0.30, 0.1), Gripper.KEEP, "too far")])
    assert (report.reached, report.stage) == (0, FailureStage.PLANNING)
    assert "Key point 1 ('too far')" in report.reason
    assert arm.set_points == []


def test_interrupting_stops_the_arm_and_is_passed_on(arm: IdealArm) -> None:
    def interrupt(state: ArmState) -> None:
        if state.time > 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(arm, on_tick=interrupt)
    assert arm.stopped == 1
    assert arm.time < 1.1


def test_hooks_see_every_move_and_every_tick(arm: IdealArm) -> None:
    moves: list[str] = []
    ticks: list[float] = []
    run(arm, on_move=lambda name, seconds: moves.append(name), on_tick=lambda state: ticks.append(state.time))
    assert moves == ["above", "down", "lift", "aside"]
    assert len(ticks) == len(arm.set_points)


def test_set_points_never_jump(arm: IdealArm) -> None:
    run(arm)
    steps = np.abs(np.diff(np.array(arm.set_points), axis=0))
    assert steps.max() <= arm.period * np.pi / 2


def test_a_checked_plan_is_used_again_until_the_arm_moves(arm: IdealArm) -> None:
    stack = MotionStack(arm, model=arm.model)
    approved = stack.check(PICK, BOXES)
    assert stack._still_valid(PICK, BOXES) is approved
    assert stack._still_valid(list(PICK), BOXES) is None
    arm.q[0] += 0.1
    assert stack._still_valid(PICK, BOXES) is None
    assert arm.set_points == []


def test_a_plan_made_elsewhere_is_not_followed(arm: IdealArm) -> None:
    stack = MotionStack(arm, model=arm.model)
    approved = stack.check(PICK, BOXES)
    arm.q[0] += 0.2
    report = stack._executor.run(approved)
    assert "is not where 'above' starts" in report.reason
    assert arm.set_points == []


def test_fingers_that_stay_shut_are_reported(arm: IdealArm) -> None:
    arm.opening = 0.004

    def jam(arm: IdealArm) -> None:
        arm.opening = min(arm.opening, 0.01)

    arm.disturb = jam
    report = run(arm)
    assert report.reason == "The fingers opened only 10 mm after 'above'."


def test_goes_home_from_anywhere_and_keeps_its_grip(arm: IdealArm, model: ArmModel) -> None:
    stack = MotionStack(arm, model=model)
    assert stack.execute(PICK, BOXES).completed
    assert stack.go_home().completed
    np.testing.assert_allclose(arm.q, model.home, atol=5e-3)
    assert arm.pressing


def test_settings_are_the_callers(arm: IdealArm) -> None:
    report = run(arm, settings=ExecutionSettings(held_clearance=0.03))
    assert report.stage == FailureStage.GRASP
