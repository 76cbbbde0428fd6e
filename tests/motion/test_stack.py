"""The whole of motion on the MJCF's servos and real contact physics."""

from __future__ import annotations

import numpy as np
import pytest
from arms import PhysicsArm, top_down

from maniagent.errors import FailureStage
from maniagent.motion import ArmModel, ArmState, MotionStack
from maniagent.types import Gripper, KeyPoint, OrientedBox

BLOCK = OrientedBox(np.array([0.30, 0.15, 0.015]), np.array([0.03, 0.03, 0.03]), 0.4)
BIG = OrientedBox(np.array([0.30, -0.15, 0.025]), np.array([0.05, 0.05, 0.05]), 0.0)


def stack_block() -> list[KeyPoint]:
    yaw = 0.4
    return [
        KeyPoint(top_down(0.30, 0.15, 0.11, yaw), Gripper.OPEN, "above"),
        KeyPoint(top_down(0.30, 0.15, 0.016, yaw), Gripper.CLOSE, "down", touches=frozenset({0})),
        KeyPoint(top_down(0.30, 0.15, 0.15, yaw), Gripper.KEEP, "lift", held=0),
        KeyPoint(top_down(0.30, -0.15, 0.15, yaw), Gripper.KEEP, "over", held=0),
        KeyPoint(top_down(0.30, -0.15, 0.068, yaw), Gripper.OPEN, "lower", held=0, touches=frozenset({1})),
        KeyPoint(top_down(0.30, -0.15, 0.15, yaw), Gripper.KEEP, "retreat"),
    ]


def test_stacks_a_block_within_all_limits_and_goes_home(model: ArmModel) -> None:
    arm = PhysicsArm([BLOCK, BIG])
    states: list[ArmState] = []
    stack = MotionStack(arm, model=model, on_tick=states.append)
    report = stack.execute(stack_block(), {0: BLOCK, 1: BIG})
    assert report.completed, report.reason
    np.testing.assert_allclose(arm.box_position(0), [0.30, -0.15, 0.065], atol=0.003)
    np.testing.assert_allclose(arm.box_position(1), BIG.centre, atol=0.001)
    assert stack.go_home().completed
    tcp = np.array([model.forward(state.joint_positions)[:3, 3] for state in states])
    speed = np.linalg.norm(np.diff(tcp, axis=0), axis=1) / arm.period
    assert speed.max() < 1.05 * stack.limits.tcp_speed
    assert np.max([np.abs(state.joint_velocities) for state in states]) < model.velocity_limit[0] / 2
    np.testing.assert_allclose(arm.read().joint_positions, model.home, atol=3e-3)


def test_running_into_something_unseen_stops_the_arm_and_takes_the_pressure_off(model: ArmModel) -> None:
    arm = PhysicsArm([OrientedBox(np.array([0.30, 0.15, 0.05]), np.array([0.1, 0.1, 0.1]), 0.0)])
    down = [
        KeyPoint(top_down(0.30, 0.15, 0.2), Gripper.KEEP, "above"),
        KeyPoint(top_down(0.30, 0.15, 0.06), Gripper.KEEP, "down into it"),
    ]
    states: list[ArmState] = []
    report = MotionStack(arm, model=model, on_tick=states.append).execute(down, {})
    assert (report.reached, report.stage) == (1, FailureStage.CONTROL)
    assert "during 'down into it': something is in its way" in report.reason
    pressing = [state.time for state in states if np.abs(state.joint_efforts).max() > 5.0]
    assert np.ptp(pressing) < 0.15
    assert np.abs(arm.read().joint_velocities).max() < 0.1
    assert np.abs(arm.read().joint_efforts).max() < 3.0


def test_an_object_that_is_not_where_it_was_seen_is_reported(model: ArmModel) -> None:
    report = MotionStack(PhysicsArm([]), model=model).execute(stack_block(), {0: BLOCK, 1: BIG})
    assert (report.completed, report.stage) == (False, FailureStage.GRASP)


def test_an_object_that_is_pulled_away_is_noticed(model: ArmModel) -> None:
    arm = PhysicsArm([BLOCK, BIG])

    def pull(state: ArmState) -> None:
        if arm.box_position(0)[2] > 0.1:
            arm.data.body("box0").xpos[:] = 0.0
            arm.data.joint(8).qpos[:3] = [0.2, 0.3, 0.02]

    report = MotionStack(arm, model=model, on_tick=pull).execute(stack_block(), {0: BLOCK, 1: BIG})
    assert report.stage == FailureStage.GRASP
    assert "slipped" in report.reason


@pytest.mark.parametrize("mass_density", [100.0, 3000.0])
def test_carries_light_and_heavy_blocks(model: ArmModel, mass_density: float) -> None:
    arm = PhysicsArm([BLOCK, BIG], density=mass_density)
    assert MotionStack(arm, model=model).execute(stack_block(), {0: BLOCK, 1: BIG}).completed
    np.testing.assert_allclose(arm.box_position(0), [0.30, -0.15, 0.065], atol=0.004)
