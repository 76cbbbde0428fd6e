"""States and actions as Bridge has them: laws of the conversion, and the gripper."""

from __future__ import annotations

from typing import Any

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_collected import CLOSED, OPEN
from scipy.spatial.transform import Rotation

from maniagent.data.recording import to_deltas, to_poses
from maniagent.data.rlds.conventions import Fingers, Moves, gripper_commands, to_moves, to_rpy_poses
from maniagent.geometry import FloatArray, make_transform, top_down_rotation

FINGERS = Fingers(CLOSED, OPEN)
Targets = list[float]


@st.composite
def paths(draw: Any) -> FloatArray:
    """(N + 1, 4, 4) poses, each a step of up to 0.4 rad about any axis, and 10 cm, from the one before."""
    steps = draw(hnp.arrays(float, st.tuples(st.integers(1, 12), st.just(6)), elements=st.floats(-0.2, 0.2)))
    start = make_transform(top_down_rotation(draw(st.floats(-3.0, 3.0))), [0.25, 0.0, 0.1])
    poses = [start]
    for step in steps:
        turn = Rotation.from_rotvec(step[3:]).as_matrix()
        poses.append(make_transform(turn @ poses[-1][:3, :3], poses[-1][:3, 3] + 0.5 * step[:3]))
    return np.stack(poses)


def converted(path: FloatArray, every: int = 1) -> Moves:
    length = len(path) - 1
    delta = np.hstack([to_deltas(path), np.full((length, 1), OPEN)])
    return to_moves(np.full((length, 7), OPEN), to_poses(path[:-1]), delta, FINGERS, every)


def follow(first: FloatArray, action: FloatArray) -> FloatArray:
    """(N + 1, 4, 4): where a robot gets that obeys the actions, written down as docs/rlds.md says it."""
    poses = [first]
    for x, y, z, roll, pitch, yaw, _ in action.astype(float):
        turn = Rotation.from_euler("z", yaw) * Rotation.from_euler("y", pitch) * Rotation.from_euler("x", roll)
        poses.append(make_transform(turn.as_matrix() @ poses[-1][:3, :3], poses[-1][:3, 3] + [x, y, z]))
    return np.stack(poses)


@given(paths(), st.integers(1, 4))
def test_actions_lead_along_the_commanded_path(path: FloatArray, every: int) -> None:
    moves = converted(path, every)
    wanted = path[[*range(0, len(path) - 1, every), len(path) - 1]]
    np.testing.assert_allclose(follow(path[0], moves.action), wanted, atol=1e-5)


@given(paths())
def test_a_state_says_where_the_hand_is(path: FloatArray) -> None:
    state = converted(path).state.astype(float)
    rotations = Rotation.from_euler("xyz", state[:, 3:6]) * Rotation.from_matrix(top_down_rotation(0.0))
    np.testing.assert_allclose(state[:, :3], path[:-1, :3, 3], atol=1e-6)
    np.testing.assert_allclose(rotations.as_matrix(), path[:-1, :3, :3], atol=1e-5)


@given(st.floats(-3.1, 3.1))
def test_a_hand_that_points_down_has_only_a_yaw(yaw: float) -> None:
    pose = to_poses(make_transform(top_down_rotation(yaw), np.zeros(3))[None])
    np.testing.assert_allclose(to_rpy_poses(pose), [[0, 0, 0, 0, 0, yaw]], atol=1e-9)


def test_every_second_frame_has_half_the_steps_and_its_own_state() -> None:
    path = np.stack([make_transform(top_down_rotation(0.0), [0.01 * i, 0, 0]) for i in range(8)])
    moves = converted(path, every=2)
    np.testing.assert_allclose(moves.state[:, 0], [0.0, 0.02, 0.04, 0.06], atol=1e-7)
    np.testing.assert_allclose(moves.action[:, 0], [0.02, 0.02, 0.02, 0.01], atol=1e-7)
    assert (moves.action.dtype, moves.state.dtype, moves.joint_state.shape) == (np.float32, np.float32, (4, 6))


@pytest.mark.parametrize(
    ("targets", "commands"),
    [
        ([0.048, 0.048, 0.04, 0.02, 0.004, 0.004, 0.027, 0.046, 0.048], [1, 1, 0, 0, 0, 0, 1, 1, 1]),
        ([0.048, 0.03, 0.03, 0.015, 0.004], [1, 1, 1, 0, 0]),  # opened just wide enough for the grasp
        ([0.004, 0.004], [0, 0]),
        ([0.048], [1]),
        ([0.048, 0.03], [1, 1]),  # where it leads isn't known
    ],
    ids=["grasp and let go", "half open", "always closed", "one row", "cut off"],
)
def test_the_gripper_is_told_to_open_or_to_close(targets: Targets, commands: Targets) -> None:
    assert gripper_commands(np.array(targets), FINGERS).tolist() == commands


@given(hnp.arrays(float, st.integers(1, 30), elements=st.floats(0.0, 0.06)))
def test_a_gripper_command_is_nothing_but_0_or_1(targets: FloatArray) -> None:
    commands = gripper_commands(targets, FINGERS)
    assert commands.shape == targets.shape
    assert set(commands.tolist()) <= {0.0, 1.0}


def test_openness_goes_from_closed_to_open() -> None:
    np.testing.assert_allclose(FINGERS.openness(np.array([0.0, CLOSED, 0.026, OPEN, 0.06])), [0, 0, 0.5, 1, 1])
