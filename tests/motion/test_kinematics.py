from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.geometry import rotation_angle
from maniagent.motion import ArmModel
from maniagent.motion.body import _signed_distance

MODEL = ArmModel()
SHARES = st.lists(st.floats(0.05, 0.95), min_size=6, max_size=6).map(np.array)


def posture(shares: np.ndarray) -> np.ndarray:
    return MODEL.lower + shares * (MODEL.upper - MODEL.lower)


def test_zero_posture_points_the_hand_forward_at_the_published_reach() -> None:
    T = MODEL.forward(np.zeros(6))
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(T[:3, 3], [0.04975 + 0.25 + 0.158575, 0.0, 0.36065], atol=1e-9)


@given(SHARES)
def test_jacobian_predicts_small_motions(shares: np.ndarray) -> None:
    q, step = posture(shares), 1e-6 * np.array([1.0, -2.0, 3.0, -1.0, 2.0, -3.0])
    before, after = MODEL.forward(q), MODEL.forward(q + step)
    twist = MODEL.jacobian(q) @ step
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], twist[:3], atol=1e-10)
    assert rotation_angle(after[:3, :3] @ before[:3, :3].T) == pytest.approx(np.linalg.norm(twist[3:]), abs=1e-9)


@given(st.floats(0.004, 0.048))
def test_opening_and_finger_position_are_inverse(opening: float) -> None:
    assert MODEL.opening(MODEL.finger_position(opening)) == pytest.approx(opening, abs=1e-12)


def test_openings_are_those_of_the_pads() -> None:
    assert MODEL.min_opening == pytest.approx(0.004)
    assert MODEL.max_opening == pytest.approx(0.048)


def test_covers_its_own_surface_and_nothing_far_away() -> None:
    on_the_arm = np.array([[0.0, 0.0, 0.03], MODEL.forward(MODEL.home)[:3, 3] - 0.1 * MODEL.forward(MODEL.home)[:3, 0]])
    elsewhere = np.array([[0.3, 0.0, 0.0], [0.0, 0.3, 0.1], [np.nan, 0.0, 0.03]])
    assert MODEL.covers(on_the_arm, MODEL.home, 0.048).all()
    assert not MODEL.covers(elsewhere, MODEL.home, 0.048, margin=0.02).any()


def test_covers_the_fingers_but_not_the_gap_between_them() -> None:
    T = MODEL.forward(MODEL.home)
    at_the_pads = T[:3, 3] + np.outer([-0.026, 0.0, 0.026], T[:3, 1])
    assert MODEL.covers(at_the_pads, MODEL.home, 0.048).tolist() == [True, False, True]


@given(SHARES, st.floats(0.0, 0.03))
def test_covers_agrees_with_a_test_of_every_point_against_every_shape(shares: np.ndarray, margin: float) -> None:
    q, rng = posture(shares), np.random.default_rng(0)
    tcp = MODEL.forward(q)[:3, 3]
    points = np.concatenate([rng.uniform(-0.3, 0.6, (150, 3)), rng.normal(tcp, 0.04, (150, 3))])
    data = mujoco.MjData(MODEL.mj_model)
    data.qpos[:6], data.qpos[6:8] = q, MODEL.finger_position(0.02)
    mujoco.mj_kinematics(MODEL.mj_model, data)
    distances = [
        _signed_distance(
            MODEL.mj_model.geom_type[geom],
            MODEL.mj_model.geom_size[geom],
            (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3),
        )
        for geom in range(MODEL.mj_model.ngeom)
    ]
    expected = np.min(distances, axis=0) <= margin
    np.testing.assert_array_equal(MODEL.covers(points, q, 0.02, margin), expected)


def test_distance_to_a_shape_the_arm_does_not_use_is_an_error() -> None:
    with pytest.raises(ValueError, match="mjGEOM_SPHERE"):
        _signed_distance(int(mujoco.mjtGeom.mjGEOM_SPHERE), np.ones(3), np.zeros((1, 3)))
