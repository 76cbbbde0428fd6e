"""Laws of rigid transforms and of the pinhole camera."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from maniagent.geometry import (
    FloatArray,
    backproject,
    invert_transform,
    look_at,
    make_transform,
    project,
    rotation_angle,
    rotation_z,
    top_down_rotation,
    transform_points,
    wrap_angle,
    yaw_of_top_down,
)

K = np.array([[607.0, 0.0, 319.5], [0.0, 605.0, 239.5], [0.0, 0.0, 1.0]])
coordinates = st.floats(-2.0, 2.0)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)
angles = st.floats(-20.0, 20.0)
unit_angles = st.floats(-np.pi, np.pi)


@st.composite
def transforms(draw: st.DrawFn) -> FloatArray:
    euler = [draw(unit_angles) for _ in range(3)]
    return make_transform(Rotation.from_euler("xyz", euler).as_matrix(), draw(points))


@given(transforms())
def test_a_transform_and_its_inverse_cancel(T_a_b: FloatArray) -> None:
    np.testing.assert_allclose(T_a_b @ invert_transform(T_a_b), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(invert_transform(T_a_b), np.linalg.inv(T_a_b), atol=1e-12)


@given(transforms(), transforms(), points)
def test_transforming_points_composes(T_a_b: FloatArray, T_b_c: FloatArray, point_c: FloatArray) -> None:
    step_by_step = transform_points(T_a_b, transform_points(T_b_c, point_c))
    np.testing.assert_allclose(transform_points(T_a_b @ T_b_c, point_c), step_by_step, atol=1e-12)


def test_points_keep_their_leading_shape() -> None:
    T = make_transform(rotation_z(0.3), [1.0, 2.0, 3.0])
    grid = np.random.default_rng(0).normal(size=(4, 5, 3))
    moved = transform_points(T, grid)
    assert moved.shape == grid.shape
    np.testing.assert_allclose(moved[2, 3], (T @ [*grid[2, 3], 1.0])[:3])


@given(angles, angles)
def test_rotations_about_z_add_up(a: float, b: float) -> None:
    np.testing.assert_allclose(rotation_z(a) @ rotation_z(b), rotation_z(a + b), atol=1e-12)


def test_yaw_turns_counter_clockwise_from_base_x() -> None:
    np.testing.assert_allclose(rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


@given(angles)
def test_a_top_down_gripper_approaches_downwards_and_closes_level(yaw: float) -> None:
    R = top_down_rotation(yaw)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 0], [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(R[:, 1], rotation_z(yaw) @ [0, 1, 0], atol=1e-12)


@given(unit_angles)
def test_the_yaw_of_a_top_down_gripper_is_read_back(yaw: float) -> None:
    assert abs(wrap_angle(yaw_of_top_down(top_down_rotation(yaw)) - yaw)) < 1e-9


@given(angles, st.sampled_from([np.pi, 2 * np.pi, 0.5]))
def test_wrapping_shifts_by_whole_periods_into_one_period(angle: float, period: float) -> None:
    wrapped = wrap_angle(angle, period)
    assert -period / 2 < wrapped <= period / 2
    shifts = (angle - wrapped) / period
    assert shifts == pytest.approx(round(shifts), abs=1e-9)


def test_half_a_period_wraps_to_its_positive_end() -> None:
    assert wrap_angle(-np.pi) == wrap_angle(np.pi) == np.pi
    assert wrap_angle(-np.pi / 2, np.pi) == np.pi / 2


@given(st.floats(0.0, np.pi), points)
def test_the_angle_of_a_rotation_is_that_of_its_rotation_vector(angle: float, axis: FloatArray) -> None:
    assume(np.linalg.norm(axis) > 1e-3)
    R = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    # Near half a turn both sine and trace are flat: half the digits are lost there.
    assert rotation_angle(R) == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-6])
def test_tiny_rotations_keep_their_angle(angle: float) -> None:
    assert rotation_angle(rotation_z(angle)) == pytest.approx(angle, rel=1e-9)


@given(points, points)
def test_a_camera_looks_at_its_target_upright(eye: FloatArray, target: FloatArray) -> None:
    assume(np.linalg.norm((target - eye)[:2]) > 1e-3)
    T_base_camera = look_at(eye, target)
    R = T_base_camera[:3, :3]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    right, down, _ = R.T
    assert right[2] == pytest.approx(0.0, abs=1e-12)
    assert down[2] < 0.0
    target_camera = transform_points(invert_transform(T_base_camera), target)
    np.testing.assert_allclose(target_camera, [0.0, 0.0, float(np.linalg.norm(target - eye))], atol=1e-9)
    np.testing.assert_allclose(project(K, target_camera), K[:2, 2], atol=1e-3)


@pytest.mark.parametrize("target", [(0.1, 0.2, 0.0), (0.1, 0.2, 5.0), (0.1, 0.2, 0.5)], ids=["down", "up", "itself"])
def test_a_camera_that_can_not_be_upright_is_refused(target: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="not vertical"):
        look_at((0.1, 0.2, 0.5), target)


def test_whole_numbers_will_do_to_look_at() -> None:
    np.testing.assert_allclose(look_at((1, 0, 0), (0, 0, 0))[:3, 2], [-1, 0, 0])


@given(st.floats(0.1, 5.0), st.integers(0, 39), st.integers(0, 29))
def test_projecting_a_backprojected_pixel_returns_to_it(z: float, u: int, v: int) -> None:
    small = K.copy()
    small[:2] /= 16
    cloud = backproject(small, np.full((30, 40), z, np.float32))
    assert cloud[v, u, 2] == np.float32(z)
    np.testing.assert_allclose(project(small, cloud[v, u].astype(float)), [u, v], atol=1e-4)


@given(points)
def test_points_in_front_of_the_camera_are_seen_where_the_pinhole_equation_says(point: FloatArray) -> None:
    point = point + np.array([0.0, 0.0, 2.5])
    u, v, w = K @ point
    np.testing.assert_allclose(project(K, point), [u / w, v / w], rtol=1e-12)


def test_unknown_depth_stays_unknown() -> None:
    depth = np.array([[1.0, np.nan]], np.float32)
    cloud = backproject(K, depth)
    assert np.isfinite(cloud[0, 0]).all()
    assert np.isnan(cloud[0, 1]).all()
