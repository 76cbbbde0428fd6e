"""What `Reach` promises holds on the arm: where it says yes, the solver finds postures and the planner finds ways."""

from __future__ import annotations

import numpy as np
import pytest

from maniagent.data.reach import GRASP_HEIGHT, LIFTED_HEIGHT, Reach
from maniagent.geometry import make_transform, top_down_rotation
from maniagent.motion import ArmModel, IKSolver, MotionLimits, MotionPlanner
from maniagent.types import Gripper, KeyPoint, OrientedBox


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return ArmModel()


@pytest.fixture(scope="module")
def reach(model: ArmModel) -> Reach:
    return Reach(model, MotionLimits())


def drawn(reach: Reach, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(reach.low, reach.high, (count, 2)), rng.uniform(-np.pi, np.pi, count)


def test_wherever_it_says_yes_the_solver_reaches_both_heights(model: ArmModel, reach: Reach) -> None:
    limits = MotionLimits()
    solver = IKSolver(model, limits.joint_margin)
    xy, yaw = drawn(reach, 250)
    inside = reach.contains(xy, yaw)
    assert 0.6 < inside.mean() < 0.9
    for (x, y), turn in zip(xy[inside], yaw[inside], strict=True):
        for z in (GRASP_HEIGHT, LIFTED_HEIGHT):
            solver.solve(make_transform(top_down_rotation(turn), [x, y, z]), model.home, jaw_symmetry=True)


def test_the_middle_of_the_table_is_within_reach_and_what_is_far_or_under_the_arm_is_not(reach: Reach) -> None:
    yaws = np.linspace(-np.pi, np.pi, 37)
    for xy, possible in (((0.25, 0.0), True), ((0.3, -0.2), True), ((0.49, 0.2), False), ((0.06, 0.0), False)):
        assert np.all(reach.contains(np.tile(xy, (37, 1)), yaws) == possible)


def test_fingers_may_be_swapped(reach: Reach) -> None:
    xy, yaw = drawn(reach, 2000)
    assert np.array_equal(reach.contains(xy, yaw), reach.contains(xy, yaw + np.pi))


def test_nothing_outside_the_workspace_is_within_reach(model: ArmModel) -> None:
    narrow = Reach(model, MotionLimits(workspace_low=(0.2, -0.1, -0.005), workspace_high=(0.3, 0.1, 0.5)))
    xy = np.array([[0.25, 0.0], [0.199, 0.0], [0.301, 0.0], [0.25, 0.101], [np.nan, 0.0]])
    assert narrow.contains(xy, np.zeros(5)).tolist() == [True, False, False, False, False]


def test_a_workspace_too_low_to_lift_in_holds_no_place(model: ArmModel) -> None:
    low = Reach(model, MotionLimits(workspace_low=(0.2, -0.1, -0.005), workspace_high=(0.3, 0.1, 0.1)))
    assert not low.contains(np.array([[0.25, 0.0]]), np.zeros(1)).any()


@pytest.mark.slow
def test_the_planner_picks_things_up_at_the_rim(model: ArmModel, reach: Reach) -> None:
    planner = MotionPlanner(model, MotionLimits())
    xy, yaw = drawn(reach, 20_000, seed=1)
    inside = reach.contains(xy, yaw)
    beyond = ~reach.contains(xy * 1.03, yaw) | ~reach.contains(xy * 0.97, yaw)
    rim = np.flatnonzero(inside & beyond)
    for i in rim[:: len(rim) // 30]:
        x, y = xy[i]
        thing = OrientedBox(np.array([x, y, 0.014]), np.array([0.12, 0.03, 0.028]), yaw[i])
        planner.plan(pick_up(x, y, yaw[i]), model.home, model.max_opening, {0: thing})


def pick_up(x: float, y: float, yaw: float) -> list[KeyPoint]:
    above, taken, lifted = (make_transform(top_down_rotation(yaw), [x, y, z]) for z in (0.115, 0.016, 0.116))
    return [
        KeyPoint(above, Gripper.OPEN, "above it"),
        KeyPoint(taken, Gripper.CLOSE, "take it", touches=frozenset({0})),
        KeyPoint(lifted, Gripper.KEEP, "lift it", touches=frozenset({0}), held=0),
    ]
