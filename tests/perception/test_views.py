"""The foreground of one view: what stands on the table, in the base frame, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from maniagent.envs.cameras import MAIN_CAMERA, SIDE_CAMERA, CameraSpec
from maniagent.errors import CameraFailure
from maniagent.geometry import FloatArray, backproject, look_at, make_transform, transform_points
from maniagent.perception.views import Tuning, ViewPoints, Workspace, foreground
from maniagent.types import BoolArray, CameraFrame, Observation, RobotState

TABLE = (176, 166, 148)
STATE = RobotState(np.zeros(6), np.eye(4), 0.03, 0.0)
BOX = np.array([[0.25, -0.02, 0.0], [0.29, 0.04, 0.05]])
"""Lowest and highest corner, m."""


def nothing(points: NDArray[np.float32], state: RobotState) -> BoolArray:
    """A robot out of sight."""
    return np.zeros(len(points), bool)


def shot(
    camera: CameraSpec = MAIN_CAMERA,
    box: FloatArray | None = BOX,
    colour: tuple[int, int, int] = (190, 30, 30),
    table_z: float = 0.0,
) -> CameraFrame:
    """A noiseless picture of an axis-aligned box on an endless table, by intersecting every pixel's ray."""
    K, T = camera.K, camera.T_base_camera
    rays = backproject(K, np.ones((camera.height, camera.width), np.float32)) @ T[:3, :3].T
    depth = (table_z - T[2, 3]) / rays[..., 2]
    rgb = np.full((*depth.shape, 3), TABLE, np.uint8)
    if box is not None:
        slabs = np.sort((box[:, None, None, :] - T[:3, 3]) / rays, axis=0)  # entry and exit, axis by axis
        entry, leave = slabs[0].max(axis=-1), slabs[1].min(axis=-1)
        hit = (entry < leave) & (entry < depth)
        depth[hit], rgb[hit] = entry[hit], colour
    return CameraFrame(camera.name, rgb, depth.astype(np.float32), K, T)


def inside(points: FloatArray, box: FloatArray, margin: float = 0.006) -> float:
    """Share of the points (N, 3) that lie in a box, give or take a margin."""
    return float(((points > box[0] - margin) & (points < box[1] + margin)).all(axis=1).mean())


def observe(*frames: CameraFrame) -> Observation:
    return Observation({frame.name: frame for frame in frames}, frames[0].name, STATE)


def see(*frames: CameraFrame, **tuning: float) -> tuple[ViewPoints, ...]:
    return foreground(observe(*frames), nothing, Workspace(), Tuning(**tuning))


def test_the_foreground_is_the_box_and_lies_where_it_is() -> None:
    for view in see(shot(), shot(SIDE_CAMERA)):
        assert len(view.points) > 1000
        assert inside(view.points, BOX) > 0.97  # colours bleed into a pixel of the table behind
        assert (np.abs(view.colours.astype(int) - (190, 30, 30)).max(axis=1) < 5).mean() > 0.9


def test_points_pixels_and_colours_go_together() -> None:
    frame = shot()
    (view,) = see(frame)
    assert view.name == "main"
    assert view.shape == frame.depth.shape
    np.testing.assert_array_equal(view.colours, frame.rgb.reshape(-1, 3)[view.pixels])
    expected = transform_points(frame.T_base_camera, backproject(frame.K, frame.depth)).reshape(-1, 3)[view.pixels]
    assert np.median(np.abs(view.points - expected)) < 1e-4


def test_an_empty_table_has_no_foreground() -> None:
    (view,) = see(shot(box=None))
    assert len(view.points) == 0


def test_a_flat_thing_is_seen_by_its_colour_alone() -> None:
    cloth = np.array([[0.2, -0.08, 0.0], [0.32, 0.04, 0.003]])
    (red,) = see(shot(box=cloth))
    assert np.ptp(red.points[:, 0]) == pytest.approx(0.12, abs=0.006)
    (plain,) = see(shot(box=cloth, colour=TABLE))
    assert len(plain.points) == 0


def test_exact_depth_sees_the_foot_of_a_thing_and_no_film_beside_it() -> None:
    """A wedge that starts flat: its foot counts where something high is connected to it."""
    frame = shot(box=np.array([[0.25, -0.02, 0.0], [0.29, 0.04, 0.02]]))
    foot = shot(box=np.array([[0.25, 0.04, 0.0], [0.29, 0.06, 0.002]])).depth
    film = shot(box=np.array([[0.25, -0.10, 0.0], [0.29, -0.06, 0.002]])).depth
    frame = replace(frame, depth=np.minimum(frame.depth, np.minimum(foot, film)), rgb=np.full_like(frame.rgb, 128))
    only_height = {"height": 0.003, "chroma": np.inf, "brighter": np.inf, "darker": 0.0}
    (plain,), (exact,) = see(frame, **only_height), see(frame, **only_height, foot=0.0015)
    assert plain.points[:, 1].max() == pytest.approx(0.04, abs=0.003)
    assert exact.points[:, 1].max() == pytest.approx(0.06, abs=0.003)
    assert exact.points[:, 1].min() == pytest.approx(-0.02, abs=0.003), "the film stays table"


