"""The cameras' geometry, and noise that has the statistics it claims (against pictures: test_tabletop.py)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from maniagent.envs.cameras import MAIN_CAMERA, SIDE_CAMERA, CameraSpec, DepthNoise
from maniagent.geometry import invert_transform, project, transform_points

F = MAIN_CAMERA.focal_length
QUIET = DepthNoise(dropout=0.0)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def plane(z: float, shape: tuple[int, int] = (240, 320)) -> NDArray[np.float32]:
    return np.full(shape, z, np.float32)


# Geometry -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", [MAIN_CAMERA, SIDE_CAMERA], ids=lambda camera: camera.name)
def test_the_target_is_in_the_middle_of_the_picture(camera: CameraSpec) -> None:
    target_camera = transform_points(invert_transform(camera.T_base_camera), np.array(camera.target))
    np.testing.assert_allclose(project(camera.K, target_camera), [319.5, 239.5], atol=1e-6)


def test_the_viewer_sees_base_y_to_the_right_and_the_robot_far_away() -> None:
    T_camera_base = invert_transform(MAIN_CAMERA.T_base_camera)
    (u, v), (u_left, _), (_, v_far) = (
        project(MAIN_CAMERA.K, transform_points(T_camera_base, np.array(point)))
        for point in ([0.3, 0.0, 0.0], [0.3, 0.1, 0.0], [0.2, 0.0, 0.0])
    )
    assert u_left > u
    assert v_far < v


def test_the_field_of_view_ends_half_a_pixel_beyond_the_last_one() -> None:
    camera = CameraSpec("c", (1, 0, 1), (0, 0, 0), focal_length=50.0, width=40, height=30)
    y = np.tan(np.radians(camera.fovy) / 2)
    np.testing.assert_allclose(project(camera.K, np.array([0.0, y, 1.0])), [19.5, 29.5])


# Depth --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("z", [0.4, 0.8, 1.6])
def test_depth_error_has_the_rms_of_a_stereo_pair(z: float) -> None:
    error = QUIET.depth(plane(z), F, rng()) - z
    expected = z**2 * QUIET.subpixel / (F * QUIET.baseline)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(expected, rel=0.05)
    assert abs(error.mean()) < expected / 10


def test_twice_the_distance_makes_four_times_the_error() -> None:
    near, far = ((QUIET.depth(plane(z), F, rng()) - z).std() for z in (0.5, 1.0))
    assert far / near == pytest.approx(4.0, rel=0.02)


def test_errors_of_neighbours_are_alike_and_of_strangers_are_not() -> None:
    error = QUIET.depth(plane(0.7), F, rng()) - 0.7

    def correlation(distance: int) -> float:
        return float(np.corrcoef(error[:, :-distance].ravel(), error[:, distance:].ravel())[0, 1])

    assert correlation(1) > 0.7
    assert abs(correlation(10)) < 0.05


def test_nothing_returns_from_out_of_range() -> None:
    clean = plane(0.5)
    clean[:, 100:200] = 0.27
    clean[:, 200:] = 3.1
    noisy = QUIET.depth(clean, F, rng())
    assert np.isfinite(noisy[:, :99]).all()
    assert np.isnan(noisy[:, 100:]).all()


def test_a_step_in_depth_loses_the_pixels_beside_it_and_a_ripple_none() -> None:
    step, ripple = plane(0.5), plane(0.5)
    step[:, 100:] += QUIET.edge_step + 0.001
    ripple[:, 100:] += QUIET.edge_step - 0.001
    (lost,) = np.nonzero(np.isnan(QUIET.depth(step, F, rng())).all(axis=0))
    assert lost.tolist() == [99, 100]
    assert np.isfinite(QUIET.depth(ripple, F, rng())).all()


def test_the_share_of_spots_without_return_is_as_stated() -> None:
    noise = DepthNoise(dropout=0.01)
    lost = np.isnan(noise.depth(plane(0.5, (480, 640)), F, rng()))
    assert lost.mean() == pytest.approx(0.01, rel=0.1)


def test_noise_is_drawn_from_the_given_generator_alone() -> None:
    first, again, other = (DepthNoise().depth(plane(0.6), F, rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other, equal_nan=True)
    assert first.dtype == np.float32


def test_the_clean_images_stay_clean() -> None:
    depth, grey = plane(0.5), np.full((20, 20, 3), 128, np.uint8)
    DepthNoise().depth(depth, F, rng())
    DepthNoise().colour(grey, rng())
    assert (depth == np.float32(0.5)).all()
    assert (grey == 128).all()


# Colour -------------------------------------------------------------------------------------------------------------


def test_colour_noise_is_unbiased_and_as_strong_as_stated() -> None:
    error = DepthNoise(colour_sigma=3.0).colour(np.full((200, 200, 3), 128, np.uint8), rng()) - 128.0
    assert abs(error.mean()) < 0.05
    assert error.std() == pytest.approx(3.0, rel=0.03)


def test_black_and_white_do_not_wrap_around() -> None:
    for value in (0, 255):
        noisy = DepthNoise(colour_sigma=5.0).colour(np.full((50, 50, 3), value, np.uint8), rng()).astype(int)
        assert np.abs(noisy - value).max() < 40


def test_the_lens_softens_an_edge_unless_it_has_no_blur() -> None:
    edge = np.zeros((10, 20, 3), np.uint8)
    edge[:, 10:] = 200
    blurred = DepthNoise(colour_sigma=0.0).colour(edge, rng())
    assert 0 < blurred[5, 9, 0] < 100 < blurred[5, 10, 0] < 200
    np.testing.assert_array_equal(DepthNoise(colour_sigma=0.0, blur=0.0).colour(edge, rng()), edge)
