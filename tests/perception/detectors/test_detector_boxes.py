"""A box says which thing is meant; where the thing is, depth says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tables import Look, arrange, block

from maniagent.geometry import backproject, project, transform_points
from maniagent.perception.detectors.boxes import clip_box, cut_segment, find_segment, match_boxes
from maniagent.perception.detectors.protocol import Box, box_of
from maniagent.types import CameraFrame

NEAR = 0.012
"""m, horizontally, between the true middle and that of what a single view shows of a thing."""


@pytest.fixture(scope="module")
def seen() -> Look:
    return arrange(
        {
            "dish": ("dish", 0.26, 0.13, 0.0),
            "tower": (block("blue", (0.04, 0.04, 0.07)), 0.22, -0.14, 10.0),
            "carrot": ("carrot", 0.33, -0.02, 60.0),
            "egg": ("egg", 0.17, 0.03, 0.0),
        }
    )


def frame_of(seen: Look) -> CameraFrame:
    return seen.observation.main_frame


def box_around(seen: Look, name: str) -> Box:
    return box_of(seen.segment_of(name).masks["main"])


def off_truth(seen: Look, name: str, xy: np.ndarray) -> float:
    return float(np.linalg.norm(xy - seen.truth[name].T_base_object[:2, 3]))


def at_box_centre(seen: Look, box: Box) -> np.ndarray:
    """(3,) m, base frame: what the pixel in the middle of a box shows."""
    frame = frame_of(seen)
    points = transform_points(frame.T_base_camera, backproject(frame.K, frame.depth))
    return points[round((box[1] + box[3]) / 2), round((box[0] + box[2]) / 2)]


# Which segment a box shows ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dish", "tower", "carrot", "egg"])
@pytest.mark.parametrize("shift", [(0, 0), (6, 0), (-4, 5), (0, -6)])
def test_a_box_around_a_segment_gives_that_segment_though_the_box_is_a_little_off(seen, name, shift):
    left, top, right, bottom = box_around(seen, name)
    box = (left + shift[0], top + shift[1], right + shift[0], bottom + shift[1])
    assert find_segment(box, seen.view, frame_of(seen)) is seen.segment_of(name)


def test_a_loose_box_gives_the_known_segment_inside_it(seen):
    left, top, right, bottom = box_around(seen, "egg")
    loose = (left - 15, top - 15, right + 15, bottom + 15)
    assert find_segment(loose, seen.view, frame_of(seen)) is seen.segment_of("egg")


def test_a_thing_that_segmentation_joined_with_another_is_cut_out(seen):
    egg, carrot = seen.segment_of("egg"), seen.segment_of("carrot")
    both = replace(
        egg,
        points=np.concatenate([egg.points, carrot.points]),
        colours=np.concatenate([egg.colours, carrot.colours]),
        masks={"main": egg.masks["main"] | carrot.masks["main"]},
    )
    found = find_segment(box_around(seen, "egg"), replace(seen.view, segments=(both,)), frame_of(seen))
    assert found is not None
    assert found is not both
    assert off_truth(seen, "egg", found.centre[:2]) < NEAR


# Where the middle of a box misleads -------------------------------------------------------------------------------


def test_of_a_hollow_thing_the_middle_is_found_though_the_box_centre_shows_its_hollow(seen):
    box = box_around(seen, "dish")
    found = cut_segment(box, frame_of(seen))
    assert found is not None
    assert off_truth(seen, "dish", found.centre[:2]) < NEAR
    # The hollow belongs to it: what is put into the dish doesn't come to rest on the rim's height.
    assert found.surface_z < found.top_z - 0.008


def test_a_box_centre_on_the_side_is_moved_to_the_thing_itself(seen):
    box = box_around(seen, "tower")
    side = at_box_centre(seen, box)
    found = cut_segment(box, frame_of(seen))
    assert found is not None
    assert off_truth(seen, "tower", found.centre[:2]) < min(NEAR, off_truth(seen, "tower", side[:2]))
    assert found.top_z == pytest.approx(0.07, abs=0.006)


def test_a_box_centre_on_the_background_is_moved_to_the_thing_beside_it(seen):
    left, top, right, bottom = box_around(seen, "carrot")
    box = (left, top, right + 1.2 * (right - left), bottom)  # far too wide: its centre is on the table
    assert abs(at_box_centre(seen, box)[2]) < 0.006
    found = cut_segment(box, frame_of(seen))
    assert found is not None
    assert off_truth(seen, "carrot", found.centre[:2]) < NEAR


def test_what_is_only_a_picture_on_the_table_is_no_thing(seen):
    frame = frame_of(seen)
    corners = np.array([[0.15, -0.22, 0.0], [0.2, -0.26, 0.0]])
    (u0, v0), (u1, v1) = project(frame.K, transform_points(frame.T_camera_base, corners))
    left, top, right, bottom = min(u0, u1), min(v0, v1), max(u0, u1), max(v0, v1)
    rgb = np.array(frame.rgb)
    rgb[int(top) : int(bottom), int(left) : int(right)] = (250, 30, 30)
    photo = replace(frame, rgb=rgb)
    assert match_boxes("red card", [((left, top, right, bottom), 0.9)], seen.view, photo) == ()


def test_a_small_thing_on_a_large_one_and_the_large_one_are_told_apart(seen):
    large, small = np.zeros((480, 640), bool), np.zeros((480, 640), bool)
    large[100:200, 300:420] = True
    small[130:160, 340:370] = True
    large &= ~small
    plate = replace(seen.segment_of("dish"), masks={"main": large})
    berry = replace(seen.segment_of("egg"), masks={"main": small})
    view = replace(seen.view, segments=(plate, berry))
    assert find_segment((298.0, 102.0, 423.0, 199.0), view, frame_of(seen)) is plate
    assert find_segment((338.0, 131.0, 371.0, 163.0), view, frame_of(seen)) is berry


# Several boxes ----------------------------------------------------------------------------------------------------


def test_two_boxes_around_one_thing_are_one_match_with_the_better_score(seen):
    left, top, right, bottom = box_around(seen, "egg")
    boxes = [((left, top, right, bottom), 0.4), ((left - 3, top, right, bottom + 2), 0.7)]
    (match,) = match_boxes("egg", boxes, seen.view, frame_of(seen))
    assert match.segment is seen.segment_of("egg")
    assert match.detection.score == 0.7
    assert match.detection.mask is match.segment.masks["main"]


def test_boxes_around_several_things_are_matched_best_first(seen):
    boxes = [(box_around(seen, name), score) for name, score in (("egg", 0.3), ("dish", 0.8), ("carrot", 0.5))]
    matches = match_boxes("thing", boxes, seen.view, frame_of(seen))
    assert [match.segment for match in matches] == [seen.segment_of(name) for name in ("dish", "carrot", "egg")]


def test_reversed_corners_are_put_right():
    assert clip_box((50.0, 80.0, 10.0, 20.0), (480, 640)) == (10.0, 20.0, 50.0, 80.0)


# Depth with holes -------------------------------------------------------------------------------------------------


def test_without_depth_in_the_box_nothing_is_found(seen):
    frame = frame_of(seen)
    left, top, right, bottom = map(int, box_around(seen, "egg"))
    depth = np.array(frame.depth)
    depth[top - 30 : bottom + 30, left - 30 : right + 30] = np.nan
    assert cut_segment(box_around(seen, "egg"), replace(frame, depth=depth)) is None
    assert cut_segment(box_around(seen, "egg"), replace(frame, depth=np.zeros_like(depth))) is None


def test_with_half_of_the_depth_missing_the_thing_is_still_found(seen):
    frame = frame_of(seen)
    known = np.random.default_rng(0).random(frame.depth.shape) < 0.5
    found = cut_segment(box_around(seen, "egg"), replace(frame, depth=np.where(known, frame.depth, np.nan)))
    assert found is not None
    assert off_truth(seen, "egg", found.centre[:2]) < NEAR
    assert np.isfinite(found.points).all()


def test_a_hole_in_the_middle_of_a_shiny_thing_is_no_part_of_it(seen):
    frame = frame_of(seen)
    box = box_around(seen, "tower")
    u, v = round((box[0] + box[2]) / 2), round((box[1] + box[3]) / 2)
    depth = np.array(frame.depth)
    depth[v - 6 : v + 7, u - 6 : u + 7] = np.nan
    found = cut_segment(box, replace(frame, depth=depth))
    assert found is not None
    assert not found.masks["main"][v, u]
    assert off_truth(seen, "tower", found.centre[:2]) < NEAR


# Whatever a network puts out --------------------------------------------------------------------------------------

anything = st.floats(allow_nan=True, allow_infinity=True, width=32)
pixels = st.floats(-200, 900)


@given(boxes=st.lists(st.tuples(st.one_of(*[st.tuples(n, n, n, n) for n in (anything, pixels)]), anything), max_size=4))
@example(boxes=[])
@example(boxes=[((0.0, 0.0, 639.0, 479.0), 1.0)])
@example(boxes=[((10.0, 10.0, 10.0, 10.0), 1.0)])
@example(boxes=[((700.0, 10.0, 900.0, 50.0), 1.0)])
def test_no_box_is_too_strange(seen, boxes):
    matches = match_boxes("thing", boxes, seen.view, frame_of(seen))
    for match in matches:
        left, top, right, bottom = match.detection.box
        assert 0 <= left < right <= 639
        assert 0 <= top < bottom <= 479
        assert 0 <= match.detection.score <= 1
        assert np.isfinite(match.segment.centre).all()
    assert [m.detection.score for m in matches] == sorted((m.detection.score for m in matches), reverse=True)
