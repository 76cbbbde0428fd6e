from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from arms import top_down

from maniagent.errors import MotionRejected
from maniagent.geometry import FloatArray
from maniagent.motion import ArmModel, MotionGate, MotionLimits, MotionPlanner
from maniagent.motion.plan import MotionPlan
from maniagent.types import Gripper, KeyPoint, OrientedBox

BLOCK = OrientedBox(np.array([0.30, 0.15, 0.015]), np.array([0.03, 0.03, 0.03]), 0.4)
PLATE = OrientedBox(np.array([0.30, -0.15, 0.01]), np.array([0.12, 0.12, 0.02]), 0.0)


def point(description: str, T: FloatArray, gripper: Gripper = Gripper.KEEP, **rest: object) -> KeyPoint:
    return KeyPoint(T, gripper, description, **rest)  # type: ignore[arg-type]  # keyword arguments of KeyPoint


def pick_and_place(yaw: float = 0.4, place_z: float = 0.037) -> list[KeyPoint]:
    x, y = 0.30, 0.15
    return [
        point("above the block", top_down(x, y, 0.12, yaw), Gripper.OPEN),
        point("down to it", top_down(x, y, 0.016, yaw), Gripper.CLOSE, touches=frozenset({0})),
        point("lift", top_down(x, y, 0.14, yaw), held=0),
        point("over the plate", top_down(0.30, -0.15, 0.14, yaw), held=0),
        point("lower", top_down(0.30, -0.15, place_z, yaw), Gripper.OPEN, held=0, touches=frozenset({1})),
        point("let go", top_down(0.30, -0.15, 0.12, yaw)),
    ]


def plan(
    planner: MotionPlanner, keypoints: list[KeyPoint], boxes: Mapping[int, OrientedBox], **options: bool
) -> MotionPlan:
    return planner.plan(keypoints, planner.model.home, planner.model.max_opening, boxes, **options)


def tcp(model: ArmModel, planned: MotionPlan, move: int) -> FloatArray:
    return np.array([model.forward(q)[:3, 3] for q in planned.moves[move].trajectory.positions])


def test_pick_and_place_visits_every_key_point(planner: MotionPlanner, model: ArmModel) -> None:
    keypoints = pick_and_place()
    planned = plan(planner, keypoints, {0: BLOCK, 1: PLATE}, jaw_symmetry=False)
    assert [move.reached for move in planned.moves] == [1, 2, 3, 4, 5, 6]
    for move, wanted in zip(planned.moves, keypoints, strict=True):
        np.testing.assert_allclose(model.forward(move.trajectory.goal), wanted.T_base_tcp, atol=2e-3)
    for before, after in zip(planned.moves, planned.moves[1:], strict=False):
        np.testing.assert_array_equal(before.trajectory.goal, after.trajectory.start)
    assert planned.moves[1].grasps == 0
    MotionGate(model, MotionLimits()).approve(planned)


def test_ways_down_and_up_are_vertical_lines(planner: MotionPlanner, model: ArmModel) -> None:
    planned = plan(planner, pick_and_place(), {0: BLOCK, 1: PLATE})
    for move in (1, 2, 4, 5):
        track = tcp(model, planned, move)
        assert np.ptp(track[:, :2], axis=0).max() < 1e-3


def test_moves_that_may_touch_something_are_slow(planner: MotionPlanner, model: ArmModel) -> None:
    planned = plan(planner, pick_and_place(), {0: BLOCK, 1: PLATE})
    times = planned.moves[1].trajectory.times
    speed = np.linalg.norm(np.diff(tcp(model, planned, 1), axis=0), axis=1) / np.diff(times)
    assert speed.max() < 1.01 * planner.limits.contact_speed


def test_is_quick(planner: MotionPlanner) -> None:
    seconds = min(plan(planner, pick_and_place(), {0: BLOCK, 1: PLATE}).planning_seconds for _ in range(5))
    assert seconds < 0.15


def test_swaps_the_fingers_for_a_whole_sequence_where_that_turns_the_wrist_less(
    planner: MotionPlanner, model: ArmModel
) -> None:
    keypoints = pick_and_place(yaw=np.pi - 0.2)
    swapped = plan(planner, keypoints, {0: BLOCK, 1: PLATE})
    kept = plan(planner, keypoints, {0: BLOCK, 1: PLATE}, jaw_symmetry=False)
    closing = [model.forward(move.trajectory.goal)[:3, 1] for move in swapped.moves]
    for axis, wanted in zip(closing, keypoints, strict=True):
        np.testing.assert_allclose(axis, -wanted.T_base_tcp[:3, 1], atol=2e-3)
    assert swapped.duration < kept.duration


