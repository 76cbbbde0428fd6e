"""Left and right as the person sees them who looks at the main view."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniagent.envs.cameras import MAIN_CAMERA
from maniagent.geometry import look_at, project, transform_points
from maniagent.perception.viewpoint import Viewpoint
from maniagent.testing import made_observation
from maniagent.types import CameraFrame

TARGET = np.array([0.25, 0.0, 0.0])


@given(st.floats(-np.pi, np.pi), st.floats(0.2, 1.2))
def test_right_goes_right_in_the_image_and_away_goes_up(azimuth: float, height: float) -> None:
    eye = TARGET + np.array([0.6 * np.cos(azimuth), 0.6 * np.sin(azimuth), height])
    T_base_camera = look_at(eye, TARGET)
    viewpoint = Viewpoint.from_camera(T_base_camera)
    frame = CameraFrame("main", np.zeros((2, 2, 3)), np.ones((2, 2)), MAIN_CAMERA.K, T_base_camera)
    steps = 0.05 * np.array([[0.0, 0.0], viewpoint.right, viewpoint.away])
    middle, right, away = project(
        frame.K, transform_points(frame.T_camera_base, np.column_stack([steps, np.zeros(3)]) + TARGET)
    )
    assert right[0] > middle[0]
    assert right[1] == pytest.approx(middle[1], abs=1e-6)
    assert away[1] < middle[1]
    assert away[0] == pytest.approx(middle[0], abs=1e-6)


@given(st.floats(-np.pi, np.pi))
def test_the_two_directions_are_unit_vectors_at_right_angles(azimuth: float) -> None:
    eye = TARGET + np.array([np.cos(azimuth), np.sin(azimuth), 0.7])
    viewpoint = Viewpoint.from_camera(look_at(eye, TARGET))
    axes = np.stack([viewpoint.right, viewpoint.away])
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-9)


def test_it_is_the_main_view_that_counts() -> None:
    viewpoint = Viewpoint.of(made_observation(eye=(0.25, -0.6, 0.5)))
    np.testing.assert_allclose(viewpoint.right, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(viewpoint.away, [0.0, 1.0], atol=1e-9)


def test_a_camera_on_its_side_has_no_left() -> None:
    T = look_at([1.5, 0.0, 0.3], TARGET)
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    T[:3, :3] = T[:3, :3] @ quarter_turn
    with pytest.raises(ValueError, match="not upright"):
        Viewpoint.from_camera(T)
