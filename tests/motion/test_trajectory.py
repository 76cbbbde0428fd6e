from __future__ import annotations

import numpy as np
import pytest
from arms import top_down
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.errors import MotionRejected
from maniagent.motion import ArmModel, IKSolver, MotionLimits
from maniagent.motion.path import joint_line, tcp_line
from maniagent.motion.trajectory import JointTrajectory, chain, time_path

MODEL = ArmModel()
SOLVER = IKSolver(MODEL)
LIMITS = MotionLimits()
SPOTS = st.tuples(st.floats(0.2, 0.36), st.floats(-0.2, 0.2), st.floats(0.02, 0.2), st.floats(-1.0, 1.0))


def tcp_track(trajectory: JointTrajectory, dt: float = 0.005) -> np.ndarray:
    times = np.arange(0.0, trajectory.duration + dt, dt)
    return np.array([MODEL.forward(trajectory.sample(t))[:3, 3] for t in times])


@settings(max_examples=30)
@given(SPOTS, SPOTS)
def test_tcp_lines_are_straight_and_end_at_the_pose(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    start = SOLVER.solve(top_down(*a), MODEL.home)
    path = tcp_line(SOLVER, start, top_down(*b))
    positions = np.array([MODEL.forward(q)[:3, 3] for q in path.at(np.linspace(0, 1, 41))])
    ends = positions[[0, -1]]
    along = np.clip(np.linspace(0, 1, 41), 0, 1)[:, None]
    straight = (1 - along) * ends[0] + along * ends[1]
    assert np.linalg.norm(positions - straight, axis=1).max() < 5e-4
    np.testing.assert_allclose(MODEL.forward(path.positions[-1]), top_down(*b), atol=2e-3)


@settings(max_examples=30)
@given(SPOTS, SPOTS)
def test_timing_keeps_every_limit(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    start = SOLVER.solve(top_down(*a), MODEL.home)
    trajectory = time_path(tcp_line(SOLVER, start, top_down(*b)), MODEL, LIMITS)
    dt = 0.005
    q = np.array([trajectory.sample(t) for t in np.arange(0.0, trajectory.duration + dt, dt)])
    velocity = np.diff(q, axis=0) / dt
    assert np.abs(velocity).max(initial=0.0) <= 1.01 * LIMITS.joint_speed_share * MODEL.velocity_limit[0]
    assert np.abs(np.diff(velocity, axis=0) / dt).max(initial=0.0) <= 1.1 * LIMITS.joint_acceleration
    speed = np.linalg.norm(np.diff(tcp_track(trajectory, dt), axis=0), axis=1) / dt
    assert speed.max(initial=0.0) <= 1.01 * LIMITS.tcp_speed


def test_long_line_uses_most_of_the_speed_it_may() -> None:
    start = SOLVER.solve(top_down(0.3, -0.25, 0.15), MODEL.home)
    trajectory = time_path(tcp_line(SOLVER, start, top_down(0.3, 0.25, 0.15)), MODEL, LIMITS)
    speed = np.linalg.norm(np.diff(tcp_track(trajectory), axis=0), axis=1) / 0.005
    assert speed.max() > 0.9 * LIMITS.tcp_speed


def test_starts_and_ends_at_rest_where_the_path_does() -> None:
    goal = MODEL.home + np.array([0.5, 0.3, -0.2, 0.4, 0.1, -1.0])
    trajectory = time_path(joint_line(MODEL.home, goal), MODEL, LIMITS)
    np.testing.assert_allclose(trajectory.velocities[[0, -1]], 0.0, atol=1e-6)
    np.testing.assert_allclose(trajectory.sample(-1.0), MODEL.home)
    np.testing.assert_allclose(trajectory.sample(trajectory.duration + 1.0), goal, atol=1e-9)


def test_standing_still_takes_no_time() -> None:
    trajectory = time_path(joint_line(MODEL.home, MODEL.home), MODEL, LIMITS)
    assert trajectory.duration == 0.0
    np.testing.assert_array_equal(trajectory.sample(0.0), MODEL.home)


def test_chained_trajectories_pass_through_the_corner() -> None:
    corner, end = MODEL.home + 0.2, MODEL.home + np.array([0.2, 0.2, 0.2, 0.2, 0.2, 0.5])
    first = time_path(joint_line(MODEL.home, corner), MODEL, LIMITS)
    both = chain([first, time_path(joint_line(corner, end), MODEL, LIMITS)])
    np.testing.assert_allclose(both.sample(first.duration), corner, atol=1e-9)
    np.testing.assert_allclose(both.goal, end, atol=1e-9)
    assert np.all(np.diff(both.times) > 0)


def test_trajectories_are_read_only() -> None:
    trajectory = time_path(joint_line(MODEL.home, MODEL.home + 0.1), MODEL, LIMITS)
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions[0] = 0.0


def test_line_through_the_shoulder_is_refused() -> None:
    start = SOLVER.solve(top_down(0.1, 0.25, 0.2), MODEL.home)
    with pytest.raises(MotionRejected):
        tcp_line(SOLVER, start, top_down(-0.1, -0.25, 0.2))