def test_never_swaps_the_fingers_around_a_held_object(planner: MotionPlanner, model: ArmModel) -> None:
    above = top_down(0.25, 0.0, 0.15, np.pi - 0.2)
    planned = plan(
        planner, [point("turn it", above, held=0)], {0: OrientedBox(np.array([0.2, 0, 0.2]), np.full(3, 0.03), 0)}
    )
    np.testing.assert_allclose(model.forward(planned.moves[0].trajectory.goal), above, atol=2e-3)


@pytest.mark.parametrize(
    ("T", "reason"),
    [
        (top_down(0.60, 0.0, 0.1), r"Key point 1 \('there'\): x = 0.600 m is outside the workspace"),
        (top_down(0.48, 0.30, 0.1), r"beyond the arm's reach"),
        (top_down(0.30, 0.0, 0.003), r"finger would hit the table"),
    ],
)
def test_rejects_what_can_not_be_done_and_says_why(planner: MotionPlanner, T: FloatArray, reason: str) -> None:
    with pytest.raises(MotionRejected, match=reason):
        plan(planner, [point("there", T)], {})


def test_rejects_a_way_down_onto_an_object_that_may_not_be_touched(planner: MotionPlanner) -> None:
    beside = OrientedBox(np.array([0.30, 0.185, 0.03]), np.array([0.03, 0.03, 0.06]), 0.0)
    with pytest.raises(MotionRejected, match=r"Key point 2 \('down to it'\): .* would hit object 5"):
        plan(planner, pick_and_place(yaw=0.0), {0: BLOCK, 1: PLATE, 5: beside})


def test_goes_around_an_obstacle(planner: MotionPlanner, model: ArmModel) -> None:
    wall = OrientedBox(np.array([0.33, 0.0, 0.1]), np.array([0.1, 0.02, 0.2]), 0.0)
    planned = plan(planner, pick_and_place(), {0: BLOCK, 1: PLATE, 2: wall})
    inside_wall = [abs(x - 0.33) < 0.045 and abs(y) < 0.005 and z < 0.19 for x, y, z in tcp(model, planned, 3)]
    assert not any(inside_wall)
    MotionGate(model, MotionLimits()).approve(planned)


def test_a_placed_object_is_an_obstacle_where_it_was_put(planner: MotionPlanner) -> None:
    beside = (0.30, -0.125)  # a finger would come down on the block
    onto_it = [point("beside", top_down(*beside, 0.12, 0.4)), point("down", top_down(*beside, 0.04, 0.4))]
    plan(planner, onto_it, {0: BLOCK})
    with pytest.raises(MotionRejected, match="would hit object 0"):
        plan(planner, [*pick_and_place(), *onto_it], {0: BLOCK})


def test_the_arm_may_leave_what_it_already_touches(planner: MotionPlanner, model: ArmModel) -> None:
    start = plan(planner, pick_and_place()[:2], {0: BLOCK}).moves[-1].trajectory.goal
    around_the_hand = OrientedBox(np.array([0.30, 0.15, 0.03]), np.array([0.1, 0.1, 0.06]), 0.0)
    up = point("out", top_down(0.30, 0.15, 0.15, 0.4))
    planned = planner.plan([up], start, model.max_opening, {3: around_the_hand}, jaw_symmetry=False)
    assert planned.moves[0].reached == 1


def test_carrying_an_unknown_object_is_rejected(planner: MotionPlanner) -> None:
    with pytest.raises(MotionRejected, match="There is no object 9"):
        plan(planner, [point("carry", top_down(0.3, 0.0, 0.2), held=9)], {})


def test_way_home_rises_first(planner: MotionPlanner, model: ArmModel) -> None:
    start = plan(planner, pick_and_place()[:2], {0: BLOCK}).moves[-1].trajectory.goal
    home = planner.plan_home(start, model.max_opening, {0: BLOCK, 1: PLATE})
    assert [move.description for move in home.moves] == ["rise", "go home"]
    assert np.ptp(tcp(model, home, 0)[:, :2], axis=0).max() < 1e-3
    np.testing.assert_allclose(home.moves[-1].trajectory.goal, model.home)


def test_no_key_points_are_an_empty_plan(planner: MotionPlanner) -> None:
    assert plan(planner, [], {}).moves == ()
