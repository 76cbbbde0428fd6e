from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maniagent.perception.detectors.pictures import MIN_SIDE, draw_marks


def table(height: int = 480, width: int = 640) -> np.ndarray:
    return np.full((height, width, 3), 170, np.uint8)


def patch(left: int, top: int, across: int, down: int, shape: tuple[int, int] = (480, 640)) -> np.ndarray:
    mask = np.zeros(shape, bool)
    mask[top : top + down, left : left + across] = True
    return mask


def changed(rgb: np.ndarray, picture: np.ndarray) -> np.ndarray:
    return (picture != rgb).any(axis=-1)


def test_a_small_thing_is_outlined_and_numbered_without_hiding_any_of_it():
    rgb, mask = table(), patch(300, 200, 14, 12)
    drawn = changed(rgb, draw_marks(rgb, [mask]))
    assert drawn.any()
    assert not drawn[mask].any()


def test_a_small_thing_on_a_large_one_stays_in_sight_and_both_are_numbered():
    rgb, berry = table(), patch(330, 230, 20, 20)
    plate = patch(260, 160, 160, 160) & ~berry
    drawn = changed(rgb, draw_marks(rgb, [plate, berry]))
    assert not drawn[berry].any()
    assert drawn[plate].mean() < 0.1


def test_close_small_things_do_not_hide_one_another_and_their_labels_do_not_overlap():
    rgb = table()
    masks = [patch(250 + 60 * column, 180 + 60 * row, 16, 16) for row in range(3) for column in range(3)]
    picture = draw_marks(rgb, masks)
    assert not changed(rgb, picture)[np.any(masks, axis=0)].any()
    dark = (picture < 40).all(axis=-1)
    one = (draw_marks(rgb, masks[:1]) < 40).all(axis=-1)
    assert dark.sum() > 8.5 * one.sum()


@pytest.mark.parametrize("at", [(0, 0), (626, 0), (0, 468), (626, 468)])
def test_a_thing_in_the_corner_has_its_number_within_the_picture(at):
    rgb, mask = table(), patch(*at, 14, 12)
    drawn = changed(rgb, draw_marks(rgb, [mask]))
    assert drawn.sum() > 200
    assert not drawn[mask].any()


def test_small_pictures_are_enlarged_by_a_whole_factor():
    picture = draw_marks(table(192, 256), [patch(100, 80, 30, 20, (192, 256))])
    assert picture.shape == (576, 768, 3)
    assert min(picture.shape[:2]) >= MIN_SIDE


def test_the_picture_that_is_drawn_on_is_another_one():
    rgb = table()
    rgb.setflags(write=False)
    draw_marks(rgb, [patch(0, 0, 100, 100)])
    assert (rgb == 170).all()


def test_an_empty_mask_gets_no_mark():
    assert not changed(table(), draw_marks(table(), [np.zeros((480, 640), bool)])).any()
    assert (draw_marks(table(), []) == table()).all()


def test_a_mask_of_another_size_is_refused():
    with pytest.raises(ValueError, match="480, 640"):
        draw_marks(table(), [np.ones((10, 10), bool)])


@settings(max_examples=40)
@given(
    boxes=st.lists(
        st.tuples(st.integers(0, 639), st.integers(0, 479), st.integers(1, 640), st.integers(1, 480)), max_size=12
    )
)
def test_any_masks_can_be_drawn(boxes):
    assert draw_marks(table(), [patch(*box) for box in boxes]).shape == (480, 640, 3)