@pytest.mark.parametrize("light", [0.5, 0.75, 1.2])
def test_a_shadow_is_no_thing(light: float) -> None:
    shaded = np.array([[0.2, -0.08, 0.0], [0.32, 0.04, 1e-4]])
    (view,) = see(shot(box=shaded, colour=tuple(int(light * channel) for channel in TABLE)))
    assert len(view.points) == 0


def test_a_black_and_a_white_cloth_are_things() -> None:
    cloth = np.array([[0.2, -0.08, 0.0], [0.32, 0.04, 1e-4]])
    for colour in ((25, 24, 22), (250, 250, 250)):
        (view,) = see(shot(box=cloth, colour=colour))
        assert len(view.points) > 1000


@pytest.mark.parametrize("table_z", [-0.006, 0.006])
def test_heights_count_from_the_table_that_is_seen(table_z: float) -> None:
    box = BOX + np.array([0.0, 0.0, table_z])
    (view,) = see(shot(box=box, table_z=table_z))
    assert np.percentile(view.points[:, 2], 99) == pytest.approx(0.05, abs=0.002)
    assert (view.points[:, 2] > -0.002).all()


def test_what_is_outside_the_workspace_is_left_out() -> None:
    (view,) = see(shot(box=BOX + np.array([0.3, 0.0, 0.0])))
    assert len(view.points) == 0


def test_the_robots_own_points_are_left_out() -> None:
    observation = observe(shot())
    (view,) = foreground(observation, lambda points, state: points[:, 1] > 0.0, Workspace(), Tuning())
    assert len(view.points) > 500
    assert (view.points[:, 1] <= 0.0).all()


def test_scattered_holes_in_the_depth_leave_holes_and_nothing_else() -> None:
    frame = shot()
    depth = np.array(frame.depth)
    depth[np.random.default_rng(0).random(depth.shape) < 0.1] = np.nan
    (whole,), (holed,) = see(frame), see(replace(frame, depth=depth))
    assert set(holed.pixels) <= set(np.flatnonzero(np.isfinite(depth)))
    assert len(holed.points) > 0.8 * len(whole.points)
    assert np.isfinite(holed.points).all()
    assert inside(holed.points, BOX) > 0.97


# Cameras of no use ----------------------------------------------------------------------------------------------------


def blocked(frame: CameraFrame, share: float) -> CameraFrame:
    """The frame with no depth in so much of its upper part."""
    depth = np.array(frame.depth)
    depth[: round(share * len(depth))] = np.nan
    return replace(frame, depth=depth)


def test_a_half_blocked_view_is_still_of_use() -> None:
    assert len(see(blocked(shot(), 0.4))) == 1


def test_a_blocked_main_view_is_a_failure_that_says_so() -> None:
    with pytest.raises(CameraFailure, match=r"main camera has depth on only \d+% of the table"):
        see(blocked(shot(), 0.95))


def test_a_blocked_side_view_is_left_out() -> None:
    assert [view.name for view in see(shot(), blocked(shot(SIDE_CAMERA), 0.95))] == ["main"]


def test_a_hand_before_the_lens_is_a_failure() -> None:
    frame = shot()
    with pytest.raises(CameraFailure, match="main camera"):
        see(replace(frame, depth=np.full(frame.depth.shape, 0.15, np.float32)))


def test_a_calibration_that_puts_the_table_behind_the_camera_is_a_failure() -> None:
    frame = shot()
    away = look_at([0.68, 0.0, 0.62], [1.1, 0.0, 0.9])
    with pytest.raises(CameraFailure, match="main camera"):
        see(replace(frame, T_base_camera=away))


def test_a_table_at_another_height_than_the_calibrations_is_a_failure() -> None:
    frame = shot(box=None)
    lifted = make_transform(np.eye(3), [0.0, 0.0, 0.06]) @ frame.T_base_camera
    with pytest.raises(CameraFailure, match="sees no table"):
        see(replace(frame, T_base_camera=lifted))


def test_a_smaller_picture_is_as_good() -> None:
    frame = shot()
    half = replace(
        frame,
        rgb=cv2.resize(frame.rgb, (320, 240), interpolation=cv2.INTER_AREA),
        depth=frame.depth[::2, ::2],
        K=frame.K * [[0.5], [0.5], [1.0]],
    )
    (view,) = see(half)
    assert len(view.points) > 300
    assert inside(view.points, BOX) > 0.94
