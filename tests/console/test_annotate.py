import numpy as np
import pytest
import synthetic

from maniagent.console.annotate import PALETTE, colour_depth, draw_detections, jaw_segments
from maniagent.geometry import project, transform_points
from maniagent.types import Detection


def test_near_is_warm_far_is_cold_and_unknown_is_black() -> None:
    picture = colour_depth(np.array([[0.35, 1.45, np.nan, np.inf]], np.float32)).astype(int)
    near, far = picture[0, 0], picture[0, 1]
    assert near[0] > near[2]
    assert far[2] > far[0]
    assert not picture[0, 2:].any()


def test_the_jaw_spans_the_opening_with_its_fingertips_at_the_grasp() -> None:
    grasp = synthetic.grasp((0.3, 0.1, 0.05), yaw=0.7)
    left, right = jaw_segments(grasp)[2:, 1]
    assert np.linalg.norm(left - right) == pytest.approx(grasp.opening)
    assert (left + right) / 2 == pytest.approx((0.3, 0.1, 0.05))


def test_the_jaw_is_drawn_where_the_grasp_is() -> None:
    frame = synthetic.camera("main")
    carrot, _ = synthetic.objects()
    assert carrot.grasp is not None
    drawn = draw_detections(frame, (), (carrot,))
    changed = np.argwhere((drawn != frame.rgb).any(axis=-1))
    expected = project(frame.K, transform_points(frame.T_camera_base, jaw_segments(carrot.grasp))).reshape(-1, 2)
    assert changed.min(axis=0)[::-1] == pytest.approx(expected.min(axis=0), abs=4)
    assert changed.max(axis=0)[::-1] == pytest.approx(expected.max(axis=0), abs=4)


def test_only_detections_of_this_view_are_drawn() -> None:
    frame = synthetic.camera("main")
    elsewhere = Detection("carrot", (10, 10, 50, 50), 0.9, "side")
    assert np.array_equal(draw_detections(frame, (elsewhere,)), frame.rgb)


def test_a_mask_is_tinted_in_its_colour() -> None:
    frame = synthetic.camera("main")
    found = synthetic.detection(frame, "carrot", synthetic.CARROT, (0.06, 0.016), 0.9)
    assert found.mask is not None
    towards = np.array(PALETTE[0]) - frame.rgb[found.mask].mean(axis=0)
    change = draw_detections(frame, (found,))[found.mask].mean(axis=0) - frame.rgb[found.mask].mean(axis=0)
    assert towards @ change > 0


@pytest.mark.parametrize("box", [(-50, -50, 10, 10), (630, 470, 900, 900), (5, 5, 5, 5)])
def test_boxes_beyond_the_picture_do_no_harm(box: tuple[float, float, float, float]) -> None:
    frame = synthetic.camera("main")
    drawn = draw_detections(frame, (Detection("x" * 200, box, 1.0, "main"),), ())
    assert drawn.shape == frame.rgb.shape
